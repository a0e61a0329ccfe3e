"""From runs identified one by one to the campaign's coefficients."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, TypeAlias

import numpy as np
from scipy.special import chdtri

from identification.campaign.derivatives import Design, loads, noise_statuses, statuses_of_runs
from identification.campaign.linked_runs import LinkedRuns
from identification.estimate import Estimate, RunEstimate, Status, WindowEstimate, by_severity
from identification.policy import MISFIT_RATE
from identification.progress import counted
from identification.show.quantity import Quantity
from identification.signal.decay_fit import Reading, project_run
from identification.signal.free_decay import Decay
from identification.signal.noise import noise_level
from identification.signal.run_fit import (
    FittedRun,
    Gained,
    ResidualCheck,
    describe_run,
    noise_and_failure,
    residuals_of,
)
from identification.statistics import determined
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

_RUN_UNKNOWNS = 5  # unknowns of a single-run fit: decay, stiffness, initial state, zero
Combination = Callable[[Design, list[int], Array, Array], tuple[Array, Array]]
"""Function from the design, the places of its runs, φ and its covariance to φ and its covariance."""


@dataclass(frozen=True, eq=False)
class RunDecay:
    """The result of a method for one run alone.

    Args:
        gained: decay rate, stiffness and gain of its input; None where they were not found.
        instead: why another method gave the result, and a remedy; None for a result of the method itself.
    """

    estimate: RunEstimate
    gained: Gained | None = None
    instead: tuple[str, str] | None = None


def combined_estimate(
    linked: LinkedRuns, name: str, found: Sequence[RunDecay], *, together: Combination | None = None
) -> Estimate:
    """The campaign's coefficients from runs identified one by one: generalised least squares on their (a, k, g).

    The covariance includes the scatter between the runs (`identification.campaign.run_scatter`). If the runs
    contradict each other beyond it, the covariance is widened by the ratio of Birge, Phys. Rev. 40 (1932)
    207–227, doi 10.1103/PhysRev.40.207. Runs without a result or a spring stiffness are left out.

    Args:
        found: the results of all runs.
        together: the method's own combination of the runs, which starts from the least-squares one.
    """
    campaign = linked.campaign
    estimate = Estimate(campaign.name, name, tuple(item.estimate for item in found))
    estimate = replace(estimate, remarks=(*linked.remarks, *_of_another_method(found)))
    statuses = statuses_of_runs(campaign, estimate.runs) | noise_statuses(
        [run.noise for run in estimate.runs]
    )
    if not linked.runs:
        return replace(estimate, statuses=by_severity(statuses))
    if linked.least_squares is None:
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_DETERMINED}))
    scatter, (parameters, covariance) = linked.scatter, linked.least_squares
    if scatter is not None:
        misfit, parameters, covariance = scatter.quadratic, scatter.parameters, scatter.covariance
    else:
        misfit = linked.measured(parameters).misfit(parameters)
        if together is not None:
            parameters, covariance = together(linked.design, linked.places, parameters, covariance)
    freedom = sum(np.count_nonzero(one.weight.diagonal()) for one in linked.gained) - parameters.size
    beyond = freedom > 0 and misfit > float(chdtri(freedom, MISFIT_RATE))
    ratio = misfit / freedom if beyond else 1.0
    values, own = linked.values(parameters, covariance)
    repeatability = None
    if scatter is not None and values.names:
        own, repeatability = scatter.of(values.jacobian)
    own = own * ratio
    if values.names and not determined(own):
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_DETERMINED}))
    return linked.filled(estimate, values, own, parameters, covariance * ratio, statuses, repeatability)


def _of_another_method(found: Sequence[RunDecay]) -> tuple[Remark, ...]:
    """A remark for each reason why runs have the result of another method."""
    runs: dict[tuple[str, str], list[str]] = {}
    for item in found:
        if item.instead is not None and item.estimate.identified:
            runs.setdefault(item.instead, []).append(item.estimate.id)
    return tuple(Remark(Outcome.NOTED, tuple(names), what, remedy) for (what, remedy), names in runs.items())


def scattering_estimate(linked: LinkedRuns, name: str, fitted: Sequence[FittedRun]) -> Estimate | None:
    """The estimate from single-run least-squares fits if there is significant scatter between runs, otherwise None.

    A joint fit assumes that all runs repeat exactly, and would mistake the scatter for a misfit of the model.
    The sensor's zero is the mean of the runs' zeros, weighted by their variances.
    """
    campaign = linked.campaign
    if linked.scatter is None:
        return None
    found = combined_estimate(linked, name, [RunDecay(item.estimate, item.gained) for item in fitted])
    if found.repeatability is None:
        return None
    shown = [item for item in fitted if item.fit is not None and item.estimate.sensor_zero is not None]
    zeros = [item.estimate.sensor_zero for item in shown if item.estimate.sensor_zero is not None]
    if not zeros:  # a body without a spring has no zero from which its residuals are counted
        return found
    weights = np.array([one.known_std**-2 for one in zeros])
    mean = float(weights @ np.array([one.value for one in zeros]) / weights.sum())
    common = campaign.sensor.zero != "per_run" and not any(run.unrestrained for run in campaign.runs)
    residuals = [
        one
        for item, zero in zip(shown, zeros, strict=True)
        if item.fit is not None
        for one in residuals_of([item.reading], [item.fit], zero.value, _RUN_UNKNOWNS)
    ]
    noise = noise_level(residuals, campaign.sensor)
    zero = Quantity(mean, float(weights.sum() ** -0.5), "rad") if common else None
    return replace(found, noise=noise, sensor_zero=zero)


Found: TypeAlias = RunDecay | Status
"""The result for one run, or the status of its failure."""


class RunByRun(ABC):
    """An estimator that identifies each run by itself and then combines the runs."""

    name: ClassVar[str]
    takes_driven: ClassVar[bool] = False

    def estimate(self, campaign: Campaign) -> Estimate:
        """Identify every run, then the campaign from the identified runs.

        Raises:
            TunnelError: a wind-on run states no air density, or the method does not take a run; raised before any
                run is analysed.
        """
        for run in campaign.runs:
            loads(run, campaign.rig)
            if why := self._refusal(run):
                where, remedy = f"{campaign.name}, run '{run.id}'", "use output_error, or leave the run out"
                raise TunnelError(f"the run {why}", where=where, remedy=remedy)
        pairs = [(run, self._run(run, campaign.sensor)) for run in counted(campaign.runs)]
        found = [
            RunDecay(RunEstimate(run.id, (one,))) if isinstance(one, Status) else one for run, one in pairs
        ]
        linked = LinkedRuns.of(campaign, [item.gained for item in found])
        return combined_estimate(linked, self.name, found, together=self._together(found))

    def _refusal(self, run: Run) -> str:
        """Why the method does not accept a run, as words after "the run"; empty if it does."""
        del run
        return ""

    @abstractmethod
    def _run(self, run: Run, sensor: SensorProperties) -> Found:
        """Identify one run."""

    def _together(self, found: Sequence[RunDecay]) -> Combination | None:
        """The method's own combination of the runs; None if it has none."""
        del found
        return None


def run_estimate(
    run: Run,
    decay: Decay,
    covariance: Array | None,
    noise_std: float,
    check: ResidualCheck | None,
    sensor: SensorProperties,
    windows: tuple[WindowEstimate, ...] = (),
) -> Found:
    """The result of a method that does not judge the model itself: the least-squares residual is tested instead.

    Args:
        covariance: covariance of (a, k) from the method, shape (2, 2), in 1/s and 1/s²; None if it gives none.
        noise_std: noise of one sample of the reading, rad.
        check: verdict of the least-squares residual; None if there is none.
    """
    reading = Reading.from_record(run.record)
    projected = project_run(reading, decay)
    if projected is None:
        return Status.NOT_CONVERGED
    _, failure = noise_and_failure(reading, *projected, sensor)
    if failure is not None or covariance is None:
        return failure or Status.NOT_CONVERGED
    noise = None if check is None else check.noise
    covariance = covariance if check is None else check.widened(covariance)
    estimate = describe_run(run, reading, *projected, covariance, noise_std**2, noise=noise, windows=windows)
    return RunDecay(estimate, Gained.of(np.array([decay.rate, decay.stiffness, 0.0]), covariance))
