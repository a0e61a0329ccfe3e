"""From runs identified one by one to the campaign's coefficients."""

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
from identification.campaign.run_scatter import MeasuredRuns, scatter_between
from identification.estimate import Estimate, RunEstimate, Status, WindowEstimate, by_severity
from identification.policy import MISFIT_RATE
from identification.progress import counted
from identification.show.numbers import with_std
from identification.show.quantity import Quantity
from identification.signal.decay_fit import Reading, project_run
from identification.signal.forcing import forcing_of
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
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

_RUN_UNKNOWNS = 5  # of a run's own fit: decay, stiffness, initial state, zero
Combination = Callable[[Design, list[int], Array, Array], tuple[Array, Array]]
"""The design, the places of its runs, φ and its covariance to φ and its covariance."""


@dataclass(frozen=True, eq=False)
class RunDecay:
    """The result of a method for one run alone.

    Args:
        gained: decay rate, stiffness and gain of its input; None where they were not found.
        instead: why the result is that of another method, and a remedy; None where it is the method's own.
    """

    estimate: RunEstimate
    gained: Gained | None = None
    instead: tuple[str, str] | None = None


def combined_estimate(
    campaign: Campaign, name: str, found: Sequence[RunDecay], *, together: Combination | None = None
) -> Estimate:
    """The campaign's coefficients from runs identified one by one: generalised least squares on their (a, k, g).

    Scatter between the runs is in the covariance (`identification.campaign.run_scatter`). Where they contradict
    each other beyond it, the covariance is widened by the ratio of Birge, Phys. Rev. 40 (1932) 207–227, doi
    10.1103/PhysRev.40.207. Runs without a result or a spring stiffness are left out.

    Args:
        together: a method's own combination of the runs, which starts from the least-squares one.

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
        if item.gained is not None and run.id in joined
    ]
    statuses |= noise_statuses([run.noise for run in estimate.runs])
    remarks = tuple(
        run_remark(run, item.gained)
        for run, item in zip(campaign.runs, found, strict=True)
        if item.gained is not None and is_remarked(run, joined)
    )
    remarks += _of_another_method(found)
    estimate = replace(estimate, remarks=remarks)
    if not pairs:
        return replace(estimate, statuses=by_severity(statuses))
    runs = [run for _, run, _ in pairs]
    design = build_design(runs, campaign.rig)
    linked = with_gains(design, runs)
    decays = [seen_by(run, item.gained) for _, run, item in pairs if item.gained is not None]
    informations = [item.gained.weight for *_, item in pairs if item.gained is not None]
    combined = combine(linked, np.array(decays), informations)
    if combined is None:
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_DETERMINED}))
    parameters, covariance = combined
    measured = MeasuredRuns.of(runs, linked, decays, informations, parameters)
    scatter = scatter_between(measured, parameters, campaign.repeatability)
    if scatter is not None:
        misfit, parameters, covariance = scatter.quadratic, scatter.parameters, scatter.covariance
    else:
        misfit = measured.misfit(parameters)
        if together is not None:
            parameters, covariance = together(design, [place for place, *_ in pairs], parameters, covariance)
    freedom = sum(np.count_nonzero(weight.diagonal()) for weight in informations) - linked.size
    beyond = freedom > 0 and misfit > float(chdtri(freedom, MISFIT_RATE))
    ratio = misfit / freedom if beyond else 1.0
    size, repeatability = design.size, None
    values = derivatives(design, parameters[:size])
    own = values.jacobian @ covariance[:size, :size] @ values.jacobian.T
    if scatter is not None and values.names:
        own, repeatability = scatter.of(values.jacobian)
    own = own * ratio
    if values.names and not determined(own):
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_DETERMINED}))
    if linked.size > size:
        gain = gain_remark(runs, parameters, covariance * ratio, values.get("yaw_inertia"))
        estimate = replace(estimate, remarks=(gain, *remarks))
    statuses |= design_statuses(design, parameters[:size])
    return filled_estimate(campaign, estimate, runs, design, values, own, statuses, repeatability)


def _of_another_method(found: Sequence[RunDecay]) -> tuple[Remark, ...]:
    """A remark for each reason for which runs have the result of another method."""
    runs: dict[tuple[str, str], list[str]] = {}
    for item in found:
        if item.instead is not None and item.estimate.identified:
            runs.setdefault(item.instead, []).append(item.estimate.id)
    return tuple(Remark(Outcome.NOTED, tuple(names), what, remedy) for (what, remedy), names in runs.items())


def seen_by(run: Run, gained: Gained) -> Array:
    """(a, k, g) of a run without the part of the gain that depends on no unknown, shape (3,), SI."""
    return gained.coefficients - forcing_of(run, 0).fixed


def scattering_estimate(campaign: Campaign, name: str, fitted: Sequence[FittedRun]) -> Estimate | None:
    """The estimate from single-run least-squares fits where scatter between runs counts, otherwise None.

    A joint fit assumes that all runs repeat exactly, and would mistake the scatter for a misfit of the model.
    The sensor's zero is the mean of the runs' zeros, weighted by their variances.
    """
    of_runs = [RunDecay(item.estimate, item.gained) for item in fitted]
    found = combined_estimate(campaign, name, of_runs)
    if found.repeatability is None:
        return None
    shown = [item for item in fitted if item.fit is not None and item.estimate.sensor_zero is not None]
    zeros = [item.estimate.sensor_zero for item in shown if item.estimate.sensor_zero is not None]
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
        """Identify every run, then the campaign from those that could be identified.

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
        return combined_estimate(campaign, self.name, found, together=self._together(found))

    def _refusal(self, run: Run) -> str:
        """Why the method does not take a run, after "the run"; empty where it does."""
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
    """The result of a method that does not judge the model: the least-squares residual is tested instead.

    Args:
        covariance: of (a, k) from the method, shape (2, 2), in 1/s and 1/s²; None where it gives none.
        noise_std: of one sample of the reading, rad.
        check: of the least-squares residual; None where there is none.
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


def with_gains(design: Design, runs: Sequence[Run]) -> Design:
    """A design whose links, of shape (3, p), give the gains of the inputs too: gᵢ, 0 in free runs.

    The row of a gain that is a known number over the inertia is zero too. Where the gain of an input is unknown,
    it is the last element of φ, per unit inertia and common to the runs: shape (3, p + 1).
    """
    place = design.columns.get("g")
    sought = [_gain_sought(run, place) for run in runs]
    unknown = any(sought)
    links = []
    for link, run, own in zip(design.links, runs, sought, strict=True):
        whole = np.zeros((3, design.size + unknown))
        whole[:2, : design.size] = link
        if own and run.drive is not None:
            whole[2, -1] = run.drive.kind.scale
        elif run.input_gain is not None and place is not None:
            whole[2, place] = run.input_gain
        links.append(whole)
    return replace(design, links=tuple(links))


def _gain_sought(run: Run, place: int | None) -> bool:
    """Whether the gain of a run's input is a parameter of its own.

    Args:
        place: of 1/Izz among the parameters; None where the runs do not determine it.
    """
    if run.drive is None or run.drive.kind.by_inertia:
        return False
    return run.input_gain is None or place is None


def joined_runs(runs: Sequence[Run], rig: RigProperties) -> set[str]:
    """Ids of the runs that are fitted together: those of stated stiffness.

    Without a known moment or a spring in any of them, a body without a spring does not determine the inertia.
    """
    stated = [run for run in runs if run.spring_stiffness is not None]
    if stated and "g" not in build_design(stated, rig).columns:
        stated = [run for run in stated if run.spring_stiffness]
    return {run.id for run in stated}


def is_remarked(run: Run, joined: set[str]) -> bool:
    """Whether a note describes a driven run alone: without a spring, or where it gives no coefficient."""
    apart = run.id not in joined and run.known_gain is None
    return run.drive is not None and (run.unrestrained or (apart and run.drive.on_body))


def run_remark(run: Run, gained: Gained) -> Remark:
    """The parameters that a driven run determines by itself, per unit inertia, and those it does not."""
    assert run.drive is not None
    (rate, _, gain), (rate_std, _, gain_std) = gained.coefficients, gained.deviations
    gain *= run.drive.kind.scale  # for a base, the moment is opposite to the acceleration
    said = f"the gain of the input is {with_std(gain, gain_std)} rad/s² per unit"
    if gained.offset is None:
        return Remark(Outcome.NOTED, (run.id,), said, "state spring_stiffness for a gain in N m per unit")
    known, offset = run.input_gain is not None, gained.offset
    return Remark(
        Outcome.NOTED,
        (run.id,),
        f"without a spring {said}, the damping over the inertia {with_std(2.0 * rate, 2.0 * rate_std)} 1/s and a "
        f"constant moment beside the input {with_std(offset.value, offset.std)} {offset.unit}; "
        f"{'' if known else 'the inertia, '}omega_n, zeta and the sensor's zero are not determined",
        "add a run with a spring if they are needed" if known else "state drive_gain for the inertia",
        {
            "damping_over_inertia_per_s": 2.0 * float(rate),
            "gain_per_inertia": float(gain),
            "offset_in_units_of_the_input": offset.value,
        },
    )


def gain_remark(runs: Sequence[Run], parameters: Array, covariance: Array, inertia: float | None) -> Remark:
    """The gain that is common to the inputs of unknown gain.

    Args:
        parameters: φ with the gain last, per unit inertia, shape (p + 1,).
        covariance: of these parameters, shape (p + 1, p + 1).
        inertia: kg m²; None where it was not found.
    """
    value, std = float(parameters[-1]), float(np.sqrt(covariance[-1, -1]))
    absolute = "" if inertia is None else f", {value * inertia:.5g} N m per unit"
    return Remark(
        Outcome.NOTED,
        tuple(run.id for run in runs if run.drive is not None and not run.drive.kind.by_inertia),
        f"the gain of the input is {with_std(value, std)} rad/s² per unit{absolute}",
        "state drive_gain if it is known",
    )
