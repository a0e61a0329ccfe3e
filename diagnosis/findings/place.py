"""The place of a gap: in words and tables, and the list of its figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

from diagnosis.findings.finding import Judged, Picture
from diagnosis.findings.place_figures import (
    backbone_figure,
    moment_figure,
    phase_plane_figure,
    place_figure,
    profiles_figure,
    runs_figure,
    spectrum_figure,
)
from diagnosis.findings.terms import BANDS, CHANNELS, CONDITIONS, named_runs, scattering
from diagnosis.model.fact import Fact
from diagnosis.where.described import BETWEEN_RUNS, Nowhere, PlaceFound, Where
from diagnosis.where.maps import Maps
from identification.show.blocks import TextTable
from identification.show.numbers import (
    joined_mark,
    motion_shown,
    p_text,
    part,
    plain,
    reading_shown,
    share,
    significant,
)
from tunnel_sim.effects.capabilities import SecondOscillation
from tunnel_sim.effects.registry import effect_class

RUNS_LISTED: Final = 12
"""Maximum number of runs in a sentence. Judgement."""
RUNS_TO_LOOK_AT: Final = 4
"""Maximum number of runs that a step names; for more runs it gives the number. Judgement."""
ONE_WIND: Final = 0.02
"""Maximum ratio of the powers with and without wind (the smaller over the larger) at which nearly all of the
gap belongs to the larger. Judgement."""

_WIND = "whether it needs wind cannot be determined"
_WIND_OFF = "wind-off runs show it"


def _alone(given: Mapping[str, Any]) -> str:
    """The wind-off runs as a subject with its verb."""
    one = given["runs"] == 1
    count = "the wind-off run" if one else f"the {given['runs']} wind-off runs"
    return f"{count}, fitted alone, show{'s' * one}"


REASONS: Mapping[str, str | Callable[[Mapping[str, Any]], str]] = {
    "wind off": "it appears with the wind off",
    "wind on in every run": f"{_WIND}, since the wind is on in every run",
    "no single run": f"{_WIND}, since no single run shows it",
    "one run": f"{_WIND} from one run alone ({{run}})",
    "wind-off runs not fitted": f"{_WIND}, since the wind-off runs could not be fitted alone",
    _WIND_OFF: lambda given: f"{_alone(given)} it too",
    "wind-off runs show none": lambda given: f"{_alone(given)} no gap",
    "blow": "most of the missing moment acts between {from_s:.1f} and {to_s:.1f} s",
    "spectral line": "it is a spectral line near {frequency_hz:.3g} Hz",
    "too fast": "most of it is faster than the rig can move",
    "shifted centre and harmonic": "the centre shifts together with the second harmonic of the motion",
    "shifted centre with wind": "most of it is a slow shift of the centre that needs wind",
    "shifted centre": "most of it is a slow shift of the centre",
    "harmonics": "it contains harmonics of the motion, without a shift of frequency or damping",
    "every run driven": "every run is driven, so that no decay shows it",
    "frequency along the decay": "the frequency shifts along the decay more than the damping does",
    "damping along the decay": "the damping shifts along the decay more than the frequency does",
    "both along the decay": "the frequency and the damping shift by similar amounts along the decay",
    "frequency between runs": "each run alone is linear, but the runs' frequencies do not agree with one model: a "
    "stated value is wrong, a stiffness is missing, or the runs differ by chance",
    "damping between runs": "each run alone is linear, but the runs' damping does not agree with one model",
}
"""Clauses by kind: reasons for a channel of the gap, or for its dependence on wind."""


def reason(given: Fact) -> str:
    """The clause of a reason, a fact of the document."""
    said = REASONS[given.kind]
    return said.format(**given.figures) if isinstance(said, str) else said(given.figures)


def where_words(where: Where, place: PlaceFound | Nowhere | None, judged: Judged) -> str:
    """The place of the gap, in sentences; empty if there is none."""
    if place is None:
        return ""
    if isinstance(place, Nowhere):
        return _nowhere(place, judged.settings.where.run_rate)
    parts = [f"{_which_runs(where, place)}."]
    if places := _places(where, place, judged.misfit.unit):
        most = part(judged.settings.where.interval_share).capitalize()
        parts.append(f"{most} of the gap lie {', '.join(places)}.")
    if place.bands:
        largest_first = sorted(place.bands.items(), key=lambda item: -item[1])
        listed = (f"{100.0 * share:.0f} % {BANDS[band]}" for band, share in largest_first)
        parts.append(f"By frequency: {', '.join(listed)}.")
    channel, condition = reason(place.channel), reason(place.condition)
    words = CHANNELS.get(where.channel or "")
    acts = f"It acts on {words}" if words else "The residuals alone do not show what it acts on"
    if words and place.compared and (place.alike or not (place.agrees or place.elsewhere)):
        acts = f"It looks like a change of {words}"  # the causes produce the same pattern
    agreement = _agreement(where, place)
    between = place.channel.kind in BETWEEN_RUNS and bool(scattering(judged.causes))
    if between:
        acts, channel, agreement = "Most of it is between the runs", "each run alone is linear", ""
    if where.condition is None:
        parts.append(f"{acts}: {channel}; {condition}.")
    else:
        parts.append(f"{acts}: {channel}.")
        if place.wind:  # runs with wind and without it are needed to state the condition
            conditions = {effect_class(name).condition for name in place.compared}
            if conditions and where.condition not in conditions:  # the causes act in other runs
                if place.condition.kind == _WIND_OFF:  # a gap of their own
                    condition = f"{_alone(place.condition.figures)} a gap too"
                parts += [agreement, f"{condition[:1].upper()}{condition[1:]}."]
                agreement = ""
            else:
                parts.append(f"It appears {CONDITIONS[where.condition]}: {condition}.")
    return " ".join(filter(None, (*parts, agreement)))


def _nowhere(found: Nowhere, run_rate: float) -> str:
    """The sentence for a campaign without a gap.

    Args:
        run_rate: false-alarm rate of the test of single runs.
    """
    count = found.runs
    runs = f"Nowhere: in {count} {'run' if count == 1 else 'runs'} the residual is"
    chance = f"p {p_text(found.p_value)} for the run that differs most, corrected for their number"
    if found.within_step:
        return f"{runs} not white noise ({chance}), but within the steps of the readings."
    departs = count > 1 and found.p_value < run_rate  # all runs together show no gap
    together = " together, though one alone departs from it" if departs else ""
    return f"{runs} consistent with the noise{together} ({chance})."


def _which_runs(where: Where, place: PlaceFound) -> str:
    """The runs that show the gap, and the ratio between wind on and off."""
    runs, count = where.runs, place.runs
    share = f"{100.0 * place.share:.0f} % of the gap"
    named = f" ({', '.join(runs)})" if len(runs) <= RUNS_LISTED else ""
    if not runs:
        text = (
            f"No single run is beyond chance (false-alarm rate {100.0 * place.false_alarm_rate:.0f} % over all "
            "runs); the gap shows only in all of them together"
        )
    elif len(runs) == count:
        every = "Both" if count == 2 else f"All {count}"
        text = f"{every} runs show the gap" if count > 1 else "The run shows the gap"
    elif len(runs) == 1:
        text = f"{share} is in one run of {count}{named}"
    else:
        text = f"{share} is in {len(runs)} of {count} runs{named}"
    wind = place.wind
    if runs and len(wind) == 2:
        more, less = sorted(("on", "off"), key=lambda state: -wind[state])
        if wind[less] < ONE_WIND * wind[more]:
            text += f"; nearly all of it with the wind {more}"
        else:
            ratio = f"{wind[more] / wind[less]:.2g}"
            alike = "as large with the wind on as with it off"
            text += (
                f"; its power is {alike if ratio == '1' else f'{ratio} times as large with the wind {more}'}"
            )
    return text


def _places(where: Where, place: PlaceFound, unit: str) -> list[str]:
    """The intervals that contain the gap.

    Args:
        unit: unit of the readings.
    """
    places = []
    if "time_s" in place.narrow and where.time_s is not None:
        places.append("between {:.1f} and {:.1f} s of the record".format(*where.time_s))
    if "amplitude_rad" in place.narrow and where.amplitude_rad is not None:
        mark, factor = motion_shown(unit)
        least, most = (f"{float(f'{factor * one:.2g}'):g}{joined_mark(mark)}" for one in where.amplitude_rad)
        places.append(f"at amplitudes from {least} to {most}")
    if "frequency_hz" in place.narrow and where.frequency_hz is not None:
        places.append("at {:.2f} to {:.2f} Hz".format(*where.frequency_hz))
    return places


def runs_of_the_gap(where: Where, place: PlaceFound | None) -> str:
    """The runs that show the gap, by name where not all do."""
    if not place or not 0 < len(where.runs) < place.runs:
        return "the runs"
    return named_runs(where.runs) if len(where.runs) <= RUNS_TO_LOOK_AT else f"the {len(where.runs)} runs"


def _agreement(where: Where, place: PlaceFound) -> str:
    """Whether causes act at the place that the residuals show; empty if there is nothing to compare."""
    if not place.compared or where.channel is None:
        return ""
    kinds = [effect_class(name) for name in place.compared]
    there = [kind for kind in kinds if where.channel == kind.channel]
    beside = [kind for kind in kinds if kind not in there and issubclass(kind, SecondOscillation)]
    alike = [kind for kind in beside if where.channel in kind.resembles]
    elsewhere: dict[str, list[str]] = {}
    for kind in (kind for kind in kinds if kind not in there):
        elsewhere.setdefault(CHANNELS[kind.channel], []).append(kind.name)
    acting = [
        f"{plain(*names) if len(kinds) > 1 else 'it'} act{'s' * (len(names) == 1)} on {acts}"
        for acts, names in elsewhere.items()
    ]
    if not elsewhere:
        return f"That agrees with {plain(*place.compared)}."
    if there:
        acts_there = f"{plain(*(kind.name for kind in there))} act{'s' * (len(there) == 1)} there"
        return f"{acts_there[0].upper()}{acts_there[1:]}; {' and '.join(acting)}."
    if alike:
        names = plain(*(kind.name for kind in alike))
        return f"{names[0].upper()}{names[1:]} look{'s' * (len(alike) == 1)} like this in a decay."
    if not place.elsewhere:
        return ""  # the place does not contradict the causes
    return f"That does not agree with {plain(*place.compared)}: {' and '.join(acting)}."


_UNDETERMINED = "not shown by the residuals alone"


def place_rows(where: Where, judged: Judged) -> tuple[tuple[str, str], ...]:
    """The place of the gap, field by field."""
    mark, degree = motion_shown(judged.misfit.unit)
    rows = [("Runs that show it", ", ".join(where.runs) or "–")]
    for label, interval, factor, unit in (
        ("Time", where.time_s, 1.0, " s"),
        ("Amplitude", where.amplitude_rad, degree, joined_mark(mark)),
        ("Frequency", where.frequency_hz, 1.0, " Hz"),
    ):
        ends = [significant(factor * value, 3) for value in interval or ()]
        rows.append((label, f"{' to '.join(ends)}{unit}" if ends else "–"))
    rows.append(("Acts on", CHANNELS.get(where.channel or "", _UNDETERMINED)))
    if judged.windy:
        condition = where.condition
        rows.append(("Acts", _UNDETERMINED if condition is None else CONDITIONS[condition]))
    return tuple(rows)


def lines_table(maps: Maps | None, unit: str) -> TextTable:
    """Narrow lines in the residuals.

    Args:
        unit: unit of the readings.
    """
    rows = tuple(
        (
            line.run,
            significant(line.frequency_hz, 4),
            reading_shown(line.amplitude_rad, 2, unit),
            share(min(line.share, 1.0)),
        )
        for line in (maps.lines if maps else ())
    )
    heads = ("run", "frequency [Hz]", "amplitude", "share of the run's gap")
    return TextTable("Narrow lines in the residuals", heads, rows, right=heads[1:])


def place_pictures(maps: Maps | None, judged: Judged) -> tuple[Picture, ...]:
    """The figure of the map of the gap; none without data or a gap."""
    if maps is None or not judged.causes:
        return ()
    axis = "time" if maps.grid.wind_speeds is None else "the wind speed"
    place = Picture(
        "place",
        f"Misfit of the nominal model, fitted to all runs, by the amplitude of the motion and {axis}. Empty cells "
        "hold no sample or are within three standard deviations of the noise.",
        "Map of the misfit of the nominal model by amplitude and wind speed, or by amplitude and time.",
        partial(place_figure, maps.grid, judged.misfit),
    )
    return (place,)


def where_pictures(where: Where, maps: Maps | None) -> tuple[Picture, ...]:
    """The figures of the place of the gap; none without data."""
    if maps is None:
        return ()
    return (
        Picture(
            "where-runs",
            "Excess of every run over time: the mean squared residual of the nominal model over the noise "
            "variance, minus one, on a logarithmic scale. Empty cells are within three standard deviations "
            "of the noise.",
            "Heat map of the excess of every run over time.",
            partial(runs_figure, maps),
        ),
        Picture(
            "where-profiles",
            "Excess of all runs together over time and over amplitude, in the frequency bands that show the "
            "gap. Grey: the level of noise alone, within three standard deviations. Yellow: the shortest "
            "interval with 80 % of the gap. Missing moment: the share of its energy by time. It "
            "shows when a moment acts, and so locates a blow.",
            "Excess against time and against amplitude, and the missing moment against time.",
            partial(profiles_figure, where, maps),
        ),
        Picture(
            "where-spectrum",
            "Residual power over noise power, by frequency. Grey: the level of noise alone, within three "
            "standard deviations. In print, yellow: the shortest interval with 80 % of the gap; dark "
            "bar on the axis: the natural frequencies of the runs.",
            "Residual power against frequency, with the nominal model and with the causes added.",
            partial(spectrum_figure, where, maps.frequency),
        ),
        Picture(
            "where-backbones",
            "Backbone curves: each run in consecutive windows of three cycles (one cycle where the record "
            "is short), with 95 % bands; values with far wider bands lie beyond the axes. A linear rig "
            "gives horizontal lines. Separate horizontal lines mean that the runs disagree. Curved "
            "frequency lines indicate an effect on the stiffness; curved damping lines indicate an effect "
            "on the damping.",
            "Frequency and damping ratio of each run against amplitude, relative to the nominal model.",
            partial(backbone_figure, where, maps),
        ),
        Picture(
            "where-phase-plane",
            "The moment that the nominal model lacks, over the runs that show the gap. It is computed from "
            "the residuals with the fitted equation of motion. Empty cells are within three standard "
            "deviations of zero. The part that the nominal coefficients absorb is not shown.",
            "Map of the missing moment over angle and rate.",
            partial(phase_plane_figure, maps.phase_plane, maps.unit),
        ),
        Picture(
            "where-moment",
            "Means of the missing moment, with 95 % bands. A dependence on the angle indicates stiffness; a "
            "dependence on the rate indicates damping.",
            "Mean of the missing moment against the angle and against the rate.",
            partial(moment_figure, maps.phase_plane, maps.unit),
        ),
    )
