"""What a fit says of the coefficients: their values, their gradients, and how far what remains moves them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diagnosis.likelihood.least_squares import Fit, normal_equations
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.residuals import linear_coefficients, resonance
from diagnosis.policy import CHANCE_STDS, LEAST_HALF
from tunnel_sim.effects import ALL_EFFECTS
from tunnel_sim.effects.parameters import WindOnRun
from tunnel_sim.vocabulary.record import Array


def wind_on_runs(fit: Fit) -> list[WindOnRun]:
    """Stiffnesses, frequencies and loads of the wind-on runs that a spring holds, in SI units."""
    data = fit.problem.data
    found = []
    for i, run in enumerate(data.runs):
        if not run.wind_on:
            continue
        inertia, _, stiffness = linear_coefficients(fit, i)
        spring = fit.problem.stated(fit.point.common, fit.point.release[i], run).spring_stiffness
        if stiffness <= 0.0 or spring <= 0.0:
            continue
        load = 0.5 * run.air_density * run.wind_speed * data.frontal_area * data.reference_length**2
        omega, still = math.sqrt(stiffness / inertia), math.sqrt(spring / inertia)
        pressure = load * run.wind_speed / data.reference_length
        found.append(WindOnRun(spring, omega, still, pressure, load))
    return found


#: Parameters of a joint's law, by name in a fit, and their units.
JOINT_UNITS = {
    "yaw_inertia": "kg m2",
    "mechanical_damping": "N m s/rad",
    "added_stiffness": "N m/rad",
    "moment_offset": "N m",
}

#: Parameters that add to the spring's stiffness at small amplitudes, as gravity does.
_STIFFNESSES = tuple(
    f"{kind.name}.{kind.parameters()[0].name}"
    for kind in ALL_EFFECTS
    if kind.channel == "stiffness" and kind.parameters()[0].unit == "N m/rad"
)


def coefficient_names(problem: Problem) -> tuple[str, ...]:
    """The coefficients that a diagnosis states.

    Args:
        problem: nominal, or with effects.

    Returns:
        ``omega_n`` and ``zeta`` in normalised form, else ``cn_beta`` and ``cn_r``; before these the free inertia,
        damping and stiffness of a joint in a model of one's own. Inertia, damping and constant moment of a body
        that nothing holds.
    """
    if problem.data.normalised:
        return "omega_n", "zeta"
    own = JOINT_UNITS if problem.data.law is not None or problem.data.unrestrained else ()
    air = () if problem.data.unrestrained else ("cn_beta", "cn_r")
    return *(name for name in own if name in problem.names), *air


def stiffness_names(names: Sequence[str]) -> tuple[str, ...]:
    """The parameters whose sum is the stiffness of small swings.

    Args:
        names: of the common parameters of a fit in normalised form.

    Returns:
        That of the spring, and those of effects that add to it: a pendulum's only spring is gravity.
    """
    return ("stiffness", *(name for name in _STIFFNESSES if name in names))


def coefficient_value(names: Sequence[str], common: Array, name: str) -> float | None:
    """A coefficient of a fit.

    Args:
        names: of the common parameters.
        common: their values, shape (common,).
        name: ``cn_beta``, ``cn_r``, ``omega_n`` or ``zeta``.

    Returns:
        In 1/rad, rad/s or 1; None where the fit has no such coefficient.
    """
    value = dict(zip(names, common.tolist(), strict=True))
    if name not in ("omega_n", "zeta"):
        return value.get(name)
    omega = math.sqrt(max(sum(value[part] for part in stiffness_names(names)), 0.0))
    return omega if name == "omega_n" else value["mechanical_damping"] / max(2.0 * omega, 1e-150)


def coefficient_gradient(names: Sequence[str], common: Array, name: str) -> Array:
    """Derivative of a coefficient with respect to the common parameters.

    Args:
        names: of the common parameters, the coefficient or those it is made of among them.
        common: their values, shape (common,).
        name: ``cn_beta``, ``cn_r``, ``omega_n`` or ``zeta``.

    Returns:
        Shape (common,).
    """
    found = dict.fromkeys(names, 0.0)
    if name in found:
        found[name] = 1.0
        return np.array(list(found.values()))
    omega = max(coefficient_value(names, common, "omega_n") or 0.0, 1e-150)
    damping = float(common[list(names).index("mechanical_damping")])
    slope = 0.5 / omega if name == "omega_n" else -0.25 * damping / omega / omega / omega
    found |= dict.fromkeys(stiffness_names(names), slope)
    if name == "zeta":
        found["mechanical_damping"] = 0.5 / omega
    return np.array(list(found.values()))


@dataclass(frozen=True, eq=False)
class _Pieces:
    """All runs in pieces of one cycle.

    Args:
        pull: of each piece's residuals on the coefficient, in its unit, shape (pieces,).
        weight: of each piece in the coefficient's variance, in its unit squared, shape (pieces,).
        orders: by what the data are halved, each of shape (pieces,).
    """

    pull: Array
    weight: Array
    orders: tuple[Array, ...]


def coefficient_move(fit: Fit, name: str) -> float:
    """Half the difference between the coefficients of two halves of the data, beyond chance.

    The data are halved by amplitude, by time, by wind speed and by spring, and the halves that differ most count.
    The difference is that of one Gauss–Newton step from the fit: the scores of a fit sum to zero, and what one half
    pulls up the other pulls down. Were the model right, the pull would be the noise's alone. This is the test of
    Zeileis & Hornik (Stat. Neerl. 61 (2007) 488) for parameters that change along an ordering, in the parameter's
    unit; a refit of each half would answer the same, but is undetermined where one half shows only some causes.

    Args:
        name: of the coefficient: ``cn_beta``, ``cn_r``, ``omega_n`` or ``zeta``.

    Returns:
        The move in the coefficient's unit, reduced by what the noise alone gives (2 standard deviations, in
        quadrature); 0 where it gives as much.
    """
    pieces = _pieces(fit, coefficient_gradient(fit.problem.names, fit.point.common, name))
    return max(_half_difference(pieces, order) for order in pieces.orders)


def _half_difference(pieces: _Pieces, order: Array) -> float:
    """Half the difference between pieces low and high in an order, beyond chance; 0 where one half says nothing."""
    total = float(pieces.weight.sum())
    rank = np.argsort(order, kind="stable")
    at = int(np.searchsorted(np.cumsum(pieces.weight[rank]), 0.5 * total))
    middle = order[rank[min(at, rank.size - 1)]]
    found = 0.0
    for low in (order < middle, order <= middle):  # runs of one condition are not divided
        share = float(pieces.weight[low].sum()) / max(total, 1e-300)
        if LEAST_HALF < share < 1.0 - LEAST_HALF:
            both = 2.0 * share * (1.0 - share)
            moved = float(pieces.pull[low].sum()) / both
            chance = CHANCE_STDS**2 * total / (2.0 * both)
            found = max(found, math.sqrt(max(moved**2 - chance, 0.0)))
    return found


def _pieces(fit: Fit, gradient: Array) -> _Pieces:
    matrix, slope, solutions = normal_equations(fit.jacobian, fit.residuals)
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    inverse = np.linalg.pinv(matrix / np.outer(size, size), rcond=1e-12, hermitian=True) / np.outer(
        size, size
    )
    direction, step = inverse @ gradient, inverse @ slope  # the step is what the fit had still to go
    rows: list[tuple[float, ...]] = []
    for index, (run, (common, release), residual, solution) in enumerate(
        zip(fit.problem.data.runs, fit.jacobian, fit.residuals, solutions, strict=True)
    ):
        left = common - release @ solution[:, :-1]
        influence = left @ direction
        pull = influence * (residual - left @ step - release @ solution[:, -1])
        motion = np.abs(run.reading - np.mean(run.reading))
        starts = _starts(run.reading.size, resonance(fit, index) * run.interval)
        columns: Sequence[Array] = (
            np.add.reduceat(pull, starts),
            np.add.reduceat(influence**2, starts),
            np.maximum.reduceat(motion, starts),
            starts / run.reading.size,
        )
        rows += [(*row, run.wind_speed, run.spring_stiffness or 0.0) for row in zip(*columns, strict=True)]
    pull, weight, *orders = np.array(rows, np.float64).T
    return _Pieces(pull, weight, tuple(orders))


def _starts(count: int, cycles: float) -> NDArray[np.int64]:
    """First block of every whole cycle of a run of ``count`` blocks with ``cycles`` cycles to a block."""
    pieces = min(max(int(count * cycles), 1), count)
    return np.arange(pieces, dtype=np.int64) * count // pieces
