"""The rig: its body, its reference sizes; the joint of a user's model: its law, and a changed attribute."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import atan2, cos, hypot, inf, pi, radians, sin, tan

import numpy as np

from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

#: Properties of a joint's law that may be fitted, and the name of the parameter in a fit.
FREE_PARAMETERS: Mapping[str, str] = {
    "inertia": "yaw_inertia",
    "damping": "mechanical_damping",
    "stiffness": "added_stiffness",
    "rest": "zero",
    "gain": "servo_kp",
}


@dataclass(frozen=True)
class Term:
    """A part of the moment beyond a linear spring and damper: minus the coefficient times the expression.

    Args:
        coefficient: coefficient, in the unit.
        unit: unit with which the product is in N m.
    """

    expression: str
    coefficient: float
    unit: str


@dataclass(frozen=True)
class Actuator:
    """An actuator of a joint with a moment proportional to its control.

    Args:
        name: name in the model, or its number.
        index: index among the model's actuators.
        gain: N m per unit of the control.
        control: least and greatest unclipped control.
        moment: least and greatest unclipped moment, N m.
        servo: moment without control at position 0, N m, and per position, N m/rad; part of the joint's law.
    """

    name: str
    index: int
    gain: float
    control: tuple[float, float] = (-inf, inf)
    moment: tuple[float, float] = (-inf, inf)
    servo: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class JointLaw:
    """The equation of motion about the joint's stable rest position.

    The joint obeys I b̈ + C ḃ + K b + Σ terms + friction = 0. For a slide, metres replace radians, N replaces N
    m and kg for kg m².

    Args:
        inertia: I, kg m².
        stiffness: K, slope of the whole restoring moment at rest, N m/rad; 0: without any restraint.
        damping: C, N m s/rad.
        friction: moment of dry friction, N m.
        rest: the joint's position at rest, rad; without any restraint, the middle of its records.
        free: which of `FREE_PARAMETERS` are fitted, the ``gain`` kp of a position servo among them; without any
            restraint, ``rest`` is a constant moment.
        actuator: actuator with the control that drives the runs; None: no control drives any run.
        step: time step of the model, s.
        lead: time by which the motion leads its input in first-order integrators, s.
    """

    inertia: float
    stiffness: float
    damping: float = 0.0
    friction: float = 0.0
    rest: float = 0.0
    terms: tuple[Term, ...] = ()
    free: tuple[str, ...] = ("inertia", "damping", "rest")
    slide: bool = False
    actuator: Actuator | None = None
    step: float = 0.0
    lead: float = 0.0

    @property
    def hangs(self) -> bool:
        """Whether gravity alone restores the joint, so that its angle is inseparable from the sensor's zero."""
        of_angle = {term.expression: term.coefficient for term in self.terms if "r" not in term.expression}
        sine = of_angle.pop("sin(b)-b", 0.0)
        return sine > 0.0 and not of_angle and abs(sine - self.stiffness) <= 1e-6 * sine

    @property
    def weight(self) -> tuple[float, float]:
        """Greatest moment of gravity, N m, and the displacement from rest at which it vanishes, rad."""
        of_angle = {term.expression: term.coefficient for term in self.terms}
        sine, cosine = of_angle.get("sin(b)-b", 0.0), of_angle.get("cos(b)-1", 0.0)
        return hypot(sine, cosine), atan2(-cosine, sine)

    @property
    def held(self) -> dict[str, float]:
        """Value of every fixed parameter, by its name in a fit."""
        known = {"inertia": self.inertia, "damping": self.damping, "stiffness": 0.0, "rest": self.rest}
        found = {FREE_PARAMETERS[name]: value for name, value in known.items() if name not in self.free}
        if self.stiffness == 0.0 and "zero" in found:
            return {**found, "moment_offset": 0.0}
        return found


_SLANT_DROP = 0.4  # height of the slant over the body's: the paper gives its angle, not its length
_NOSE_RADIUS = 0.30  # share of the height, for drawing only
_EDGE_RADIUS = 0.14  # radius of the long edges, share of the height, for drawing only
_STEPS = 8  # facets of a quarter round


def davis_vertices(body: Body) -> Array:
    """Vertices with the body about its middle as their convex hull, shape (n, 3), m: forward, to the left, up."""
    nose, tail = body.length / 2, -body.length / 2
    top, bottom = body.height / 2, -body.height / 2
    drop = _SLANT_DROP * body.height if body.rear_slant_deg > 0 else 0.0
    run = drop / tan(radians(body.rear_slant_deg)) if drop else 0.0
    radius = _NOSE_RADIUS * body.height
    points = [(tail, bottom), (tail, top - drop), (min(tail + run, nose), top)]
    for angle in np.linspace(0.0, pi / 2, _STEPS + 1):  # both front edges are quarter rounds
        points.append((nose - radius * (1 - sin(angle)), top - radius * (1 - cos(angle))))
        points.append((nose - radius / 2 * (1 - sin(angle)), bottom + radius / 2 * (1 - cos(angle))))
    profile = np.array(points)
    radius = _EDGE_RADIUS * body.height
    layers = []
    for angle in np.linspace(0.0, pi / 2, _STEPS + 1):
        # the side profile, shrunk evenly along the quarter round of the long edges
        inward = radius * (1.0 - cos(angle))
        shrunk = profile * (1.0 - 2.0 * inward / np.array([body.length, body.height]))
        offset = body.width / 2 - radius * (1.0 - sin(angle))
        layers += [np.insert(shrunk, 1, side * offset, axis=1) for side in (-1.0, 1.0)]
    # angle 0: full profile at reduced width; angle pi/2: shrunk profile at full width
    return np.concatenate(layers)


@dataclass(frozen=True)
class WrittenAttribute:
    """An attribute of a user's model that a patch changed, in SI units.

    Args:
        name: element and name.
        before: values in the given model, in ``unit``.
        after: values in the patched one, in ``unit``.
    """

    name: str
    before: tuple[float, ...]
    after: tuple[float, ...]
    unit: str


@dataclass(frozen=True)
class WorkingSection:
    """The tunnel's working section.

    Args:
        width, height, length: m; the width is across the flow, the length along it.
    """

    width: float
    height: float
    length: float


@dataclass(frozen=True)
class Body:
    """The car-like body (paper, Table I).

    Args:
        length: reference length l, m.
        width, height, ground_clearance: m.
        rear_slant_deg: angle of the rear slant below the roof, degrees.
        mass: mass of model and oscillating mechanism, kg.
        frontal_area, side_area: A, and the area of the side, m².
    """

    length: float
    width: float
    height: float
    rear_slant_deg: float
    ground_clearance: float
    mass: float
    frontal_area: float
    side_area: float

    def flow(self, air_density: float, wind_speed: float) -> dict[str, float]:
        """The named arguments of `aerodynamic_stiffness` and `aerodynamic_damping`.

        Args:
            air_density: ρ, kg/m³.
            wind_speed: V, m/s.
        """
        sizes = {"frontal_area": self.frontal_area, "reference_length": self.length}
        return {"air_density": air_density, "wind_speed": wind_speed, **sizes}


@dataclass(frozen=True)
class Rod:
    """The support rod.

    Args:
        diameter, length_above_ceiling: m.
    """

    diameter: float
    length_above_ceiling: float


@dataclass(frozen=True)
class Dynamics:
    """The rig's yaw dynamics with the wind off.

    Args:
        yaw_inertia: Izz of model and support, kg m².
        mechanical_damping: Cr, N m s/rad.
    """

    yaw_inertia: float
    mechanical_damping: float
    default_spring: int


@dataclass(frozen=True)
class Air:
    """The air in the tunnel: its density ρ, kg/m³."""

    density: float


@dataclass(frozen=True)
class Potentiometer:
    """The angle sensor on top of the rod.

    Args:
        sample_rate: Hz.
        half_range_deg: half of the converter's range, degrees.
        bits: resolution of the converter, bits.
        noise_std: standard deviation of the noise before quantisation, rad.
    """

    sample_rate: float
    half_range_deg: float
    bits: int
    noise_std: float

    @property
    def resolution(self) -> float:
        """Step of the reading, rad."""
        return 2.0 * radians(self.half_range_deg) / float(2**self.bits)


@dataclass(frozen=True)
class Rig:
    """The whole rig.

    Args:
        springs: torsional stiffness by spring number, N m/rad (paper, Table II).
    """

    working_section: WorkingSection
    body: Body
    rod: Rod
    dynamics: Dynamics
    air: Air
    potentiometer: Potentiometer
    springs: Mapping[int, float]

    def spring(self, number: int) -> float:
        """The stiffness of a numbered spring.

        Args:
            number: spring number, as in Table II.

        Returns:
            Kr, N m/rad.

        Raises:
            TunnelError: when there is no such spring.
        """
        if number not in self.springs:
            known = ", ".join(str(n) for n in self.springs)
            raise TunnelError(f"there is no spring {number}", remedy=f"use one of {known}")
        return self.springs[number]
