"""What estimators that identify every run by itself have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar, TypeAlias

from identification.campaign.combination import Combination, RunDecay, combined_estimate
from identification.campaign.derivatives import loads
from identification.campaign.pairing import PairedRun, paired_estimate
from identification.estimate import Estimate, RunEstimate, Status, WindowEstimate
from identification.signal.decay_fit import Reading, project_run
from identification.signal.free_decay import Decay
from identification.signal.run_fit import describe_run, noise_and_failure, residual_check
from tunnel_sim.vocabulary.campaign import Campaign, Run, SensorProperties
from tunnel_sim.vocabulary.record import Array

Found: TypeAlias = RunDecay | Status
"""The result for one run, or the status of its failure."""


class RunByRun(ABC):
    """An estimator that identifies each run by itself and then combines the runs."""

    name: ClassVar[str]

    def estimate(self, campaign: Campaign) -> Estimate:
        """Identify every run, then the campaign from the runs.

        Args:
            campaign: at least one run.

        Returns:
            The estimate. A run that could not be identified is left out.

        Raises:
            TunnelError: a wind-on run states no air density; raised before any run is analysed.
        """
        for run in campaign.runs:
            loads(run, campaign.rig)
        pairs = [(run, self._run(run, campaign.sensor)) for run in campaign.runs]
        found = [RunDecay.failed(run, one) if isinstance(one, Status) else one for run, one in pairs]
        return combined_estimate(campaign, self.name, found, together=self._together(found))

    @abstractmethod
    def _run(self, run: Run, sensor: SensorProperties) -> Found:
        """Identify one run."""

    def _together(self, found: Sequence[RunDecay]) -> Combination | None:
        """The method's own combination of the runs; None where it has none."""
        del found
        return None


class Paired(ABC):
    """An estimator that identifies each run by itself and then pairs wind-on with wind-off runs of a spring."""

    name: ClassVar[str]

    def estimate(self, campaign: Campaign) -> Estimate:
        """Identify every run, then the campaign by pairs of wind-on and wind-off runs.

        Args:
            campaign: at least one run.

        Returns:
            The estimate. A run that could not be identified is left out; the coefficients omit wind-on runs without
            a wind-off run of their spring.

        Raises:
            TunnelError: a wind-on run states no air density; raised before any run is analysed.
        """
        pairs = [loads(run, campaign.rig) for run in campaign.runs]
        found = [self._run(run, campaign.sensor) for run in campaign.runs]
        estimate = Estimate(campaign.name, self.name, tuple(one for one, _ in found))
        known = [(one, load) for (_, one), load in zip(found, pairs, strict=True) if one is not None]
        if not known:
            return replace(estimate, statuses=(Status.NO_RUN_IDENTIFIED,))
        of_runs = {status for run in estimate.runs for status in run.statuses}
        statuses = of_runs & {Status.MODEL_DEPARTS, Status.NOISE_DISAGREES}
        if len(known) < len(found):
            statuses.add(Status.RUN_LEFT_OUT)
        return paired_estimate(campaign, estimate, known, statuses)

    @abstractmethod
    def _run(self, run: Run, sensor: SensorProperties) -> tuple[RunEstimate, PairedRun | None]:
        """Identify one run."""


def run_estimate(
    run: Run,
    decay: Decay,
    covariance: Array | None,
    noise_std: float,
    sensor: SensorProperties,
    windows: tuple[WindowEstimate, ...] = (),
) -> Found:
    """The result of a method that does not judge the model: the least-squares residual does.

    Args:
        covariance: of (a, k) as the method gives it, shape (2, 2), in 1/s and 1/s²; None where it gives none.
        noise_std: of one sample of the reading, rad.
    """
    reading = Reading.from_record(run.record)
    projected = project_run(reading, decay)
    if projected is None:
        return Status.NOT_CONVERGED
    _, failure = noise_and_failure(reading, *projected, sensor)
    if failure is not None or covariance is None:
        return failure or Status.NOT_CONVERGED
    check = residual_check(run, decay, sensor)
    noise = None if check is None else check.noise
    covariance = covariance if check is None else check.widened(covariance)
    estimate = describe_run(run, reading, *projected, covariance, noise_std**2, noise=noise, windows=windows)
    return RunDecay(estimate, decay, covariance)
