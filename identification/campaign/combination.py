"""From runs that a method identified one by one to the campaign's coefficients: generalised least squares."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, TypeAlias

import numpy as np
from scipy.special import chdtri

from identification.campaign.derivatives import (
    Design,
    build_design,
    combine,
    derivatives,
    design_statuses,
    filled_estimate,
    loads,
    noise_statuses,
    statuses_of_runs,
)
from identification.campaign.driven import gain_remark, is_remarked, joined_runs, run_remark, with_gains
from identification.estimate import Estimate, RunEstimate, Status, WindowEstimate, by_severity
from identification.policy import MISFIT_RATE
from identification.signal.decay_fit import Reading, project_run
from identification.signal.driven_fit import Gained
from identification.signal.free_decay import Decay
from identification.signal.run_fit import describe_run, noise_and_failure, residual_check
from identification.statistics import determined, inverse
from tunnel_sim.vocabulary.campaign import Campaign, Run, SensorProperties
from tunnel_sim.vocabulary.record import Array

Combination = Callable[[Design, list[int], Array, Array], tuple[Array, Array]]
"""The design, the places of its runs, φ and its covariance to φ and its covariance."""


@dataclass(frozen=True, eq=False)
class RunDecay:
    """The result of a method for one run alone.

    Args:
        estimate: the run's result, or the status of its failure.
        decay: decay rate and stiffness; None where the run could not be identified.
        covariance: of (a, k), shape (2, 2), in 1/s and 1/s²; None where decay is.
        gained: of a driven run, (a, k, g) with the gain g of its input per unit inertia, and its information.
    """

    estimate: RunEstimate
    decay: Decay | None = None
    covariance: Array | None = None
    gained: Gained | None = None


def combined_estimate(
    campaign: Campaign, name: str, found: Sequence[RunDecay], *, together: Combination | None = None
) -> Estimate:
    """The campaign's coefficients from runs identified one by one: generalised least squares on their (a, k).

    Where the runs contradict each other beyond chance, the covariance is widened by their scatter, the ratio of
    Birge, Phys. Rev. 40 (1932) 207–227, doi 10.1103/PhysRev.40.207. Runs without a result or a spring stiffness
    are left out.

    Args:
        found: one per run, in the campaign's order.
        together: a method's own combination of the runs, which starts from that of least squares.

    Raises:
        TunnelError: when a wind-on run states no air density.
    """
    estimate = Estimate(campaign.name, name, tuple(item.estimate for item in found))
    statuses = statuses_of_runs(campaign, estimate.runs)
    identified = {run.id for run, item in zip(campaign.runs, found, strict=True) if item.estimate.identified}
    joined = joined_runs([run for run in campaign.runs if run.id in identified], campaign.rig)
    pairs = [
        (place, run, item)
        for place, (run, item) in enumerate(zip(campaign.runs, found, strict=True))
        if item.decay is not None and item.covariance is not None and run.id in joined
    ]
    statuses |= noise_statuses([run.noise for run in estimate.runs])
    remarks = tuple(
        run_remark(run, item.gained)
        for run, item in zip(campaign.runs, found, strict=True)
        if item.gained is not None and is_remarked(run, joined)
    )
    estimate = replace(estimate, remarks=remarks)
    if not pairs:
        return replace(estimate, statuses=by_severity(statuses))
    runs = [run for _, run, _ in pairs]
    design = build_design(runs, campaign.rig)
    linked = with_gains(design, runs) if campaign.driven else design
    decays, informations = _own(pairs, driven=campaign.driven)
    combined = combine(linked, decays, informations)
    if combined is None:
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_DETERMINED}))
    parameters, covariance = combined
    ratio, freedom = 1.0, sum(np.count_nonzero(weight.diagonal()) for weight in informations) - linked.size
    if freedom > 0:
        away = [decay - link @ parameters for decay, link in zip(decays, linked.links, strict=True)]
        scatter = sum(float(d @ weight @ d) for d, weight in zip(away, informations, strict=True))
        ratio = scatter / freedom if scatter > float(chdtri(freedom, MISFIT_RATE)) else 1.0
    if together is not None:
        parameters, covariance = together(design, [place for place, *_ in pairs], parameters, covariance)
    size = design.size
    values = derivatives(design, parameters[:size])
    own = values.jacobian @ (covariance[:size, :size] * ratio) @ values.jacobian.T
    if values.names and not determined(own):
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_DETERMINED}))
    if linked.size > size:
        gain = gain_remark(runs, parameters, covariance * ratio, values.get("yaw_inertia"))
        estimate = replace(estimate, remarks=(gain, *remarks))
    return filled_estimate(
        campaign, estimate, runs, design, values, own, statuses | design_statuses(design, parameters[:size])
    )


def _own(pairs: Sequence[tuple[int, Run, RunDecay]], *, driven: bool) -> tuple[Array, list[Array]]:
    """(a, k) of the runs and their informations; with driven runs (a, k, g), zeros for the gain of a free one."""
    decays, informations = [], []
    for _, _, item in pairs:
        assert item.decay is not None
        assert item.covariance is not None
        if item.gained is not None:
            decays.append(item.gained.coefficients)
            informations.append(item.gained.weight)
            continue
        size = 3 if driven else 2
        decays.append(np.array([item.decay.rate, item.decay.stiffness, 0.0][:size]))
        information = np.zeros((size, size))
        information[:2, :2] = inverse(item.covariance)
        informations.append(information)
    return np.array(decays), informations


Found: TypeAlias = RunDecay | Status
"""The result for one run, or the status of its failure."""


class RunByRun(ABC):
    """An estimator that identifies each run by itself and then combines the runs."""

    name: ClassVar[str]

    def estimate(self, campaign: Campaign) -> Estimate:
        """Identify every run, then the campaign from those that could be identified.

        Raises:
            TunnelError: a wind-on run states no air density; raised before any run is analysed.
        """
        for run in campaign.runs:
            loads(run, campaign.rig)
        pairs = [(run, self._run(run, campaign.sensor)) for run in campaign.runs]
        found = [
            RunDecay(RunEstimate(run.id, (one,))) if isinstance(one, Status) else one for run, one in pairs
        ]
        return combined_estimate(campaign, self.name, found, together=self._together(found))

    @abstractmethod
    def _run(self, run: Run, sensor: SensorProperties) -> Found:
        """Identify one run."""

    def _together(self, found: Sequence[RunDecay]) -> Combination | None:
        """The method's own combination of the runs; None where it has none."""
        del found
        return None


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
