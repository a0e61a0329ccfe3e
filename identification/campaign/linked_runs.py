"""The runs that jointly determine a campaign's coefficients, with their inputs: linked, combined, and reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from identification.campaign.derivatives import (
    Derivatives,
    Design,
    build_design,
    combine,
    derivatives,
    design_statuses,
    filled_estimate,
)
from identification.campaign.run_scatter import MeasuredRuns, ScatterFit, moves_of, scatter_between
from identification.estimate import Estimate, RunScatter, Status
from identification.show.numbers import with_std
from identification.signal.forcing import forcing_of
from identification.signal.run_fit import Gained
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run
from tunnel_sim.vocabulary.quantities import PerParameter
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True, eq=False)
class LinkedRuns:
    """The runs with a result and a spring, linked to the shared parameters φ.

    Args:
        places: places of the runs in the campaign.
        gained: decay rate, stiffness and gain of every run.
        remarks: remarks on runs that determine no coefficient, or only in isolation.
    """

    campaign: Campaign
    places: list[int]
    runs: list[Run]
    gained: list[Gained]
    remarks: tuple[Remark, ...]

    @classmethod
    def of(cls, campaign: Campaign, gained: Sequence[Gained | None]) -> Self:
        """Link the runs.

        Args:
            gained: decay rate, stiffness and gain of every run; None where they were not found.
        """
        known = [
            (place, run, item)
            for place, (run, item) in enumerate(zip(campaign.runs, gained, strict=True))
            if item is not None
        ]
        joined = _joined_runs([run for _, run, _ in known], campaign.rig)
        remarks = tuple(_run_remark(run, item) for _, run, item in known if _is_remarked(run, joined))
        used = [one for one in known if one[1].id in joined]
        places, runs, of_runs = (list(column) for column in zip(*used, strict=True)) if used else ([], [], [])
        return cls(campaign, places, runs, of_runs, remarks)

    @cached_property
    def design(self) -> Design:
        """The design without the gains of inputs."""
        return build_design(self.runs, self.campaign.rig)

    @cached_property
    def linked(self) -> Design:
        """The design with the gains of inputs, the unknown gain last in φ."""
        return with_gains(self.design, self.runs)

    @cached_property
    def least_squares(self) -> tuple[Array, Array] | None:
        """φ without scatter and its covariance, shape (p, p); None where the runs do not determine it."""
        return combine(self.linked, np.array(self.coefficients), self.weights) if self.runs else None

    @property
    def coefficients(self) -> list[Array]:
        """(a, k, g) without the known part of the gain, by run, shape (3,), SI."""
        pairs = zip(self.runs, self.gained, strict=True)
        return [one.coefficients - forcing_of(run, 0).fixed for run, one in pairs]

    @property
    def weights(self) -> list[Array]:
        """Inverse covariance of (a, k, g) by run, shape (3, 3)."""
        return [one.weight for one in self.gained]

    def measured(self, parameters: PerParameter) -> MeasuredRuns:
        """The runs, measured relative to common parameters."""
        moves = moves_of(self.runs, self.linked, parameters)
        return MeasuredRuns(self.linked.links, self.coefficients, self.weights, moves)

    @cached_property
    def scatter(self) -> ScatterFit | None:
        """The scatter between the runs; None where it does not count."""
        if self.least_squares is None:
            return None
        start = self.least_squares[0]
        return scatter_between(self.measured(start), start, self.campaign.repeatability)

    def values(self, parameters: Array, covariance: Array) -> tuple[Derivatives, Array]:
        """The coefficients for φ, and their covariance, shape (q, q)."""
        size = self.design.size
        values = derivatives(self.design, parameters[:size])
        return values, values.jacobian @ covariance[:size, :size] @ values.jacobian.T

    def filled(
        self,
        estimate: Estimate,
        values: Derivatives,
        of_values: Array,
        parameters: Array,
        covariance: Array,
        statuses: set[Status],
        repeatability: RunScatter | None = None,
    ) -> Estimate:
        """The estimate with the coefficients, and a remark on a gain common to the inputs.

        Args:
            of_values: covariance of the values, shape (q, q).
            covariance: covariance of φ, with the gain last, shape (p, p).
            repeatability: repeatability of the runs, if the covariance includes it.
        """
        size = self.design.size
        if self.linked.size > size:
            gain = _gain_remark(self.runs, parameters, covariance, values.get("yaw_inertia"))
            estimate = replace(estimate, remarks=(gain, *estimate.remarks))
        statuses = statuses | design_statuses(self.design, parameters[:size])
        return filled_estimate(
            self.campaign, estimate, self.runs, self.design, values, of_values, statuses, repeatability
        )


def with_gains(design: Design, runs: Sequence[Run]) -> Design:
    """A design with links of shape (3, p), which also give the gains of the inputs: gᵢ, 0 in free runs.

    The row of a gain that is a known number over the inertia is zero too. An unknown gain of an input is the
    last
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
    """Whether the gain of a run's input is a separate parameter.

    Args:
        place: place of 1/Izz among the parameters; None where the runs do not determine it.
    """
    if run.drive is None or run.drive.kind.by_inertia:
        return False
    return run.input_gain is None or place is None


def _joined_runs(runs: Sequence[Run], rig: RigProperties) -> set[str]:
    """Ids of the runs of stated stiffness, which are fitted together.

    Without a known moment or a spring in any of them, a body without a spring does not determine the inertia.
    """
    stated = [run for run in runs if run.spring_stiffness is not None]
    if stated and "g" not in build_design(stated, rig).columns:
        stated = [run for run in stated if run.spring_stiffness]
    return {run.id for run in stated}


def _is_remarked(run: Run, joined: set[str]) -> bool:
    """Whether a note describes a driven run alone: one without a spring, or without a coefficient."""
    apart = run.id not in joined and run.known_gain is None
    return run.drive is not None and (run.unrestrained or (apart and run.drive.on_body))


def _run_remark(run: Run, gained: Gained) -> Remark:
    """The parameters that a driven run determines by itself, per unit inertia, and the parameters it does not."""
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


def _gain_remark(runs: Sequence[Run], parameters: Array, covariance: Array, inertia: float | None) -> Remark:
    """The gain common to the inputs of unknown gain.

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
