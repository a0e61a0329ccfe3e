"""Where the gap is: the runs, times, amplitudes and frequencies that show it, its channel and its condition."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from diagnosis.fitting.least_squares import Fit
from diagnosis.fitting.prepare import prepare
from diagnosis.localisation.excess import RunExcess, bands_beyond_chance, run_excesses
from diagnosis.localisation.inference import Finding, blow_interval, infer_channel, infer_condition
from diagnosis.localisation.mapping import Survey, survey
from diagnosis.localisation.maps import Maps
from diagnosis.localisation.words import describe, nowhere
from diagnosis.names import plain
from diagnosis.policy import INTERVAL_SHARE, NAMED_RUN_SHARE, PLACE_FALSE_ALARM_RATE
from diagnosis.result import Where
from diagnosis.study import COARSE_STEP, Study
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.record import Array


def localise(study: Study) -> tuple[Where, Maps]:
    """Say where the nominal model departs from the runs.

    Returns:
        The answer in fields and in words, and the maps it is read from.
    """
    scaled, ratio = _as_measured(study)
    excesses = run_excesses(study.campaign, scaled)
    runs = runs_beyond_chance(excesses) if study.causes else ()
    found = survey(study, scaled, excesses, runs)
    if not study.causes:
        return Where(None, None, words=nowhere(found)), found.maps
    main = _main_cause(study, _mean_excess(scaled), ratio)
    condition, channel = _nature(study, found, main)
    where = Where(
        channel=channel.value,
        condition=condition.value,
        runs=runs,
        time_s=blow_interval(found, INTERVAL_SHARE) or found.maps.time.interval(),
        amplitude_rad=found.maps.amplitude.interval(),
        frequency_hz=found.frequency_interval,
    )
    bands = bands_beyond_chance(found.maps.bands)
    return dataclasses.replace(where, words=describe(where, found, bands, channel, condition)), found.maps


def runs_beyond_chance(excesses: Sequence[RunExcess]) -> tuple[str, ...]:
    """The runs that show the gap.

    Args:
        excesses: of all runs, from the nominal model.

    Returns:
        Ids of the runs beyond chance (false-alarm rate 1 % over all of them) that have a tenth or more of the
        largest excess among them, in the campaign's order.
    """
    clear = {run.id: run.excess for run in excesses if run.p_value() * len(excesses) < PLACE_FALSE_ALARM_RATE}
    least = NAMED_RUN_SHARE * max(clear.values(), default=0.0)
    return tuple(name for name, excess in clear.items() if excess > least)


def _as_measured(study: Study) -> tuple[Fit, float]:
    """The nominal fit with the residuals of the records as given, in units of the noise that counts.

    Where hum was removed before the fit, it is part of the gap, and the residuals get it back. Where the readings'
    step is a cause, it raises the noise found in the records, so that the stated noise is the measure. Returns the
    fit and the ratio of its noise variance to the one that counts.
    """
    nominal = study.nominal
    level = float(np.mean([run.noise_variance * run.block for run in nominal.problem.data.runs]))
    coarse = COARSE_STEP.name in study.causes
    stated = study.noise.stated_variance if coarse else None
    ratio = level / stated if stated else 1.0
    scaled = [r * np.sqrt(ratio) for r in _with_hum(study)]
    return dataclasses.replace(nominal, residuals=scaled), ratio


def _with_hum(study: Study) -> list[Array]:
    """The nominal fit's scaled residuals by run, the hum put back where it was removed."""
    data, residuals = study.nominal.problem.data, study.nominal.residuals
    if study.hum is None:
        return residuals
    given = prepare(study.campaign, {run.id: run.noise_variance for run in data.runs}, data.similarity)
    readings = {run.id: run.reading for run in given.runs}
    # the fit may leave a record's start out; both end together
    return [
        r + run.scaled(readings[run.id][-run.reading.size :] - run.reading)
        for r, run in zip(residuals, data.runs, strict=True)
    ]


def _nature(study: Study, found: Survey, main: str | None) -> tuple[Finding, Finding]:
    """Condition and channel, from the cause where it is known and from the residuals where it is not."""
    if main is None:
        condition = infer_condition(study.campaign, study.nominal, found)
        return condition, infer_channel(study.nominal, found, condition.value)
    kind = effect_class(main)
    others = [name for name in study.causes if name != main]
    reason = f"as {plain(main)} does"
    if others:
        reason += f", which causes the larger part of the gap; the rest is due to {plain(*others)}"
    return Finding(kind.condition, reason), Finding(kind.channel, reason)


def _main_cause(study: Study, excess: float, ratio: float) -> str | None:
    """Of several causes the one without which most of the gap would stay open; None where none is known."""
    known = [name for name in study.causes if name != "unknown"]
    best = study.chosen
    if len(known) < 2 or best is study.nominal:
        return known[0] if known else None
    fitted = {kind.name: kind for kind in best.problem.effects if kind.name in known}
    others = [name for name in known if name not in fitted]  # read off the records, or random
    closed = ratio * (study.nominal.excess - best.excess)
    if not fitted or (others and excess - closed > closed):
        return (others or known)[0]

    def strength(name: str) -> float:
        severity = f"{name}.{fitted[name].parameters()[0].name}"
        return abs(best.value(severity)) / max(best.std(severity), 1e-300)

    return max(fitted, key=strength)


def _mean_excess(fit: Fit) -> float:
    return sum(float(r @ r) for r in fit.residuals) / fit.count - 1.0
