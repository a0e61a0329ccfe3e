"""The place where the nominal model departs from the runs, from its residuals alone, without any effect."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from diagnosis.likelihood.least_squares import Fit, FitError, fit
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import nominal_start
from diagnosis.model.blocks import prepare
from diagnosis.model.fact import Fact
from diagnosis.settings import WhereSettings
from diagnosis.where.along_motion import drift
from diagnosis.where.excess import RunExcess, band_excesses, run_excesses, shortest_interval
from diagnosis.where.survey import Survey, survey
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array

NAMED_RUN: Final = 0.1
"""Minimum excess of a further run to be named, as a share of the largest excess. Judgement."""
ONE_RUN: Final = 0.8
"""Share of the excess in one run above which the runs cannot show whether the gap needs wind. Judgement."""
ONE_RUN_OF: Final = 3
"""Minimum number of runs for this test. Judgement."""
BLOW_SHARE: Final = 0.5
"""Minimum share of the missing moment's energy within the time of a blow. Convention. Most of it."""
BLOW_STDS: Final = 5.0
"""Minimum significance of the missing moment, in standard deviations. Convention."""
BLOW_LENGTH: Final = 0.1
"""Maximum duration of a blow, as a share of the record. Judgement."""
BLOW_AFTER: Final = 0.05
"""Share of the record after the release that is excluded from the search for a blow. Judgement."""
FASTEST_MOMENT: Final = 30.0
"""Maximum frequency of a moment; a faster line is an error of the sensor, in Hz of the similar rig. Physics.
The inertia of the rig keeps the response to faster moments below any noise."""
LINE_SHARE: Final = 0.25
"""Minimum share of a run's excess in its lines for them to locate the gap. Judgement."""
LINE_ONE_IN: Final = 3
"""At least one run in this number must have such a line. Judgement."""
FAST_SHARE: Final = 0.5
"""Share of the excess above the frequency of the motion from which the gap is an error of the sensor.
Convention. Most of it."""
SLOW_SHARE: Final = 0.5
"""Share of the excess below the frequency of the motion from which the gap is a shift of the centre.
Convention. Most of it."""
SHIFTED_CENTRE: Final = 0.05
"""Minimum share of the excess in the second harmonic that shows a shifted centre. Judgement."""
HARMONIC_SHARE: Final = 0.5
"""Minimum share of the excess in harmonics for them to locate the gap. Convention. Most of it."""
ALONE_LEAVES: Final = 0.2
"""Maximum share of the excess that remains in fits to single runs for every run to count as linear. Judgement."""
DRIFT_RATIO: Final = 1.5
"""Minimum ratio of the drifts of frequency and damping for the larger one to locate the gap. Judgement."""


@dataclass(frozen=True)
class Conclusion:
    """A conclusion with its reason.

    Args:
        value: the conclusion; None where the runs do not allow one.
    """

    value: str | None
    reason: Fact


@dataclass(frozen=True, eq=False)
class Place:
    """The place of a gap.

    Args:
        runs: ids of the runs beyond chance.
    """

    survey: Survey
    runs: tuple[str, ...]
    channel: Conclusion
    condition: Conclusion


def locate(campaign: Campaign, nominal: Fit, *, hum_removed: bool = False, noise_ratio: float = 1.0) -> Place:
    """Find where the nominal model departs from the runs.

    Args:
        campaign: the measured campaign, in the units of the fit.
        nominal: fit of the nominal model.
        hum_removed: whether a hum was removed before the fit. It is part of the gap, so it is added back to the
            residuals.
        noise_ratio: noise variance of the fit over the reference. A step of the readings that is coarser than
            stated raises the noise found in the records, and the stated noise is then the reference.
    """
    data, hum = nominal.problem.data, dict[str, Array]()
    if hum_removed:
        variance = {run.id: run.noise.variance for run in data.runs}
        given = prepare(campaign, variance, data.similarity, model=data.model, settings=data.settings)
        readings = {run.id: run.reading for run in given.runs}
        # the fit may leave out the start of a record; both end together
        hum = {run.id: run.scaled(readings[run.id][-run.reading.size :] - run.reading) for run in data.runs}

    def whole(fitted: Fit) -> Fit:
        """A fit with the residuals of the whole gap, in deviations of the reference noise."""
        runs = zip(fitted.problem.data.runs, fitted.residuals, strict=True)
        return replace(
            fitted, residuals=[(r + hum.get(run.id, 0.0)) * np.sqrt(noise_ratio) for run, r in runs]
        )

    scaled = whole(nominal)
    excesses = run_excesses(campaign, scaled)
    runs = runs_beyond_chance(excesses, nominal.settings.where)
    found = survey(nominal, scaled, excesses, runs)
    condition = infer_condition(campaign, nominal, found, whole)
    return Place(found, runs, infer_channel(nominal, found, condition.value), condition)


def runs_beyond_chance(excesses: Sequence[RunExcess], chosen: WhereSettings) -> tuple[str, ...]:
    """The runs beyond chance, from the largest excess down to a good part of it."""
    clear = {run.id: run.excess for run in excesses if run.p_value() * len(excesses) < chosen.run_rate}
    least = NAMED_RUN * max(clear.values(), default=0.0)
    return tuple(name for name, excess in clear.items() if excess > least)


def infer_condition(
    campaign: Campaign, nominal: Fit, found: Survey, whole: Callable[[Fit], Fit]
) -> Conclusion:
    """Whether the gap needs wind: ``wind_on`` if the wind-off runs, fitted alone, show no gap.

    Args:
        whole: adds the parts of the gap that are removed before a fit.
    """
    runs, shown, chosen = nominal.problem.data.runs, found.maps.runs, nominal.settings.where
    off = tuple(run.id for run in nominal.problem.data.in_still_air)
    if len(off) == len(runs):
        return Conclusion("always", Fact("wind off"))
    if not off:
        return Conclusion(None, Fact("wind on in every run"))
    if min(run.p_value for run in shown) * len(runs) > chosen.run_rate:
        return Conclusion(None, Fact("no single run"))
    most = max(shown, key=lambda run: run.share)
    if len(shown) >= ONE_RUN_OF and most.share > ONE_RUN and most.id not in off:
        return Conclusion(None, Fact("one run", {"run": most.id}))
    # without the coefficients and gain that these runs do not show
    data = nominal.problem.data.alone(off)
    try:
        alone = fit(Problem(data), nominal_start(data))
    except FitError:
        return Conclusion(None, Fact("wind-off runs not fitted"))
    excesses = run_excesses(campaign, whole(alone))
    tests = [run.p_value() for run in excesses]
    tests += [band.p_value for band in band_excesses(excesses)]
    if min(tests) * len(tests) < chosen.still_rate:
        return Conclusion("always", Fact("wind-off runs show it", {"runs": len(off)}))
    return Conclusion("wind_on", Fact("wind-off runs show none", {"runs": len(off)}))


def blow_interval(found: Survey, share: float) -> tuple[float, float] | None:
    """The time in which most of the missing moment acts, if it is a small part of the record.

    Args:
        share: share of the moment's energy, a fraction.

    Returns:
        Start and end since the start of the record, s; None if the moment is spread out, acts at the release,
        or is not significant.
    """
    edges = found.maps.time.edges_s
    interval = shortest_interval(edges, found.moment_energy, share)
    if interval is None or found.moment_z < BLOW_STDS:
        return None
    length = float(edges[-1])
    brief = interval[1] - interval[0] <= BLOW_LENGTH * length
    return interval if brief and interval[0] > BLOW_AFTER * length else None


def infer_channel(nominal: Fit, survey: Survey, condition: str | None) -> Conclusion:
    """The channel on which the gap acts, from features of the residual and the inferred condition."""
    blow = blow_interval(survey, BLOW_SHARE)
    if blow is not None:
        return Conclusion("forcing", Fact("blow", {"from_s": blow[0], "to_s": blow[1]}))
    # most of the excess may be a line, or lie beside the frequency of the motion
    excess = {band.band: max(band.excess, 0.0) for band in survey.maps.bands}
    whole = max(sum(excess.values()), 1e-300)
    lines = [line for line in survey.maps.lines if line.share > LINE_SHARE]
    if lines and len(lines) >= max(1, len(survey.maps.runs) // LINE_ONE_IN):
        hertz = float(np.median([line.frequency_hz for line in lines]))
        similar = nominal.problem.data.similarity.similar(hertz, "Hz")
        return Conclusion(
            "forcing" if similar < FASTEST_MOMENT else "sensor",
            Fact("spectral line", {"frequency_hz": hertz}),
        )
    if excess.get("above", 0.0) > FAST_SHARE * whole:
        return Conclusion("sensor", Fact("too fast"))
    if excess.get("0", 0.0) > SLOW_SHARE * whole:
        if excess.get("2f0", 0.0) > SHIFTED_CENTRE * whole:
            return Conclusion("stiffness", Fact("shifted centre and harmonic"))
        if condition == "wind_on":
            return Conclusion("forcing", Fact("shifted centre with wind"))
        return Conclusion("sensor", Fact("shifted centre"))
    if sum(excess.get(band, 0.0) for band in ("2f0", "3f0", "above")) > HARMONIC_SHARE * whole:
        return Conclusion("sensor", Fact("harmonics"))
    apart = _between_runs(nominal, survey)
    if apart is not None:
        return apart
    if not nominal.problem.data.decays:
        return Conclusion(None, Fact("every run driven"))
    frequency, damping = drift(list(survey.maps.backbones))
    if frequency > DRIFT_RATIO * max(damping, 0.0) and frequency > 0.0:
        return Conclusion("stiffness", Fact("frequency along the decay"))
    if damping > DRIFT_RATIO * max(frequency, 0.0) and damping > 0.0:
        return Conclusion("damping", Fact("damping along the decay"))
    return Conclusion(None, Fact("both along the decay"))


def _between_runs(nominal: Fit, found: Survey) -> Conclusion | None:
    """The channel if every run alone is linear, but the runs do not agree on the coefficients."""
    sizes = [run.reading.size for run in nominal.problem.data.runs]
    left, shifts = 0.0, []
    for curve, size in zip(found.maps.backbones, sizes, strict=True):
        if curve.alone_excess is None or curve.alone_frequency_hz is None or curve.alone_zeta is None:
            return None
        left += max(curve.alone_excess, 0.0) * size
        frequency = curve.alone_frequency_hz / curve.nominal_frequency_hz - 1.0
        shifts.append((frequency, curve.alone_zeta - curve.nominal_zeta))
    whole = sum(max(run.excess, 0.0) * n for run, n in zip(found.excesses, sizes, strict=True))
    if len(sizes) < 2 or left > ALONE_LEAVES * whole:
        return None
    frequency, damping = np.sum(np.array(shifts) ** 2, axis=0)
    # as with a wrong spring, but also with gravity or a flexible rod on several springs
    if frequency >= damping:
        return Conclusion(None, Fact("frequency between runs"))
    return Conclusion("damping", Fact("damping between runs"))
