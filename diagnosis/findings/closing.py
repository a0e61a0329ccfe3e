"""The gap before and after the causes, by MuJoCo and on held-out readings; causes that do not reduce it go."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from scipy.special import chdtrc

from diagnosis.answer.held_out import (
    ON_RUNS,
    Base,
    HeldOut,
    Waterfall,
    excess_base,
    predict_held_out,
    share_ahead,
    share_closed,
    waterfall,
)
from diagnosis.findings.closure import FITTED, Confirmation, GapSummary, RunGap
from diagnosis.findings.misfit import Misfit
from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.likelihood.motions import blocks_beyond, campaign_rig, condensed, sample_means
from diagnosis.likelihood.problem import Problem
from diagnosis.model.parameters import Point
from diagnosis.search.prepared import COARSE_STEP
from diagnosis.search.scatter import without_deviations
from diagnosis.search.study import Study
from tunnel_sim.physics.run_settings import released_by_spring_end
from tunnel_sim.physics.steps import report_substeps
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

INTEGRATOR_TOLERANCE: Final = 0.1
"""Maximum difference between MuJoCo and the integrator of the fits, in std of a block mean. Judgement."""

ABSORBED_RATE: Final = 0.001
"""Minimum probability, by the stated widths, of deviations as large as the fitted ones; below it the deviations
have absorbed a cause. Convention. One campaign in 1000 as stated; a wrong spring gives deviations of many
widths."""

ALIKE_HELD_OUT: Final = 4.0
"""Maximum difference of χ² on held-out readings between parts of an answer that predict them alike. Convention.
Two standard deviations of one parameter."""


@dataclass(frozen=True)
class Closing:
    """The share of the gap on held-out readings that the causes explain.

    Args:
        gap: before and after, by MuJoCo.
        steps: the gap as the causes are added.
        seconds: wall time of each step, s.
        shifts: MuJoCo's readings of the answer's model minus the fits' readings, in noise standard deviations of
            block means, by run id.
    """

    gap: GapSummary
    steps: Waterfall
    confirmation: Confirmation
    seconds: Mapping[str, float]
    shifts: Mapping[str, Array]


def closing(study: Study) -> Closing:
    """The gap before and after by MuJoCo, and as the causes are added."""
    study = closed_study(study)
    base, chosen = excess_base(study), study.chosen
    nominal_out = predict_held_out(study.nominal)
    chosen_out = predict_held_out(chosen)
    begun = time.perf_counter()
    shown = report_fits(study.nominal, chosen, nominal_out, chosen_out)
    reported = time.perf_counter()
    steps = waterfall(study, base)
    gap = held_out_totals(gap_summary(study, base, shown), steps)
    gap = replace(gap, closed_ahead=share_ahead(study, nominal_out.residuals.keys()))
    seconds = {"confirmation": reported - begun, "waterfall": time.perf_counter() - reported}
    return Closing(gap, steps, shown.confirmation, seconds, shown.shifts)


def closed_study(study: Study) -> Study:
    """The study, with the gap computed for runs that repeat exactly if stated scatter absorbs a cause.

    Deviations of many widths fit a wrong spring without a residual, yet the test of the gap counts them.
    Deviations within the stated widths are not a gap, so no cause is credited with them.
    """
    nominal = study.nominal
    if not study.named or not nominal.problem.scatter:
        return study
    places = nominal.problem.parameters.places(nominal.problem.scatter)
    away = nominal.point.per_run[:, places] / nominal.widths
    if chdtrc(away.size, float(np.sum(away**2))) >= ABSORBED_RATE:
        return study
    repeats = try_fit(*without_deviations(nominal))
    return study if repeats is None else replace(study, prepared=replace(study.prepared, nominal=repeats))


def confirmed(study: Study) -> tuple[Study, Closing]:
    """The study without the causes whose addition does not reduce the held-out residual, and its closing."""
    found = closing(study)
    while (fewer := _without_needless(study, found.steps)) is not None:
        study, found = fewer, closing(fewer)
    return study, found


def _without_needless(study: Study, steps: Waterfall) -> Study | None:
    """The study with the part of the fitted causes that predicts held-out readings best, and no worse than all.

    Of parts that differ by chance, it is the likeliest: beside scatter several parts may leave nothing.

    Returns:
        None where all of them together predict best, or beside a random moment, which absorbs the causes. A cause
        without a size is left out in any case: the freed form of another replaces it.
    """
    answer, fitted = study.answer, study.chosen
    if answer is None or not study.named or study.moment is not None:
        return None
    whole = frozenset(answer.effects)
    acting = whole - {one.name for one in fitted.problem.effects_at(fitted.point.common) if one.is_null}
    if acting and acting != whole:
        return study.of_part(tuple(sorted(acting)))
    parts = {whole - {name}: left for name, left in steps.without.items() if name in whole}
    added: frozenset[str] = frozenset()
    for step in steps.steps:
        if step.effect in whole:
            added |= {str(step.effect)}
            parts.setdefault(added, step.excess)
    best = min(filter(None, parts), key=parts.__getitem__, default=whole)
    if best == whole or parts[best] > steps.steps[-1].excess:
        return None
    near = parts[best] + ALIKE_HELD_OUT / fitted.count
    alike = [part for part, left in parts.items() if part and part != whole and left <= near]

    def likely(part: frozenset[str]) -> float:
        weighed = study.of(part)
        return 0.0 if weighed is None else weighed.probability

    likeliest = max(alike, key=lambda part: (likely(part), -parts[part]))
    return study.of_part(tuple(sorted(likeliest)))


@dataclass(frozen=True, eq=False)
class Comparison:
    """Runs predicted by the MuJoCo model and by the forward integrator of the fits.

    Args:
        ids: run ids.
        residuals: reading minus MuJoCo's block means, in noise standard deviations, by run; the residuals of the
            forward integrator where MuJoCo could not integrate the motion.
        differences: MuJoCo's block means minus the forward integrator's, rad, by run.
        noise: standard deviation of a block mean's noise, rad, by run.
        failure: why MuJoCo could not predict the runs; empty where it could.
        shifts: the differences in noise standard deviations, whitened like the residuals, by run.
    """

    ids: tuple[str, ...]
    residuals: list[Array]
    differences: list[Array]
    noise: tuple[float, ...]
    failure: str = ""
    shifts: list[Array] = field(default_factory=list)

    @property
    def excess(self) -> float:
        """Mean squared scaled residual minus one, over all runs."""
        return float(np.mean(np.concatenate(self.residuals) ** 2)) - 1.0


def compare(problem: Problem, common: Array, release: Array) -> Comparison:
    """Predict runs with both models.

    Args:
        common: common parameters, shape (common,), or (runs, common) where each run has its own: runs held out
            of different fits.
        release: every run's own parameters, shape (runs, own).
    """
    runs = problem.data.runs
    each = np.broadcast_to(common, (len(runs), common.shape[-1]))
    distinct, which = np.unique(each, axis=0, return_inverse=True)
    forward = problem.predict([Point(row, release) for row in distinct])
    before = [forward[int(k)][i] for i, k in enumerate(which.ravel())]
    try:
        predicted, failure = mujoco_blocks(problem, each, release), ""
    except TunnelError as error:
        predicted, failure = before, error.what
    # a held-out run may diverge in both models
    apart = [np.zeros_like(p) if failure else p - f for p, f in zip(predicted, before, strict=True)]
    return Comparison(
        ids=tuple(run.id for run in runs),
        residuals=[run.scaled(run.reading - p) for run, p in zip(runs, predicted, strict=True)],
        shifts=[run.scaled(difference) for run, difference in zip(runs, apart, strict=True)],
        differences=apart,
        noise=tuple(run.noise_std for run in runs),
        failure=failure,
    )


def confirm(comparisons: Sequence[Comparison], tolerance: float) -> Confirmation:
    """Judge whether the two models agree.

    Args:
        tolerance: maximum root mean square difference of a run over the noise of a block mean, a ratio.

    Returns:
        The largest difference, and the root mean square difference of the run nearest to its tolerance.
    """
    largest, worst, found = 0.0, -1.0, ("", 0.0, 0.0)
    for comparison in comparisons:
        for run, difference, noise in zip(
            comparison.ids, comparison.differences, comparison.noise, strict=True
        ):
            largest = max(largest, float(np.max(np.abs(difference))))
            rms = float(np.sqrt(np.mean(difference**2)))
            if rms / noise > worst:
                worst, found = rms / noise, (run, rms, tolerance * noise)
    failure = next((c.failure for c in comparisons if c.failure), "")
    return Confirmation(worst <= tolerance and not failure, largest, *found, failure=failure)


def mujoco_blocks(problem: Problem, common: Array, release: Array) -> list[Array]:
    """Block means of the reading from the MuJoCo model.

    Effects of the sensor act on every sample before averaging; the fits average first, which is an
    approximation.

    Args:
        common: common parameters of every run, shape (runs, common).
        release: every run's own parameters, shape (runs, own).

    Returns:
        By run, rad, of the shape of the run's ``reading``.

    Raises:
        TunnelError: when the motion diverges.
    """
    from tunnel_sim.engine.simulate import simulate_motions  # imported here because MuJoCo is slow to load

    runs, rig = problem.data.runs, campaign_rig(problem.data)
    chains = [problem.chain(*each) for each in zip(common, release, runs, strict=True)]
    simulated: dict[float, list[int]] = {}  # numbers of the runs by sample interval
    settings = []
    for i, (run, chain) in enumerate(zip(runs, chains, strict=True)):
        physics = released_by_spring_end(condensed(chain.physics(), problem.data))
        steps = report_substeps(physics, run.interval, run.block)
        duration = (run.reading.size + blocks_beyond(physics, run) + 1) * run.interval
        settings.append(replace(physics, timestep=run.interval / steps, duration=duration))
        simulated.setdefault(run.interval, []).append(i)
    found: dict[int, Array] = {}
    for interval, places in simulated.items():
        motions = simulate_motions(rig, [settings[i] for i in places], 1.0 / interval)
        for i, motion in zip(places, motions, strict=True):
            found[i] = sample_means(chains[i], motion, runs[i], problem.zero(common[i], release[i]))
    return [found[i] for i in range(len(runs))]


@dataclass(frozen=True, eq=False)
class Reported:
    """Residuals from the MuJoCo model, in noise standard deviations of block means, by run id.

    Args:
        before: residuals of the nominal model fitted to all runs.
        before_out: residuals of the nominal model, for the runs that could be held out of its fit.
        after: residuals of the answer's model, held out where possible, else from its fit to all runs.
        held_out: ids of the runs that could be held out.
        confirmation: agreement of MuJoCo and the fits' integrator on these runs.
        shifts: MuJoCo's block means of the answer's model minus the block means of the fits' integrator.
    """

    before: Mapping[str, Array]
    before_out: Mapping[str, Array]
    after: Mapping[str, Array]
    held_out: frozenset[str]
    confirmation: Confirmation
    shifts: Mapping[str, Array]


def report_fits(nominal: Fit, chosen: Fit, nominal_out: HeldOut, chosen_out: HeldOut) -> Reported:
    """Predict the reported runs with the MuJoCo model, once for each fit.

    Returns:
        The residuals. The nominal model's residuals of held-out runs are from the fits' integrator, corrected
        by its difference from MuJoCo in the similar fit of all runs.
    """
    before = compare(nominal.problem, nominal.point.common, nominal.point.per_run)
    before_out = {
        run: nominal_out.residuals[run] - shift
        for run, shift in zip(before.ids, before.shifts, strict=True)
        if run in nominal_out.residuals
    }
    comparisons = [before]
    if chosen is nominal:
        after = dict(zip(before.ids, before.residuals, strict=True)) | before_out
    else:
        runs = chosen.problem.data.runs
        points = [
            chosen_out.points.get(run.id, (chosen.point.common, chosen.point.per_run[i]))
            for i, run in enumerate(runs)
        ]
        held = compare(chosen.problem, np.array([c for c, _ in points]), np.array([r for _, r in points]))
        comparisons.append(held)
        after = dict(zip(held.ids, held.residuals, strict=True))
    return Reported(
        before=dict(zip(before.ids, before.residuals, strict=True)),
        before_out=before_out,
        after=after,
        held_out=frozenset(chosen_out.residuals),
        confirmation=confirm(comparisons, INTEGRATOR_TOLERANCE),
        shifts=dict(zip(comparisons[-1].ids, comparisons[-1].shifts, strict=True)),
    )


def gap_summary(study: Study, base: Base, shown: Reported) -> GapSummary:
    """The gap of the campaign and of every run, in noise variances of a sample."""
    ratio = base.extra + 1.0  # estimated noise over the reference noise
    moment = study.moment
    explained = 0.0 if study.prepared.coarse and COARSE_STEP.name in study.causes else base.extra
    predicted = {**shown.before, **shown.before_out} if study.causes else shown.before
    runs, sizes, powers = [], [], []
    for run in study.nominal.problem.data.runs:
        before = _excess(predicted[run.id]) / run.block * ratio + base.hum + base.extra
        after = _excess(shown.after[run.id]) / run.block * ratio + explained
        if moment is not None and run.id in moment.process.runs:
            after = moment.process.excess / run.block * ratio + explained
        held_out = run.id in shown.held_out
        runs.append(RunGap(run.id, before, after if study.named else before, held_out=held_out))
        sizes.append(run.reading.size * run.block)
        powers.append(float(np.var(run.reading)))
    weight = np.array(sizes) / np.sum(sizes)
    before = float(weight @ [run.before for run in runs])
    after = float(weight @ [run.after for run in runs])
    own = study.similarity.own(1.0, study.similarity.reading)
    return GapSummary(
        detected=bool(study.causes),
        excess_before=before,
        excess_after=after,
        closed=share_closed(before, after) if study.named else 0.0,
        closed_on=ON_RUNS if shown.before_out else FITTED,
        runs=tuple(runs),
        false_alarm_rate=study.settings.gap.detection_rate,
        p_value=0.0 if study.read_off else study.gap.test.p_value,
        tests=study.gap.test.tests,
        misfit=Misfit(
            own * float(np.sqrt(base.variance)),
            own * float(np.sqrt(weight @ powers)),
            study.similarity.reading,
        ),
    )


def held_out_totals(gap: GapSummary, held_out: Waterfall) -> GapSummary:
    """The summary with the totals of the waterfall, so that all figures and sentences state one gap.

    Unchanged for a campaign without a gap.
    """
    if not gap.detected:
        return gap
    before, after = held_out.steps[0].excess, held_out.steps[-1].excess
    named = len(held_out.steps) > 1
    return replace(
        gap,
        excess_before=before,
        excess_after=after,
        closed=share_closed(before, after) if named else 0.0,
        closed_on=held_out.held_out,
    )


def _excess(residual: Array) -> float:
    return float(np.mean(residual**2)) - 1.0
