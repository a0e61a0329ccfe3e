"""Prediction of the fitted runs by the MuJoCo model, for what is reported, in short steps."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from diagnosis.fitting.problem import (
    Point,
    Problem,
    blocks_beyond,
    campaign_rig,
    condensed,
    sample_means,
)
from diagnosis.fitting.run_data import RunData
from diagnosis.policy import CONFIRMATION_TOLERANCE
from diagnosis.result import Confirmation
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.run_settings import Motion, RunSettings, released_by_spring_end
from tunnel_sim.physics.steps import report_substeps
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Rig


@dataclass(frozen=True, eq=False)
class Comparison:
    """Runs predicted by the MuJoCo model and by the forward integrator of the fits.

    Args:
        ids: of the runs.
        residuals: reading minus the MuJoCo model's block means, in noise standard deviations, by run; those of
            the forward integrator where MuJoCo could not integrate the motion.
        differences: MuJoCo's block means minus the forward integrator's, rad, by run.
        noise: standard deviation of a block mean's noise, rad, by run.
        failure: why MuJoCo could not predict the runs; empty where it did.
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
        common: common parameters, shape (common,), or (runs, common) where each run has its own, as runs
            held out of different fits do.
        release: every run's own parameters, shape (runs, own).

    Returns:
        Residuals from the MuJoCo model, and its differences from the forward integrator.
    """
    runs = problem.data.runs
    each = np.broadcast_to(common, (len(runs), common.shape[-1]))
    distinct, which = np.unique(each, axis=0, return_inverse=True)
    forward = problem.predict([Point(row, release) for row in distinct])
    noise = tuple(run.noise_std for run in runs)
    before = [forward[int(k)][i] for i, k in enumerate(which.ravel())]
    predicted, failure = before, ""
    try:
        predicted = mujoco_blocks(problem, each, release)
    except TunnelError as error:
        failure = error.what
    return Comparison(
        ids=tuple(run.id for run in runs),
        residuals=[run.scaled(run.reading - p) for run, p in zip(runs, predicted, strict=True)],
        shifts=[run.scaled(p - f) for run, p, f in zip(runs, predicted, before, strict=True)],
        differences=[p - f for p, f in zip(predicted, before, strict=True)],
        noise=noise,
        failure=failure,
    )


def confirm(comparisons: Sequence[Comparison]) -> Confirmation:
    """Judge whether the two models agree.

    Args:
        comparisons: of all fits that are reported; at least one.

    Returns:
        The largest difference, and the root mean square difference of the run closest to its tolerance.
    """
    largest, worst, found = 0.0, -1.0, ("", 0.0, 0.0)
    for comparison in comparisons:
        for run, difference, noise in zip(
            comparison.ids, comparison.differences, comparison.noise, strict=True
        ):
            largest = max(largest, float(np.max(np.abs(difference))))
            rms = float(np.sqrt(np.mean(difference**2)))
            if rms / noise > worst:
                worst, found = rms / noise, (run, rms, CONFIRMATION_TOLERANCE * noise)
    failure = next((c.failure for c in comparisons if c.failure), "")
    return Confirmation(worst <= CONFIRMATION_TOLERANCE and not failure, largest, *found, failure=failure)


def mujoco_blocks(problem: Problem, common: Array, release: Array) -> list[Array]:
    """Block means of the reading that the MuJoCo model predicts.

    The MuJoCo model does not take the input of a driven run, which the forward integrator predicts in the same
    short steps. Effects of the sensor act on every sample before it is averaged; the fits, which average first,
    only approximate that.

    Args:
        common: common parameters of every run, shape (runs, common).
        release: every run's own parameters, shape (runs, own).

    Returns:
        By run, rad, of the shape of the run's ``reading``.

    Raises:
        TunnelError: when the motion grows without bound.
    """
    from tunnel_sim.engine.simulate import simulate_motions  # only here: MuJoCo is slow to load

    cases = [_Case(problem, common[i], release[i], run) for i, run in enumerate(problem.data.runs)]
    by_interval: dict[float, list[_Case]] = {}
    for case in cases:
        by_interval.setdefault(case.run.interval, []).append(case)
    blocks: dict[str, Array] = {}
    for interval, group in by_interval.items():
        rig = campaign_rig(problem.data)
        free = [case for case in group if case.run.drive is None]
        motions = simulate_motions(rig, [case.physics for case in free], 1.0 / interval) if free else ()
        for case, motion in zip(free, motions, strict=True):
            blocks[case.run.id] = case.reading(motion)
        for case in group:
            if case.run.drive is not None:
                blocks[case.run.id] = case.reading(_driven_motion(rig, case.physics, interval))
    return [blocks[run.id] for run in problem.data.runs]


def _driven_motion(rig: Rig, physics: RunSettings, interval: float) -> Motion:
    try:
        return forward_motion(rig, physics, 1.0 / interval)
    except ValueError as error:
        raise TunnelError(str(error), remedy="do not rely on the fitted parameters") from error


class _Case:
    """One run at one point, as MuJoCo simulates it."""

    def __init__(self, problem: Problem, common: Array, own: Array, run: RunData) -> None:
        self.run = run
        self.chain = problem.chain(common, own, run)
        self.zero = problem.zero(common, own)
        physics = released_by_spring_end(condensed(self.chain.physics(), problem.data))
        steps = report_substeps(physics, run.interval)
        blocks = run.reading.size + blocks_beyond(physics, run)
        self.physics = dataclasses.replace(
            physics, timestep=run.interval / steps, duration=(blocks + 1) * run.interval
        )

    def reading(self, motion: Motion) -> Array:
        """Block means of the reading from the motion at the blocks' ends."""
        return sample_means(self.chain, motion, self.run, self.zero)
