"""The equation of motion of one joint of a model of one's own, as the diagnosis takes it for its nominal model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

#: What of a joint's law may be fitted, and the name of the parameter in a fit.
FREE_PARAMETERS: Mapping[str, str] = {
    "inertia": "yaw_inertia",
    "damping": "mechanical_damping",
    "stiffness": "added_stiffness",
    "rest": "zero",
}


@dataclass(frozen=True)
class Term:
    """A part of the moment that a linear spring and damper leave out: minus the coefficient times the expression.

    Args:
        expression: of the displacement ``b`` from rest (rad) and its rate ``r`` (rad/s).
        coefficient: in the unit.
        unit: such that the product is in N m.
    """

    expression: str
    coefficient: float
    unit: str


@dataclass(frozen=True)
class JointLaw:
    """The equation of motion about the joint's stable rest position.

    The joint obeys I b̈ + C ḃ + K b + Σ terms + friction = 0. For a slide read metres for radians, N for N m and kg
    for kg m².

    Args:
        inertia: I, kg m².
        stiffness: K, slope of the whole restoring moment at rest, N m/rad.
        damping: C, N m s/rad.
        friction: moment of dry friction, N m.
        rest: the joint's position at rest, rad.
        terms: what the restoring moment and the damping have beside K and C.
        free: which of `FREE_PARAMETERS` are fitted.
        slide: whether the joint slides.
    """

    inertia: float
    stiffness: float
    damping: float = 0.0
    friction: float = 0.0
    rest: float = 0.0
    terms: tuple[Term, ...] = ()
    free: tuple[str, ...] = ("inertia", "damping", "rest")
    slide: bool = False

    @property
    def held(self) -> dict[str, float]:
        """Value of every parameter that is not fitted, by its name in a fit."""
        known = {
            "inertia": self.inertia,
            "damping": self.damping,
            "stiffness": 0.0,
            "rest": self.rest,
        }
        return {FREE_PARAMETERS[name]: value for name, value in known.items() if name not in self.free}
