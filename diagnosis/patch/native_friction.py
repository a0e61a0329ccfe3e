"""Friction of any form in MuJoCo: its own element as far as it applies, and the plugin for the rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from diagnosis.model.fact import Fact
from tunnel_sim.effects.friction_laws import AGAINST_RATE, friction_of
from tunnel_sim.physics.expression import parse
from tunnel_sim.physics.moment_law import WEIGHTS
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import JointLaw

_AGAINST_RATE = "friction's dependence on the rate"
_AGAINST_LOAD = "friction's dependence on gravity's moment"
_LOAD = "-sign(r)*mu*abs(K*sin(b-k)+L*sin(b-l))"
_FACTORS = {  # on the friction, by the term of the moment law
    "friction_exponent": "(abs(r)/2)^n",
    "friction_saturation": "tanh(abs(r)/v0)",
    "friction_peak": "(1+b*exp(-(r/vs)^2))",
}
_SYMBOLS = {"n": "exponent", "v0": "saturation", "b": "peak", "vs": "peak_rate"}


@dataclass(frozen=True, eq=False)
class NativeFriction:
    """Friction as written into a model, in the units of the law.

    Args:
        loss: ``frictionloss`` of the joint, N m.
        damping: added coefficients of ḃ, |ḃ|ḃ and ḃ³, N m s/rad, N m s²/rad² and N m s³/rad³, shape (3,).
        program: of a further moment of the plugin; empty: none.
        contact: numerics of the plugin's own friction, with their values and units; empty: none.
        differences: where the native element follows another law, and causes left out.
    """

    loss: float = 0.0
    damping: Array = field(default_factory=lambda: np.zeros(3))
    program: tuple[float, ...] = ()
    contact: tuple[tuple[str, float, str], ...] = ()
    differences: tuple[Fact, ...] = ()


def nearest_polynomial(powers: Array, wanted: Array, least: Array) -> Array:
    """Coefficients of least squares with lower bounds; without them where they are met.

    Args:
        powers: shape (n, m).
        wanted: shape (n,).
        least: shape (m,), infinite where there is none.
    """
    sizes = np.max(np.abs(powers), axis=0)
    found: Array = np.linalg.lstsq(powers / sizes, wanted, rcond=1e-12)[0] / sizes
    if np.all(found >= least):
        return found
    from scipy.optimize import lsq_linear  # only here: the bounds seldom matter

    bounded: Array = lsq_linear(powers / sizes, wanted, (least * sizes, np.inf)).x / sizes
    return bounded


def native_friction(
    parameters: Mapping[str, float], rates: Array, law: JointLaw, damping: float, may_miss: float
) -> NativeFriction:
    """The friction of a moment law in the elements of MuJoCo.

    Friction that depends on the rate becomes ``frictionloss`` and the joint's polynomial damping where their error
    is within the allowance. Else ``frictionloss`` is the friction at rest, and the plugin
    adds the rest, which is zero there. The plugin has its own presliding contact.

    Args:
        parameters: of the moment law, by name.
        rates: positive rates in the runs, rad/s, shape (n,).
        law: of the joint as the model has it.
        damping: to be written in addition to that of the joint, N m s/rad.
        may_miss: greatest error of a polynomial, as a share of the greatest friction; infinite: no plugin.
    """
    friction = friction_of(parameters)
    if friction.load and may_miss == np.inf:
        plain = native_friction({**parameters, "friction_load": 0.0}, rates, law, damping, may_miss)
        return replace(plain, differences=(*plain.differences, Fact("friction against load")))
    if friction.load:
        rest = {name: value for name, value in parameters.items() if name != "friction_load"}
        return _with_load(parameters, native_friction(rest, rates, law, damping, may_miss), law)
    moment, terms = friction.friction_moment, [term for term in AGAINST_RATE if parameters.get(term, 0.0)]
    if moment == 0.0 or not (terms or friction.presliding):
        return NativeFriction(moment)
    if law.slide:
        left_out = "friction against rate" if terms else "presliding"
        return NativeFriction(moment, differences=(Fact(left_out),))
    if not terms and may_miss == np.inf:
        return NativeFriction(moment)
    if not terms:
        contact = (("friction_moment", moment, "N m"), ("presliding", friction.presliding, "rad"))
        return NativeFriction(contact=contact, differences=(_by_plugin("friction's presliding"),))
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
        return NativeFriction(float(found[0]), found[1:], differences=(Fact("polynomial", figures),))
    values = {"F": moment, "F0": friction.at_rest} | {
        symbol: getattr(friction, name) for symbol, name in _SYMBOLS.items()
    }
    text = f"-sign(r)*(F*{'*'.join(_FACTORS[term] for term in terms)}-F0)"
    program = parse(text, frozenset({"r", *values})).program(values, {"r": "rate"})
    return NativeFriction(friction.at_rest, program=program, differences=(_by_plugin(_AGAINST_RATE),))


def _with_load(parameters: Mapping[str, float], plain: NativeFriction, law: JointLaw) -> NativeFriction:
    """Friction with the part that grows with gravity's moment, which the plugin adds.

    At rest that part does not hold the joint: gravity exceeds it, and ``frictionloss`` holds what remains. A part
    that grows with an actuator's moment is left out.
    """
    names = [name for weight in WEIGHTS for name in weight]
    values = {symbol: parameters.get(name, 0.0) for symbol, name in zip("KkLl", names, strict=True)}
    if law.slide or plain.program or plain.contact or not (values["K"] or values["L"]):
        return replace(plain, differences=(*plain.differences, Fact("friction against load")))
    values["mu"] = parameters["friction_load"]
    program = parse(_LOAD, frozenset({"r", "b", *values})).program(values, {"r": "rate", "b": "angle"})
    found = [_by_plugin(_AGAINST_LOAD)]
    if law.actuator is not None:
        found.append(Fact("friction against load"))
    return replace(plain, program=program, differences=(*plain.differences, *found))


def _by_plugin(moment: str) -> Fact:
    return Fact("no native element", {"moment": moment})
