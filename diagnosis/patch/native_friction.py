"""Friction of any form in MuJoCo: its own elements as far as they apply, else the plugin's friction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.model.fact import Fact
from diagnosis.patch.native_moments import NativeMoments, by_plugin, nearest_polynomial
from tunnel_sim.effects.friction_laws import AGAINST_RATE, CONTACT, friction_of
from tunnel_sim.physics.moment_law import WEIGHTS, parameter_units
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import JointLaw

#: The variables of a friction that needs the plugin, in the words of the facts.
ON_RATE = "friction's dependence on the rate"
ON_GRAVITY = "friction's dependence on gravity's moment"
ON_ACTUATOR = "friction's dependence on the actuator's moment"


@dataclass(frozen=True)
class Carried:
    """The load that a joint carries in the runs: gravity's moment or an actuator's, whichever is greater.

    Args:
        mean: mean load over the distance travelled, N m.
        greatest: greatest load, N m.
        by_actuator: whether an actuator's moment exceeds gravity's anywhere.
    """

    mean: float = 0.0
    greatest: float = 0.0
    by_actuator: bool = False

    @classmethod
    def over(cls, parameters: Mapping[str, float], runs: Sequence[tuple[Array, Array]]) -> Carried:
        """The load of friction in some runs.

        Args:
            parameters: of the moment law, by name.
            runs: angle from rest, rad, and moment of an actuator, N m, each of shape (n,).
        """
        size, rest = _weight(parameters)
        angles, moments = ([run[i] for run in runs] for i in (0, 1))
        weight, driven = np.abs(size * np.sin(np.concatenate(angles) - rest)), np.abs(np.concatenate(moments))
        travel = np.concatenate([np.abs(np.gradient(angle)) for angle in angles])
        load, whole = np.maximum(weight, driven), max(float(travel.sum()), 1e-300)
        return cls(float(travel @ load) / whole, float(np.max(load)), bool(np.any(driven > weight)))


def _weight(parameters: Mapping[str, float]) -> tuple[float, float]:
    """The sum of gravity's moments: its greatest value, N m, and the angle of its rest, rad."""
    given = [(parameters.get(size, 0.0), parameters.get(rest, 0.0)) for size, rest in WEIGHTS]
    found = sum(size * np.exp(-1j * rest) for size, rest in given)
    return float(np.abs(found)), -float(np.angle(found))


def native_friction(
    parameters: Mapping[str, float],
    rates: Array,
    law: JointLaw,
    damping: float,
    may_miss: float,
    carried: Carried = Carried(),
) -> NativeMoments:
    """The friction of a moment law in the elements of MuJoCo.

    Presliding friction becomes a ``dcmotor`` without a control (``lugre``), which is Dahl's friction without
    contact damping. Friction that depends on the rate becomes ``frictionloss`` and polynomial damping of the
    joint if their error is within the allowance. All other friction is the plugin's own. Without the plugin,
    friction that depends on the load takes its mean.

    Args:
        parameters: of the moment law, by name.
        rates: positive rates in the runs, rad/s, shape (n,).
        law: law of the joint in the given model.
        damping: damping to be added to the joint's, N m s/rad.
        may_miss: greatest error of a polynomial, as a share of the greatest friction; infinite: no plugin.
        carried: load in the runs, for friction that depends on it.
    """
    friction, said = friction_of(parameters), tuple[Fact, ...]()
    if friction.load and may_miss == np.inf:
        moment = friction.friction_moment + friction.load * carried.mean
        parameters = {**parameters, "friction_load": 0.0, "friction_moment": moment}
        friction, said = friction_of(parameters), (Fact("friction against load"),)
    if friction.load:
        return _by_plugin(parameters, carried)
    moment = friction.friction_moment
    if moment == 0.0 or not any(parameters.get(term, 0.0) for term in AGAINST_RATE):
        return NativeMoments(loss=moment, presliding=friction.presliding, differences=said)
    wanted = friction.sliding(rates)
    powers = np.vander(rates / rates[-1], 4, increasing=True)
    least = np.array([0.0, -(law.damping + damping) * rates[-1], -np.inf, -np.inf])
    free = np.full(4, -np.inf)
    found = nearest_polynomial(powers, wanted, least if may_miss == np.inf else free)
    missed = float(np.max(np.abs(powers @ found - wanted)) / np.max(wanted))
    found = found / rates[-1] ** np.arange(4)
    sound = found[0] >= 0.0 and law.damping + damping + found[1] >= 0.0
    if may_miss != np.inf and not (missed < may_miss and sound):
        return _by_plugin(parameters, carried)
    figures = {"moment": ON_RATE, "missed_percent": 100.0 * missed}
    differences = (*said, Fact("polynomial", figures))
    return NativeMoments(damping=found[1:], loss=float(found[0]), differences=differences)


def _by_plugin(parameters: Mapping[str, float], carried: Carried) -> NativeMoments:
    """Friction that the plugin adds, with its greatest moment in the runs."""
    friction, units, (size, rest) = friction_of(parameters), parameter_units(), _weight(parameters)
    names = [name for name in ("friction_moment", *CONTACT) if parameters.get(name, 0.0)]
    own = tuple((name, parameters[name], units[name]) for name in names if name != "presliding")
    on = [ON_RATE] if any(name in AGAINST_RATE for name in names) else []
    if friction.load:
        own += (("load_stiffness", size, "N m"), ("load_angle", rest, "rad"))
        on.append(ON_ACTUATOR if carried.by_actuator else ON_GRAVITY)
    greatest = (friction.friction_moment + friction.load * carried.greatest) * (1.0 + friction.peak)
    return NativeMoments(
        loss=greatest,
        presliding=friction.presliding,
        contact=own,
        differences=tuple(map(by_plugin, on)),
    )
