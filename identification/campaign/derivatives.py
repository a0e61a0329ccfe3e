"""From decay rates and stiffnesses of the runs to Cnβ, Cnr, Izz and Cr, and to an `Estimate`.

With g = 1/Izz, n = Cnβ/Izz, d = Cr/Izz and m = Cnr/Izz the equation of motion (paper, eqs 2–6, signs as in eqs 7
and 8) gives for run i, linear in (g, n, d, m),

    kᵢ = Krᵢ g − ½ρᵢVᵢ² A l n,    2aᵢ = d − ½ρᵢVᵢ A l² m.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identification.campaign.springs import wind_off_line
from identification.estimate import (
    PARAMETERS,
    UNITS,
    Estimate,
    NoiseLevel,
    RunEstimate,
    RunScatter,
    Status,
    by_severity,
)
from identification.policy import LEAST_SPRING_SPREAD
from identification.show.quantity import Quantity
from identification.statistics import determined, inverse, scaled_solve, student_factor
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, needs_density
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import aerodynamic_damping, aerodynamic_stiffness
from tunnel_sim.vocabulary.quantities import PerParameter
from tunnel_sim.vocabulary.record import Array

# Smallest singular value of two columns of unit length, for two runs whose springs or speeds are just
# different.
_RANK_TOLERANCE = LEAST_SPRING_SPREAD / np.sqrt(8.0)
# Greatest stiffness or moment in SI units; the smallest is its inverse. Fourth powers are formed.
_GREATEST = 1e60


@dataclass(frozen=True, eq=False)
class Design:
    """The dependence of the runs' decay rates and stiffnesses on the shared parameters φ.

    Args:
        links: one (2, p) matrix per run: (aᵢ, kᵢ) = Lᵢ φ.
        columns: places in φ of the separable parameters among g, n, d, m.
        stiffness_loads: ½ρV²·A·l per run, N m, shape (r,); without A·l where the size is unknown.
        damping_loads: ½ρV·A·l² per run, N m s, shape (r,); without A·l² where the size is unknown.
    """

    links: tuple[Array, ...]
    columns: dict[str, int]
    stiffness_loads: Array
    damping_loads: Array
    has_size: bool

    @property
    def size(self) -> int:
        """Number of shared parameters p."""
        return int(self.links[0].shape[1])


@dataclass(frozen=True, eq=False)
class Derivatives:
    """The campaign's parameters.

    Args:
        names: names of the determined parameters, in the order of `estimate.PARAMETERS`.
        values: values, shape (p,), SI. Without the rig's size, cn_beta and cn_r stand for A·l·Cnβ and A·l²·Cnr.
        jacobian: of the values with respect to φ, shape (p, size).
    """

    names: tuple[str, ...]
    values: Array
    jacobian: Array

    def get(self, name: str) -> float | None:
        """A value by name; None where it was not determined."""
        return float(self.values[self.names.index(name)]) if name in self.names else None


def loads(run: Run, rig: RigProperties) -> tuple[float, float]:
    """The factors of Cnβ and Cnr in a run: ½ρV²·A·l [N m] and ½ρV·A·l² [N m s]; unknown ρ, A and l count as 1.

    Raises:
        TunnelError: when a run does not state the air density it needs, or a stated value is too large or too small
            for double precision.
    """
    _within_range("spring_stiffness", run.spring_stiffness or 1.0, "N m/rad", run)
    if not run.wind_on:
        return 0.0, 0.0
    scales = run.spring_stiffness, rig.frontal_area, rig.reference_length
    if run.air_density is None and needs_density(run.wind_speed, *scales):
        raise TunnelError(
            "wind-on run without air_density", where=f"run {run.id}", remedy="state it in kg/m3"
        )
    known = has_size(rig)
    conditions = {
        "air_density": 1.0 if run.air_density is None else run.air_density,
        "wind_speed": run.wind_speed,
        "frontal_area": rig.frontal_area if known and rig.frontal_area is not None else 1.0,
        "reference_length": rig.reference_length if known and rig.reference_length is not None else 1.0,
    }
    found = aerodynamic_stiffness(1.0, **conditions), aerodynamic_damping(1.0, **conditions)
    for load, unit in zip(found, ("N m", "N m s"), strict=True):
        _within_range("wind_speed, air_density and the sizes: their product", load, unit, run)
    return found


def _within_range(name: str, value: float, unit: str, run: Run) -> None:
    if not 1.0 / _GREATEST < abs(value) < _GREATEST:
        raise TunnelError(
            f"{name} = {value:g} {unit} is out of range", where=f"run {run.id}", remedy="correct its unit"
        )


def has_size(rig: RigProperties) -> bool:
    """Whether the rig states both frontal area and reference length."""
    return rig.frontal_area is not None and rig.reference_length is not None


def build_design(runs: Sequence[Run], rig: RigProperties) -> Design:
    """Link runs of stated spring stiffness to the shared parameters φ.

    A driven run with a known moment determines g. If the runs do not separate g and n, or d and m, ``columns``
    lacks them, and their combination is fitted run by run.
    """
    springs = np.array([run.spring_stiffness for run in runs], dtype=np.float64)
    pairs = np.array([loads(run, rig) for run in runs])
    windy = bool(np.any(pairs[:, 0] > 0.0))
    known = any(run.input_gain for run in runs)
    columns: dict[str, int] = {}
    blocks: list[tuple[int, Array]] = []
    for row, names, fixed, load in (
        (1, "gn", springs, pairs[:, 0]),
        (0, "dm", np.full(len(runs), 0.5), 0.5 * pairs[:, 1]),
    ):
        block = np.column_stack((fixed, -load)) if windy else fixed[:, None]
        offset = sum(other.shape[1] for _, other in blocks)
        by_input = [[np.abs(block).max() or 1.0, 0.0][: block.shape[1]]] if known and row == 1 else []
        table = np.vstack((block, *by_input))
        lengths = np.linalg.norm(table, axis=0)
        if (
            lengths.min() > 0.0
            and table.shape[0] >= table.shape[1]
            and np.linalg.svd(table / lengths, compute_uv=False)[-1] > _RANK_TOLERANCE
        ):
            columns |= {name: offset + index for index, name in enumerate(names[: block.shape[1]])}
        else:
            block = np.eye(len(runs))
        blocks.append((row, block))
    width = sum(block.shape[1] for _, block in blocks)
    links = np.zeros((len(runs), 2, width))
    links[:, blocks[0][0], : blocks[0][1].shape[1]] = blocks[0][1]
    links[:, blocks[1][0], blocks[0][1].shape[1] :] = blocks[1][1]
    return Design(tuple(links), columns, pairs[:, 0], pairs[:, 1], has_size(rig))


def combine(design: Design, decays: Array, informations: Sequence[Array]) -> tuple[Array, Array] | None:
    """The shared parameters that best fit the runs' own decays, by generalised least squares.

    Args:
        decays: (a, k) per run, shape (r, 2), 1/s and 1/s².
        informations: inverse covariance of each (a, k), shape (2, 2).

    Returns:
        φ, shape (p,), and its covariance, shape (p, p); None where the runs do not determine it.
    """
    pairs = list(zip(design.links, informations, strict=True))
    normal = sum((link.T @ weight @ link for link, weight in pairs), np.zeros((design.size, design.size)))
    right = sum(
        (link.T @ weight @ decay for (link, weight), decay in zip(pairs, decays, strict=True)),
        np.zeros(design.size),
    )
    return (scaled_solve(normal, right), inverse(normal)) if determined(normal) else None


def derivatives(design: Design, parameters: PerParameter) -> Derivatives:
    """Cnβ, Cnr, Izz and Cr from the shared parameters; none if the design gives no positive Izz."""
    if not positive_inertia(design, parameters):
        return Derivatives((), np.zeros(0), np.zeros((0, design.size)))
    inertia = 1.0 / float(parameters[design.columns["g"]])
    sources = {"cn_beta": "n", "cn_r": "m", "yaw_inertia": "g", "mechanical_damping": "d"}
    names, values, rows = [], [], []
    for name in PARAMETERS:
        if sources[name] not in design.columns:
            continue
        column = design.columns[sources[name]]
        row = np.zeros(design.size)
        value = inertia if name == "yaw_inertia" else float(parameters[column]) * inertia
        if name != "yaw_inertia":
            row[column] = inertia
        row[design.columns["g"]] = -value * inertia
        names.append(name)
        values.append(value)
        rows.append(row)
    return Derivatives(tuple(names), np.array(values), np.array(rows))


def positive_inertia(design: Design, parameters: PerParameter) -> bool:
    """Whether the design determines Izz, and a positive one."""
    return "g" in design.columns and bool(parameters[design.columns["g"]] > 0.0)


def filled_estimate(
    campaign: Campaign,
    estimate: Estimate,
    runs: Sequence[Run],
    design: Design,
    found: Derivatives,
    covariance: Array,
    statuses: set[Status],
    repeatability: RunScatter | None = None,
) -> Estimate:
    """The estimate with coefficients, the aerodynamic terms of its runs and the wind-off line.

    Without the rig's sizes the coefficients still contain the factors A·l and A·l², and only Ka and Ca per run are
    given.

    Args:
        covariance: covariance of the values, shape (p, p).
        repeatability: repeatability of the runs, where the covariance includes it.
    """
    air: dict[str, dict[str, Any]] = {}  # aerodynamic stiffness and damping of every wind-on run
    for name, target, load, unit in (
        ("cn_beta", "aerodynamic_stiffness", design.stiffness_loads, "N m/rad"),
        ("cn_r", "aerodynamic_damping", design.damping_loads, "N m s/rad"),
    ):
        value = found.get(name)
        if value is None:
            continue
        place = found.names.index(name)
        std = float(np.sqrt(covariance[place, place]))
        for run, factor in zip(runs, load, strict=True):
            if run.wind_on:
                air.setdefault(run.id, {})[target] = Quantity(
                    float(factor) * value, float(factor) * std, unit
                )
    kept = [i for i, name in enumerate(found.names) if design.has_size or name not in ("cn_beta", "cn_r")]
    stds = np.sqrt(np.diag(covariance))
    coefficients: dict[str, Any] = {
        found.names[i]: Quantity(float(found.values[i]), float(stds[i]), UNITS[found.names[i]]) for i in kept
    }
    return replace(
        estimate,
        statuses=by_severity(statuses),
        runs=tuple(replace(run, **air.get(run.id, {})) for run in estimate.runs),
        repeatability=None if repeatability is None else repeatability.among(kept),
        **wind_off(estimate.runs, campaign.runs, repeatability),
        parameters=tuple(found.names[i] for i in kept),
        covariance=tuple(map(tuple, covariance[np.ix_(kept, kept)].tolist())),
        **coefficients,
    )


def statuses_of_runs(campaign: Campaign, estimates: Sequence[RunEstimate]) -> set[Status]:
    """The statuses of a campaign that follow from the estimates of its runs, in the campaign's order.

    Only NO_RUN_IDENTIFIED if no run was identified.
    """
    identified = [estimate.identified for estimate in estimates]
    if not any(identified):
        return {Status.NO_RUN_IDENTIFIED}
    statuses = set()
    if not all(identified):
        statuses.add(Status.RUN_LEFT_OUT)
    if any(run.spring_stiffness is None for run in campaign.runs):
        statuses.add(Status.NO_STIFFNESS)
    if any(Status.FEW_CYCLES in estimate.statuses for estimate in estimates):
        statuses.add(Status.FEW_CYCLES)
    return statuses


def noise_statuses(levels: Sequence[NoiseLevel | None]) -> set[Status]:
    """MODEL_DEPARTS and NOISE_DISAGREES from noise levels; None for a missing level."""
    statuses = set()
    if any(level.departs for level in levels if level is not None):
        statuses.add(Status.MODEL_DEPARTS)
    if any(level.disagrees for level in levels if level is not None):
        statuses.add(Status.NOISE_DISAGREES)
    return statuses


def design_statuses(design: Design, parameters: Array) -> set[Status]:
    """The statuses for parameters that the campaign's conditions cannot separate, and for an impossible inertia.

    Args:
        parameters: estimated φ, shape (p,).
    """
    statuses = set()
    if not np.any(design.stiffness_loads > 0.0):
        statuses.add(Status.NO_WIND_ON)
    elif not design.has_size:
        statuses.add(Status.NO_REFERENCE_SIZE)
    if "g" not in design.columns:
        statuses.add(Status.STIFFNESS_NOT_SEPARABLE)
    elif not positive_inertia(design, parameters):
        statuses.add(Status.INERTIA_NOT_POSITIVE)
    if "d" not in design.columns:
        statuses.add(Status.DAMPING_NOT_SEPARABLE)
    return statuses


def wind_off(
    estimates: Sequence[RunEstimate], runs: Sequence[Run], repeatability: RunScatter | None
) -> dict[str, Any]:
    """Izz and intercept of the line of Kr against ωn² of the wind-off runs (paper, eq. 1).

    Args:
        repeatability: where it counts, the deviations of the frequencies include the scatter of the springs.

    Returns:
        Keyword arguments of `Estimate`; none without wind-off runs.
    """
    spring, between = None if repeatability is None else repeatability.spring_stiffness, 0.0
    if spring is not None:
        widened = student_factor(np.array([4.0 * (spring.known_std / spring.value) ** 2]))
        between = 0.5 * spring.value * float(widened[0])
    rows = [
        (
            run.spring_stiffness,
            found.omega_n.value,
            float(np.hypot(found.omega_n.known_std, between * found.omega_n.value)),
        )
        for run, found in zip(runs, estimates, strict=True)
        if not run.wind_on and run.spring_stiffness is not None and found.omega_n is not None
    ]
    if not rows:
        return {}
    inertia, intercept = wind_off_line(*map(np.array, zip(*rows, strict=True)))
    return {"wind_off_inertia": inertia, "wind_off_intercept": intercept}
