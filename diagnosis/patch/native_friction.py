"""Friction of any form in MuJoCo: its own elements as far as they apply, and the plugin for the rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.model.fact import Fact
from diagnosis.patch.native_moments import NativeMoments, by_plugin, nearest_polynomial
from tunnel_sim.effects.friction_laws import AGAINST_RATE, friction_of
from tunnel_sim.physics.expression import parse
from tunnel_sim.physics.moment_law import WEIGHTS
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import JointLaw

_AGAINST_RATE = "friction's dependence on the rate"
_AGAINST_LOAD = "friction's dependence on gravity's moment"
_LOAD = "-sign(r)*mu*abs(K*sin(b-k))"
_FACTORS = {  # on the friction, by the term of the moment law
    "friction_exponent": "(abs(r)/2)^n",
    "friction_saturation": "tanh(abs(r)/v0)",
    "friction_peak": "(1+b*exp(-(r/vs)^2))",
}
_SYMBOLS = {"n": "exponent", "v0": "saturation", "b": "peak", "vs": "peak_rate"}


@dataclass(frozen=True)
class Carried:
    """The load that a joint carries: means over the distance travelled in the runs.

    Args:
        whole: the greater of gravity's moment and an actuator's, N m.
        beyond: its excess over gravity's, N m.
    """

    whole: float = 0.0
    beyond: float = 0.0

    @classmethod
    def over(cls, parameters: Mapping[str, float], runs: Sequence[tuple[Array, Array]]) -> Carried:
        """The load of friction in some runs.

        Args:
            parameters: of the moment law, by name.
            runs: angle from rest, rad, and moment of an actuator, N m, each of shape (n,).
        """
        size, rest = _weight(parameters)
        gravity, driven, travel = [], [], []
        for angle, moment in runs:
            gravity.append(np.abs(size * np.sin(angle - rest)))
            driven.append(np.abs(moment))
            travel.append(np.abs(np.gradient(angle)))
        weight, share = np.concatenate(gravity), np.concatenate(travel)
        whole = np.maximum(weight, np.concatenate(driven))
        share /= max(float(share.sum()), 1e-300)
        return cls(float(share @ whole), float(share @ (whole - weight)))


def _weight(parameters: Mapping[str, float]) -> tuple[float, float]:
    """Gravity's moments as one: the greatest moment, N m, and the angle of its rest, rad."""
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

    Presliding friction is that of a ``dcmotor`` without a control (``lugre``), which is Dahl's where it has no
    damping of its own. Friction that depends on the rate becomes ``frictionloss`` and the joint's polynomial
    damping where their error is within the allowance. Else ``frictionloss`` is the friction at rest, and the plugin
    adds the rest, which is zero there. Friction that grows with gravity's moment needs the plugin too. An
    actuator's moment is not known to it: the mean of its part is added to the friction.

    Args:
        parameters: of the moment law, by name.
        rates: positive rates in the runs, rad/s, shape (n,).
        law: of the joint as the model has it.
        damping: to be written in addition to that of the joint, N m s/rad.
        may_miss: greatest error of a polynomial, as a share of the greatest friction; infinite: no plugin.
        carried: in the runs, by friction that depends on the load.
    """
    friction = friction_of(parameters)
    if friction.load:
        return _with_load(parameters, rates, law, damping, may_miss, carried)
    moment, terms = friction.friction_moment, [term for term in AGAINST_RATE if parameters.get(term, 0.0)]
    if moment == 0.0 or not terms:
        return NativeMoments(loss=moment, presliding=friction.presliding)
    if law.slide:
        return NativeMoments(loss=moment, differences=(Fact("friction against rate"),))
    wanted = friction.sliding(rates)
    powers = np.vander(rates / rates[-1], 4, increasing=True)
    least = np.array([0.0, -(law.damping + damping) * rates[-1], -np.inf, -np.inf])
    free = np.full(4, -np.inf)
    found = nearest_polynomial(powers, wanted, least if may_miss == np.inf else free)
    missed = float(np.max(np.abs(powers @ found - wanted)) / np.max(wanted))
    found = found / rates[-1] ** np.arange(4)
    if missed < may_miss and (
        may_miss == np.inf or (found[0] >= 0.0 and law.damping + damping + found[1] >= 0.0)
    ):
        figures = {"moment": _AGAINST_RATE, "missed_percent": 100.0 * missed}
        said = (Fact("polynomial", figures),)
        return NativeMoments(damping=found[1:], loss=float(found[0]), differences=said)
    values = {"F": moment, "F0": friction.at_rest} | {
        symbol: getattr(friction, name) for symbol, name in _SYMBOLS.items()
    }
    text = f"-sign(r)*(F*{'*'.join(_FACTORS[term] for term in terms)}-F0)"
    program = parse(text, frozenset({"r", *values})).program(values, {"r": "rate"})
    return NativeMoments(loss=friction.at_rest, program=program, differences=(by_plugin(_AGAINST_RATE),))


def _with_load(
    parameters: Mapping[str, float],
    rates: Array,
    law: JointLaw,
    damping: float,
    may_miss: float,
    carried: Carried,
) -> NativeMoments:
    """Friction that grows with the load; arguments of `native_friction`.

    A sliding contact: the plugin adds the part of gravity's moment to ``frictionloss``. At rest that part does not
    hold the joint, since gravity exceeds it, and ``frictionloss`` holds what remains. A contact that deflects is
    the plugin's own, with the whole friction. The part that the plugin cannot have is added as its mean.
    """
    share, (size, rest) = parameters["friction_load"], _weight(parameters)

    def beside(mean: float) -> NativeMoments:
        moment = parameters.get("friction_moment", 0.0) + share * mean
        plain = {**parameters, "friction_load": 0.0, "friction_moment": moment}
        return native_friction(plain, rates, law, damping, may_miss)

    found = beside(carried.beyond)
    if law.slide or may_miss == np.inf or found.program or not size:
        found = beside(carried.whole)
        return replace(found, differences=(*found.differences, Fact("friction against load")))
    said = [by_plugin(_AGAINST_LOAD)]
    if carried.beyond:
        said.append(Fact("friction against load"))
    differences = (*found.differences, *said)
    if found.presliding:
        contact = (
            ("friction_moment", found.loss, "N m"),
            ("presliding", found.presliding, "rad"),
            ("friction_load", share, "1"),
            ("load_stiffness", size, "N m"),
            ("load_angle", rest, "rad"),
        )
        return NativeMoments(contact=contact, differences=differences)
    values = {"mu": share, "K": size, "k": rest}
    program = parse(_LOAD, frozenset({"r", "b", *values})).program(values, {"r": "rate", "b": "angle"})
    return replace(found, program=program, differences=differences)
