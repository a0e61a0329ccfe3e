"""Where the nominal model departs from the runs, from its residuals alone: no effect is known here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import degrees

import numpy as np

from diagnosis import policy
from diagnosis.likelihood.least_squares import Fit, FitError, fit
from diagnosis.likelihood.prepare import prepare
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import nominal_start
from diagnosis.printing import plain
from diagnosis.result import Where
from diagnosis.where.along_motion import drift
from diagnosis.where.excess import RunExcess, band_excesses, run_excesses, shortest_interval
from diagnosis.where.survey import Survey, survey
from identification.printing import p_text
from tunnel_sim.effects import Effect
from tunnel_sim.vocabulary.campaign import Campaign


@dataclass(frozen=True)
class Finding:
    """A conclusion with its reason.

    Args:
        value: the conclusion; None where the runs do not allow one.
    """

    value: str | None
    reason: str


@dataclass(frozen=True, eq=False)
class Place:
    """Where a gap is.

    Args:
        runs: ids of the runs beyond chance.
    """

    survey: Survey
    runs: tuple[str, ...]
    channel: Finding
    condition: Finding


def locate(campaign: Campaign, nominal: Fit, *, hum_removed: bool = False, noise_ratio: float = 1.0) -> Place:
    """Find where the nominal model departs from the runs.

    Args:
        campaign: as measured, of the units of the fit.
        nominal: fit of the nominal model.
        hum_removed: whether a hum was removed before the fit. It is part of the gap: the residuals get it back.
        noise_ratio: of the noise variance of the fit to the one that counts: where the readings' step is coarser
            than stated, it raises the noise found in the records, and the stated noise is the measure.
    """
    data, residuals = nominal.problem.data, nominal.residuals
    if hum_removed:
        given = prepare(campaign, {run.id: run.noise_variance for run in data.runs}, data.similarity)
        readings = {run.id: run.reading for run in given.runs}
        # the fit may leave a record's start out; both end together
        residuals = [
            r + run.scaled(readings[run.id][-run.reading.size :] - run.reading)
            for r, run in zip(residuals, data.runs, strict=True)
        ]
    scaled = replace(nominal, residuals=[r * np.sqrt(noise_ratio) for r in residuals])
    excesses = run_excesses(campaign, scaled)
    runs = runs_beyond_chance(excesses)
    found = survey(nominal, scaled, excesses, runs)
    condition = infer_condition(campaign, nominal, found)
    return Place(found, runs, infer_channel(nominal, found, condition.value), condition)


def runs_beyond_chance(excesses: Sequence[RunExcess]) -> tuple[str, ...]:
    """The runs beyond chance (1 % over all) that have a tenth or more of the largest excess among them."""
    clear = {
        run.id: run.excess
        for run in excesses
        if run.p_value() * len(excesses) < policy.LOCAL_FALSE_ALARM_RATE
    }
    least = policy.NAMED_RUN_SHARE * max(clear.values(), default=0.0)
    return tuple(name for name, excess in clear.items() if excess > least)


def infer_condition(campaign: Campaign, nominal: Fit, found: Survey) -> Finding:
    """Whether the gap needs wind: ``wind_on`` where the wind-off runs, fitted alone, show no gap."""
    runs, shown = nominal.problem.data.runs, found.maps.runs
    off = tuple(run.id for run in runs if not run.wind_on)
    if len(off) == len(runs):
        return Finding("always", "it is there with the wind off")
    undetermined = "whether it needs wind cannot be determined"
    if not off:
        return Finding(None, f"{undetermined}, since the wind is on in every run")
    if min(run.p_value for run in shown) * len(runs) > policy.LOCAL_FALSE_ALARM_RATE:
        return Finding(None, f"{undetermined}, since no single run shows it")
    most = max(shown, key=lambda run: run.share)
    if len(shown) >= 3 and most.share > policy.SINGLE_RUN_SHARE and most.id not in off:
        return Finding(None, f"{undetermined} from one run alone ({most.id})")
    # without coefficients and a gain that these runs lack
    data = replace(nominal.problem.data.subset(off), windy=False, keeps_gain=False)
    try:
        alone = fit(Problem(data), nominal_start(data))
    except FitError:
        return Finding(None, f"{undetermined}, since the wind-off runs could not be fitted alone")
    excesses = run_excesses(campaign, alone)
    tests = [run.p_value() for run in excesses]
    tests += [band.p_value for band in band_excesses(excesses)]
    count = "the wind-off run" if len(off) == 1 else f"the {len(off)} wind-off runs"
    show = f"{count}, fitted alone, show{'s' * (len(off) == 1)}"
    if min(tests) * len(tests) < policy.LOCAL_FALSE_ALARM_RATE:
        return Finding("always", f"{show} it too")
    return Finding("wind_on", f"{show} no gap")


def blow_interval(found: Survey, share: float = 0.5) -> tuple[float, float] | None:
    """The time in which most of the missing moment acts, where that is a small part of the record.

    Args:
        share: of the moment's energy, a fraction.

    Returns:
        Start and end since the start of the record, s; None where the moment is spread out, acts at the release,
        or is not clear of the noise.
    """
    edges = found.maps.time.edges
    interval = shortest_interval(edges, found.moment_energy, share)
    if interval is None or found.moment_z < policy.CLEAR_MOMENT:
        return None
    length = float(edges[-1])
    brief = interval[1] - interval[0] <= policy.BLOW_SHARE * length
    return interval if brief and interval[0] > 0.05 * length else None


def infer_channel(nominal: Fit, found: Survey, condition: str | None) -> Finding:
    """What the gap acts on, from features of the residual; the condition is the one inferred."""
    blow = blow_interval(found)
    if blow is not None:
        return Finding(
            "forcing", f"most of the missing moment acts between {blow[0]:.1f} and {blow[1]:.1f} s"
        )
    # most of the excess may be a line, or lie beside the frequency of the motion
    excess = {band.band: max(band.excess, 0.0) for band in found.maps.bands}
    whole = max(sum(excess.values()), 1e-300)
    lines = [line for line in found.maps.lines if line.share > 0.5 * policy.DOMINANT_SHARE]
    if lines and len(lines) >= max(1, len(found.maps.runs) // 3):
        hertz = float(np.median([line.frequency for line in lines]))
        similar = nominal.problem.data.similarity.similar(hertz, "Hz")
        return Finding(
            "forcing" if similar < policy.FASTEST_MOMENT else "sensor",
            f"it is a spectral line near {hertz:.3g} Hz",
        )
    if excess.get("above", 0.0) > policy.DOMINANT_SHARE * whole:
        return Finding("sensor", "most of it is faster than the rig can move")
    if excess.get("0", 0.0) > policy.DOMINANT_SHARE * whole:
        if excess.get("2f0", 0.0) > policy.SECOND_HARMONIC_SHARE * whole:
            return Finding("stiffness", "the centre shifts together with the second harmonic of the motion")
        if condition == "wind_on":
            return Finding("forcing", "most of it is a slow shift of the centre that needs wind")
        return Finding("sensor", "most of it is a slow shift of the centre")
    if sum(excess.get(band, 0.0) for band in ("2f0", "3f0", "above")) > policy.DOMINANT_SHARE * whole:
        return Finding(
            "sensor", "it contains harmonics of the motion, without a shift of frequency or damping"
        )
    apart = _between_runs(nominal, found)
    if apart is not None:
        return apart
    if all(run.drive is not None for run in nominal.problem.data.runs):
        return Finding(None, "every run is driven, so that no decay shows it")
    frequency, damping = drift(list(found.maps.backbones))
    if frequency > policy.DRIFT_RATIO * max(damping, 0.0) and frequency > 0.0:
        return Finding("stiffness", "the frequency shifts along the decay more than the damping does")
    if damping > policy.DRIFT_RATIO * max(frequency, 0.0) and damping > 0.0:
        return Finding("damping", "the damping shifts along the decay more than the frequency does")
    return Finding(None, "the frequency and the damping shift by similar amounts along the decay")


def _between_runs(nominal: Fit, found: Survey) -> Finding | None:
    """The channel where every run alone is linear, but the runs do not agree on the coefficients."""
    sizes = [run.reading.size for run in nominal.problem.data.runs]
    left, shifts = 0.0, []
    for curve, size in zip(found.maps.backbones, sizes, strict=True):
        if curve.alone_excess is None or curve.alone_frequency is None or curve.alone_zeta is None:
            return None
        left += max(curve.alone_excess, 0.0) * size
        frequency = curve.alone_frequency / curve.nominal_frequency - 1.0
        shifts.append((frequency, curve.alone_zeta - curve.nominal_zeta))
    whole = sum(max(run.excess, 0.0) * n for run, n in zip(found.excesses, sizes, strict=True))
    if len(sizes) < 2 or left > policy.BETWEEN_RUNS_SHARE * whole:
        return None
    frequency, damping = np.sum(np.array(shifts) ** 2, axis=0)
    if frequency >= damping:  # as with a wrong spring, but also with gravity or a flexible rod beside several
        return Finding(
            None,
            "each run alone is linear, but the runs' frequencies do not agree with one model: a stated value is "
            "wrong, or a stiffness is missing",
        )
    return Finding("damping", "each run alone is linear, but the runs' damping does not agree with one model")


_LISTED = 12  # ids listed in a sentence at most
_NEARLY_NOTHING = 0.02  # of the power of the other runs
_BAND_WORDS = {
    "0": "slower than the oscillation",
    "f0": "at the oscillation itself",
    "2f0": "at twice its frequency",
    "3f0": "at three times its frequency",
    "above": "faster than its third harmonic",
}
_CHANNEL_WORDS = {
    "stiffness": "the restoring moment (stiffness)",
    "damping": "the damping",
    "forcing": "the rig as a moment that does not depend on its motion (forcing)",
    "sensor": "the reading of the sensor",
    "calibration": "a value stated for the runs (calibration)",
}
_CONDITION_WORDS = {"always": "with the wind on and off", "wind_on": "only with the wind on"}


def nowhere(found: Survey, *, within_step: bool) -> str:
    """The sentence for a campaign without a gap.

    Args:
        within_step: whether the residual is not white, but within the steps of the readings.
    """
    count = len(found.maps.runs)
    least = min(1.0, count * min(run.p_value for run in found.maps.runs))
    runs = f"Nowhere: in {count} {'run' if count == 1 else 'runs'} the residual is"
    chance = f"p {p_text(least)} for the run that differs most, corrected for their number"
    if within_step:
        return f"{runs} not white noise ({chance}), but within the steps of the readings."
    return f"{runs} consistent with the noise ({chance})."


def describe(
    where: Where, found: Survey, bands: tuple[str, ...], channel: Finding, condition: Finding
) -> str:
    """Where the gap is, in sentences; the bands are those that show it."""
    # which runs show the gap, and how much more of it is with the wind on or off
    count, rate = len(found.maps.runs), 100.0 * policy.LOCAL_FALSE_ALARM_RATE
    share = sum(run.share for run in found.maps.runs if run.id in where.runs)
    named = f" ({', '.join(where.runs)})" if len(where.runs) <= _LISTED else ""
    if not where.runs:
        text = (
            f"No single run is beyond chance (false-alarm rate {rate:.0f} % over all runs); "
            "the gap shows only in all of them together"
        )
    elif len(where.runs) == count:
        text = f"All {count} runs show the gap" if count > 1 else "The run shows the gap"
    elif len(where.runs) == 1:
        text = f"{100.0 * share:.0f} % of the gap is in one run of {count}{named}"
    else:
        text = f"{100.0 * share:.0f} % of the gap is in {len(where.runs)} of {count} runs{named}"
    groups = {group.label: group.excess for group in found.maps.groups if group.by == "wind"}
    if where.runs and len(groups) == 2:
        more, less = sorted(("on", "off"), key=lambda wind: -groups[wind])
        if groups[less] < _NEARLY_NOTHING * groups[more]:
            text += f"; nearly all of it with the wind {more}"
        else:
            ratio = groups[more] / groups[less]
            text += f"; {ratio:.2g} times as much power with the wind {more} as with it {less}"
    parts, places = [f"{text}."], []
    length, greatest = float(found.maps.time.edges[-1]), float(found.maps.amplitude.edges[-1])
    if where.time_s is not None and where.time_s[1] - where.time_s[0] < policy.LOCATES_UP_TO * length:
        places.append(f"between {where.time_s[0]:.1f} and {where.time_s[1]:.1f} s of the record")
    amplitude = where.amplitude_rad
    if amplitude is not None and amplitude[1] - amplitude[0] < policy.LOCATES_UP_TO * greatest:
        places.append(f"at amplitudes from {degrees(amplitude[0]):.2g}° to {degrees(amplitude[1]):.2g}°")
    if where.frequency_hz is not None:
        places.append(f"at {where.frequency_hz[0]:.2f} to {where.frequency_hz[1]:.2f} Hz")
    if places:
        parts.append(f"Four fifths of it lie {', '.join(places)}.")
    whole = sum(max(band.excess, 0.0) for band in found.maps.bands)
    shown = [b for b in found.maps.bands if b.band in bands and b.excess > policy.LISTED_BAND_SHARE * whole]
    if shown and whole > 0.0:
        shown.sort(key=lambda band: -band.excess)
        listed = (f"{100.0 * band.excess / whole:.0f} % {_BAND_WORDS[band.band]}" for band in shown)
        parts.append(f"By frequency: {', '.join(listed)}.")
    # without runs of both winds the condition goes unsaid
    both = any(group.by == "wind" for group in found.maps.groups)
    words = _CHANNEL_WORDS.get(channel.value or "")
    acts = f"It acts on {words}" if words else "What it acts on cannot be determined"
    if condition.value is None:
        parts.append(f"{acts}: {channel.reason}; {condition.reason}.")
    elif channel.reason == condition.reason:
        when = f", {_CONDITION_WORDS[condition.value]}" if both else ""
        parts.append(f"{acts}{when}, {channel.reason}.")
    else:
        parts.append(f"{acts}: {channel.reason}.")
        if both:
            parts.append(f"It is there {_CONDITION_WORDS[condition.value]}: {condition.reason}.")
    return " ".join(parts)


def agreement(where: Where, kinds: Sequence[type[Effect]]) -> str:
    """Whether causes act where the residuals say that the gap is; empty where there is nothing to compare."""
    if not kinds or where.channel is None:
        return ""
    names = plain(*(kind.name for kind in kinds))
    if where.channel in {kind.channel for kind in kinds}:
        return f"That agrees with {names}."
    acts = " and ".join(dict.fromkeys(_CHANNEL_WORDS[kind.channel] for kind in kinds))
    return f"That does not agree with {names}: {'they act' if len(kinds) > 1 else 'it acts'} on {acts}."
