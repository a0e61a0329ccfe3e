"""The coefficients as functions of a fit's parameters: Cnβ and Cnr, or ωn and ζ of small swings."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from diagnosis.fitting.problem import Problem
from tunnel_sim.effects import ALL_EFFECTS
from tunnel_sim.vocabulary.record import Array

#: Parameters of a joint's law, by name in a fit, and their units.
JOINT_UNITS = {
    "yaw_inertia": "kg m2",
    "mechanical_damping": "N m s/rad",
    "added_stiffness": "N m/rad",
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
        damping and stiffness of a joint in a model of one's own.
    """
    if problem.data.normalised:
        return "omega_n", "zeta"
    own = () if problem.data.law is None else JOINT_UNITS
    return *(name for name in own if name in problem.names), "cn_beta", "cn_r"


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
