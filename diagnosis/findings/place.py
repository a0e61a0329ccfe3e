"""The place of a gap: in words, tables, maps and profiles."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import degrees
from typing import TYPE_CHECKING, Any

import numpy as np

from diagnosis.findings.finding import Picture
from diagnosis.findings.judged import Judged
from diagnosis.findings.misfit import misfit_scale, run_labels, unit_of, windy
from diagnosis.findings.terms import BANDS, CHANNELS, CONDITIONS, scattering
from diagnosis.model.fact import Fact
from diagnosis.settings.words import WordsSettings
from diagnosis.where.along_motion import PhasePlane
from diagnosis.where.described import BETWEEN_RUNS, Nowhere, PlaceFound, Where
from diagnosis.where.maps import ExcessSpectrum, Maps
from identification.show.blocks import TextTable
from identification.show.drawing import (
    AFTER,
    BEFORE,
    INK,
    MARK,
    NARROW,
    NOISE,
    QUIET,
    SIGMAS,
    colour_bar,
    faded,
)
from identification.show.numbers import p_text, part, plain, reading_shown, share, significant, unit_shown
from identification.show.style import (
    COLOURS,
    INTERVAL,
    MARKERS,
    figure,
    figure_text,
    grid,
    limit_to_known,
    log_axis,
    styled,
)
from tunnel_sim.effects.registry import effect_class
from tunnel_sim.vocabulary.columns import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_WIND = "whether it needs wind cannot be determined"


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
    "wind-off runs show it": lambda given: f"{_alone(given)} it too",
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
"""Reasons why a gap acts on a channel, or needs wind: clauses by kind."""


def reason(given: Fact) -> str:
    """The clause of a reason, a fact of the document."""
    said = REASONS[given.kind]
    return said.format(**given.figures) if isinstance(said, str) else said(given.figures)


def where_words(where: Where, place: PlaceFound | Nowhere | None, judged: Judged) -> str:
    """The place of the gap, in sentences; empty where there is none."""
    if place is None:
        return ""
    if isinstance(place, Nowhere):
        return _nowhere(place)
    settings = judged.settings
    parts = [f"{_which_runs(where, place, settings.words)}."]
    if places := _places(where, place):
        most = part(settings.where.interval_share).capitalize()
        parts.append(f"{most} of the gap lie {', '.join(places)}.")
    if place.bands:
        largest_first = sorted(place.bands.items(), key=lambda item: -item[1])
        listed = (f"{100.0 * share:.0f} % {BANDS[band]}" for band, share in largest_first)
        parts.append(f"By frequency: {', '.join(listed)}.")
    channel, condition = reason(place.channel), reason(place.condition)
    words = CHANNELS.get(where.channel or "")
    acts = f"It acts on {words}" if words else "The residuals alone do not show what it acts on"
    if words and place.compared and (place.alike or not (place.agrees or place.elsewhere)):
        acts = f"It looks like a change of {words}"  # which the causes bring about as well
    between = place.channel.kind in BETWEEN_RUNS and bool(scattering(judged.causes))
    if between:
        acts, channel = "Most of it is between the runs", "each run alone is linear"
    if where.condition is None:
        parts.append(f"{acts}: {channel}; {condition}.")
    else:
        parts.append(f"{acts}: {channel}.")
        if place.wind:  # without runs of both winds the condition goes unsaid
            conditions = {effect_class(name).condition for name in place.compared}
            if conditions and where.condition not in conditions:  # the causes act in other runs, too
                parts.append(f"{condition[:1].upper()}{condition[1:]}.")
            else:
                parts.append(f"It appears {CONDITIONS[where.condition]}: {condition}.")
    return " ".join(filter(None, (*parts, "" if between else _agreement(where, place))))


def _nowhere(found: Nowhere) -> str:
    """The sentence for a campaign without a gap."""
    count = found.runs
    runs = f"Nowhere: in {count} {'run' if count == 1 else 'runs'} the residual is"
    chance = f"p {p_text(found.p_value)} for the run that differs most, corrected for their number"
    if found.within_step:
        return f"{runs} not white noise ({chance}), but within the steps of the readings."
    return f"{runs} consistent with the noise ({chance})."


def _which_runs(where: Where, place: PlaceFound, chosen: WordsSettings) -> str:
    """The runs that show the gap, and the ratio between wind on and off."""
    runs, count = where.runs, place.runs
    share = f"{100.0 * place.share:.0f} % of the gap"
    named = f" ({', '.join(runs)})" if len(runs) <= chosen.runs_listed else ""
    if not runs:
        text = (
            f"No single run is beyond chance (false-alarm rate {100.0 * place.false_alarm_rate:.0f} % over all "
            "runs); the gap shows only in all of them together"
        )
    elif len(runs) == count:
        text = f"All {count} runs show the gap" if count > 1 else "The run shows the gap"
    elif len(runs) == 1:
        text = f"{share} is in one run of {count}{named}"
    else:
        text = f"{share} is in {len(runs)} of {count} runs{named}"
    wind = place.wind
    if runs and len(wind) == 2:
        more, less = sorted(("on", "off"), key=lambda state: -wind[state])
        if wind[less] < chosen.one_wind * wind[more]:
            text += f"; nearly all of it with the wind {more}"
        else:
            ratio = wind[more] / wind[less]
            text += f"; its power is {ratio:.2g} times as large with the wind {more}"
    return text


def _places(where: Where, place: PlaceFound) -> list[str]:
    """The intervals that locate the gap."""
    places = []
    if "time_s" in place.narrow and where.time_s is not None:
        places.append("between {:.1f} and {:.1f} s of the record".format(*where.time_s))
    if "amplitude_rad" in place.narrow and where.amplitude_rad is not None:
        least, most = (f"{float(f'{degrees(one):.2g}'):g}" for one in where.amplitude_rad)
        places.append(f"at amplitudes from {least}° to {most}°")
    if "frequency_hz" in place.narrow and where.frequency_hz is not None:
        places.append("at {:.2f} to {:.2f} Hz".format(*where.frequency_hz))
    return places


def _agreement(where: Where, place: PlaceFound) -> str:
    """Whether causes act at the place that the residuals show; empty where there is nothing to compare."""
    if not place.compared or where.channel is None:
        return ""
    kinds = [effect_class(name) for name in place.compared]
    there = [kind for kind in kinds if where.channel == kind.channel]
    alike = [kind for kind in kinds if kind not in there and where.channel in kind.resembles]
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
        return ""  # the place does not speak against them
    return f"That does not agree with {plain(*place.compared)}: {' and '.join(acting)}."


_UNDETERMINED = "not shown by the residuals alone"


def place_rows(where: Where, judged: Judged) -> tuple[tuple[str, str], ...]:
    """The place of the gap, field by field."""
    degree = unit_shown("rad")[1]
    rows = [("Runs that show it", ", ".join(where.runs) or "–")]
    for label, interval, factor, unit in (
        ("Time", where.time_s, 1.0, " s"),
        ("Amplitude", where.amplitude_rad, degree, "°"),
        ("Frequency", where.frequency_hz, 1.0, " Hz"),
    ):
        ends = [significant(factor * value, 3) for value in interval or ()]
        rows.append((label, f"{' to '.join(ends)}{unit}" if ends else "–"))
    rows.append(("Acts on", CHANNELS.get(where.channel or "", _UNDETERMINED)))
    if windy(judged):
        condition = where.condition
        rows.append(("Acts", _UNDETERMINED if condition is None else CONDITIONS[condition]))
    return tuple(rows)


def lines_table(judged: Judged) -> TextTable:
    """Narrow lines in the residuals."""
    rows = tuple(
        (
            line.run,
            significant(line.frequency_hz, 4),
            reading_shown(line.amplitude_rad, 2, unit_of(judged)),
            share(min(line.share, 1.0)),
        )
        for line in (judged.maps.lines if judged.maps else ())
    )
    heads = ("run", "frequency [Hz]", "amplitude", "share of the run's gap")
    return TextTable("Narrow lines in the residuals", heads, rows, right=heads[1:])


def place_pictures(where: Where, judged: Judged) -> tuple[Picture, ...]:
    """The place of the gap in the data of the figures; none without data, and no map without a gap."""
    maps = judged.maps
    if maps is None:
        return ()
    axis = "time" if maps.grid.wind_speeds is None else "the wind speed"
    place = Picture(
        "place",
        f"Misfit of the nominal model, fitted to all runs, by the amplitude of the motion and {axis}. Empty cells "
        "hold no sample or are within three standard deviations of the noise.",
        "Map of the misfit of the nominal model by amplitude and wind speed, or by amplitude and time.",
        partial(place_figure, judged),
    )
    return (
        *([place] if judged.causes else []),
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
            "interval with four fifths of the gap. Missing moment: the share of its energy by time. It "
            "shows when a moment acts, and so locates a blow.",
            "Excess against time and against amplitude, and the missing moment against time.",
            partial(profiles_figure, where, maps),
        ),
        Picture(
            "where-spectrum",
            "Residual power over noise power, by frequency. Grey: the level of noise alone, within three "
            "standard deviations. In print, yellow: the shortest interval with four fifths of the gap; dark "
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
            partial(phase_plane_figure, maps.phase_plane),
        ),
        Picture(
            "where-moment",
            "Means of the missing moment, with 95 % bands. A dependence on the angle indicates stiffness; a "
            "dependence on the rate indicates damping.",
            "Mean of the missing moment against the angle and against the rate.",
            partial(moment_figure, maps.phase_plane),
        ),
    )


TIME = "time since the start of the record [s]"
LEAST_POWER = 0.3  # of the noise: smaller values are drawn at the edge of the axis
PLACE_HEIGHT = 2.7
"""Height of the map of where the gap is, inches."""
ANGLE, RATE = "angle β [°]", "rate β̇/ω [°]"
_MOST_CURVES = len(COLOURS)
_LONG = 30  # characters of a label
_LEGEND, _HANDLE = 62, 8  # characters: the width of the figure, and the line beside a label


@styled
def place_figure(judged: Judged, height: float = PLACE_HEIGHT) -> Figure | None:
    """Misfit by amplitude and by wind speed, or by time where there is one speed; None without maps.

    Cells within the noise are empty.

    Args:
        height: of the figure, inches; small enough for a phone.
    """
    if judged.maps is None:
        return None
    unit, size = misfit_scale(judged)
    cells = judged.maps.grid
    rows = np.degrees(cells.amplitude_edges_rad)
    speeds = [] if cells.wind_speeds is None else cells.wind_speeds.tolist()
    columns = np.arange(len(speeds) + 1) - 0.5 if cells.time_edges_s is None else cells.time_edges_s
    sizes = np.vectorize(size, otypes=[float])(np.nan_to_num(cells.excess))
    shown = np.where(cells.excess > SIGMAS * cells.std, sizes, np.nan)
    fig = figure(NARROW, height)
    axes = fig.add_subplot()
    top = float(np.nanmax(shown)) if np.isfinite(shown).any() else 1.0
    mesh = axes.pcolormesh(columns, rows, shown, cmap=faded(BEFORE), vmin=0.0, vmax=top)
    if speeds:
        axes.set_xticks(range(len(speeds)), [f"{speed:g}" if speed else "off" for speed in speeds])
    axes.set(xlabel="wind speed [m/s]" if speeds else TIME, ylabel="amplitude [°]")
    axes.set(xlim=(columns[0], columns[-1]), ylim=(0.0, rows[-1]))
    colour_bar(fig, mesh, axes, label=f"root mean square misfit [{unit}]")
    return fig


@styled
def runs_figure(maps: Maps) -> Figure:
    """Excess of every run over time on a logarithmic scale; cells within the noise are empty."""
    from matplotlib.colors import LogNorm

    runs = maps.runs
    fig = figure(NARROW, 1.4 + 0.24 * max(len(runs), 4))
    axes = fig.add_subplot()
    first, *_, last = maps.time.edges_s.tolist()
    cells, floor, top = run_cells(maps)
    image = axes.imshow(
        cells, aspect="auto", extent=(first, last, len(runs) - 0.5, -0.5), cmap=faded(BEFORE),
        norm=LogNorm(floor, top), interpolation="nearest",
    )  # fmt: skip
    if not np.isfinite(cells).any():
        axes.text(0.5, 0.5, "every cell within the noise", transform=axes.transAxes, ha="center")
    axes.set_yticks(range(len(runs)), [*map(figure_text, run_labels(runs))])
    axes.set_xlabel(TIME)
    colour_bar(fig, image, axes, location="top", label="excess (noise variances)", aspect=50)
    return fig


def run_cells(maps: Maps) -> tuple[Array, float, float]:
    """Excess by run and bin of time, shape (runs, n), NaN within the noise; and the limits of its scale."""
    cells, times = maps.time.by_run, maps.time.edges_s
    floor = SIGMAS * float(min(run.std for run in maps.runs) * np.sqrt(times.size - 1))
    known = cells[np.isfinite(cells)]
    return np.where(cells > floor, cells, np.nan), floor, max(float(known.max(initial=0.0)), 2.0 * floor)


@styled
def profiles_figure(where: Where, maps: Maps) -> Figure:
    """Excess over time and amplitude, all runs together, and the times at which a moment is missing.

    The shaded intervals contain four fifths of the gap.
    """
    swings = None if where.amplitude_rad is None else np.degrees(where.amplitude_rad).tolist()
    fig = figure(NARROW, 6.0)
    by_time, moment, by_amplitude = fig.subplots(3, 1, height_ratios=(1.3, 0.8, 1.3))
    for axes, values, bounds, interval in (
        (by_time, maps.time, maps.time.edges_s, where.time_s),
        (by_amplitude, maps.amplitude, np.degrees(maps.amplitude.edges_rad), swings),
    ):
        mean, std = values.excess, values.std
        if interval is not None:
            axes.axvspan(*interval, color=MARK, alpha=0.28, linewidth=0)
        axes.stairs(SIGMAS * std, bounds, baseline=-SIGMAS * std, fill=True, color=NOISE)
        axes.stairs(mean, bounds, color=BEFORE, linewidth=1.4)
        axes.set(xlim=(0.0, bounds[-1]), ylabel="excess (noise variances)")
        axes.set_ylim(min(-4.0 * float(np.nanmedian(std)), 1.05 * float(np.nanmin(mean))), None)
        grid(axes)
    by_time.tick_params(labelbottom=False)
    # The missing moment's energy shows when a moment acts, not the duration of the motion after it.
    edges, share = maps.time.edges_s, 100.0 * maps.time.moment_share
    moment.stairs(share, edges, fill=True, color=AFTER, alpha=0.6)
    moment.set(xlim=(0.0, edges[-1]), ylim=(0.0, 1.05 * max(float(share.max()), 20.0)))
    moment.set(xlabel=TIME, ylabel="missing moment\n[% of its energy]")
    grid(moment)
    by_amplitude.set_xlabel("amplitude of the motion [°]")
    return fig


@styled
def spectrum_figure(where: Where, given: ExcessSpectrum) -> Figure:
    """Residual power over frequency, all runs together, before and after, on logarithmic axes.

    The shaded interval contains four fifths of the gap.
    """
    interval = where.frequency_hz
    fig = figure(NARROW, 3.0)
    axes = fig.add_subplot()
    edges, centre = spectrum_axis(given)
    known = np.isfinite(given.excess)
    centre, noise = centre[known], SIGMAS * given.std[known]
    if interval is not None:
        axes.axvspan(*interval, color=MARK, alpha=0.28, linewidth=0)
    low, high = given.resonance_hz
    axes.axvspan(0.985 * low, 1.015 * high, ymax=0.035, color=QUIET, linewidth=0)
    floor = np.maximum(1.0 - noise, LEAST_POWER)
    axes.fill_between(centre, floor, 1.0 + noise, color=NOISE, linewidth=0, label="noise (3σ)")
    before = np.maximum((given.excess + 1.0)[known], LEAST_POWER)
    axes.plot(centre, before, color=BEFORE, label="nominal model")
    if given.after is not None:
        after = np.maximum((given.after + 1.0)[known], LEAST_POWER)
        axes.plot(centre, after, color=AFTER, lw=1.2, label="with the causes")
    axes.set(xscale="log", yscale="log", xlim=(edges[0], edges[-1]), ylabel="residual power over noise")
    axes.set_xlabel("frequency [Hz]; dark bar: the natural frequencies of the runs")
    axes.legend(loc="upper right")
    grid(axes)
    return fig


def spectrum_axis(given: ExcessSpectrum) -> tuple[Array, Array]:
    """Edges of the bins for a logarithmic scale, the first half the second instead of zero; and centres, Hz."""
    edges = given.edges_hz
    positive = np.concatenate([[0.5 * edges[1]], edges[1:]])
    return positive, np.sqrt(positive[:-1] * positive[1:])


@styled
def phase_plane_figure(plane: PhasePlane | None) -> Figure | None:
    """The missing moment over angle and rate; None where it is not known."""
    if plane is None:
        return None
    low, *_, high = np.degrees(plane.edges_rad).tolist()
    clear, reach, unit, _ = plane_cells(plane)
    fig = figure(NARROW, 4.4)
    axes = fig.add_subplot()
    image = axes.imshow(
        clear, origin="lower", extent=(low, high, low, high), cmap=faded(AFTER, BEFORE),
        vmin=-reach, vmax=reach, interpolation="nearest",
    )  # fmt: skip
    axes.set(xlabel=ANGLE, ylabel=RATE)
    colour_bar(fig, image, axes, location="top", label=f"missing moment [{unit}]", shrink=0.9, aspect=40)
    return fig


@styled
def moment_figure(plane: PhasePlane | None) -> Figure | None:
    """Means of the missing moment over all rates and over all angles; None where it is not known."""
    if plane is None:
        return None
    edges = np.degrees(plane.edges_rad)
    _, _, unit, factor = plane_cells(plane)
    fig = figure(NARROW, 5.0)
    centre = 0.5 * (edges[1:] + edges[:-1])
    for axes, mean, std, label, others in zip(
        fig.subplots(2, 1),
        (plane.by_angle, plane.by_rate),
        (plane.by_angle_std, plane.by_rate_std),
        (ANGLE, RATE),
        ("rates", "angles"),
        strict=True,
    ):
        mean, band = factor * mean, INTERVAL * (factor * std)
        axes.axhline(0.0, color=QUIET, linewidth=0.8)
        axes.fill_between(centre, mean - band, mean + band, color=BEFORE, alpha=0.2, lw=0)
        axes.plot(centre, mean, color=BEFORE, marker="o", ms=3)
        axes.set(xlabel=label, ylabel=f"mean over all {others} [{unit}]")
        grid(axes)
    return fig


def plane_cells(plane: PhasePlane) -> tuple[Array, float, str, float]:
    """The missing moment by rate (rows) and angle (columns), NaN within three standard deviations of zero.

    Also the greatest value of its scale, a unit that suits the size of the values, and the factor from the
    document's unit to it.
    """
    moment, std = plane.moment, plane.std
    known = np.abs(moment[np.isfinite(moment)])
    unit, factor = plane.unit.replace("rad/s2", "rad/s²"), 1.0
    if known.size and known.max() < 0.1:
        unit, factor = f"10⁻³ {unit}", 1e3
    reach = float(np.quantile(known, 0.98)) * factor if known.size else 1.0
    return np.where(np.abs(moment) > SIGMAS * std, moment * factor, np.nan), reach, unit, factor


@styled
def backbone_figure(where: Where, maps: Maps) -> Figure:
    """Frequency and damping against amplitude, relative to the nominal model's, with 95 % bands."""
    curves = [curve for curve in maps.backbones if curve.time_s.size > 1]
    named = [curve for curve in curves if curve.id in where.runs]
    # first the runs that show the gap, in the campaign's order, then the others for comparison
    chosen = (named + [curve for curve in curves if curve not in named])[:_MOST_CURVES]
    labels = {run.id: figure_text(label) for run, label in zip(maps.runs, run_labels(maps.runs), strict=True)}
    fig = figure(NARROW, 7.0)
    frequency, damping = fig.subplots(2, 1)
    drawn: dict[Axes, list[tuple[Array, Array]]] = {frequency: [], damping: []}
    for index, curve in enumerate(chosen):
        order = np.argsort(curve.amplitude_rad)
        x, nominal = np.degrees(curve.amplitude_rad[order]), curve.nominal_frequency_hz
        colour, marker = COLOURS[index], MARKERS[(index + index // len(MARKERS)) % len(MARKERS)]
        shift = 100.0 * (curve.frequency_hz / nominal - 1.0)
        change = 1e3 * (curve.zeta - curve.nominal_zeta)
        for axes, y, std, label in (
            (frequency, shift, 100.0 * curve.frequency_std / nominal, None),
            (damping, change, 1e3 * curve.zeta_std, labels[curve.id]),
        ):
            drawn[axes].append((y, std))
            y, band = y[order], INTERVAL * std[order]
            axes.fill_between(x, y - band, y + band, color=colour, alpha=0.15, linewidth=0)
            axes.plot(x, y, color=colour, marker=marker, ms=3.5, lw=1.0, label=label)
    frequency.set_ylabel("frequency minus\nthe nominal one [%]")
    damping.set_ylabel("damping ratio minus\nthe nominal one [10⁻³]")
    for axes, pairs in drawn.items():
        axes.axhline(0.0, color=INK, linewidth=1.0)
        axes.set_xlabel("amplitude [°]")
        grid(axes)
        if pairs:
            limit_to_known(axes, *(np.concatenate(column) for column in zip(*pairs, strict=True)))
            log_axis(axes, "x")
    if chosen:
        longest = max(len(labels[curve.id]) for curve in chosen)
        columns = min(3, _LEGEND // (longest + _HANDLE)) or 1
        fig.legend(loc="outside lower center", ncols=columns, fontsize="x-small" if longest > _LONG else None)
    return fig
