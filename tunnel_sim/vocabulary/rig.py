"""The rig's dimensions and properties."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians

from tunnel_sim.vocabulary.errors import TunnelError


@dataclass(frozen=True)
class WorkingSection:
    """The tunnel's working section.

    Args:
        width: across the flow, m.
        height: m.
        length: along the flow, m.
    """

    width: float
    height: float
    length: float


@dataclass(frozen=True)
class Body:
    """The car-like body (paper, Table I).

    Args:
        length: reference length l, m.
        width: m.
        height: m.
        rear_slant_deg: angle of the rear slant below the roof, degrees.
        ground_clearance: m.
        mass: of model and oscillating mechanism, kg.
        frontal_area: A, m².
        side_area: m².
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
        diameter: m.
        length_above_ceiling: m.
    """

    diameter: float
    length_above_ceiling: float


@dataclass(frozen=True)
class Dynamics:
    """The rig's yaw dynamics with the wind off.

    Args:
        yaw_inertia: Izz of model and support, kg m².
        mechanical_damping: Cr, N m s/rad.
        default_spring: number of the spring used where none is named.
    """

    yaw_inertia: float
    mechanical_damping: float
    default_spring: int


@dataclass(frozen=True)
class Air:
    """The air in the tunnel.

    Args:
        density: ρ, kg/m³.
    """

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
            number: as in Table II.

        Returns:
            Kr, N m/rad.

        Raises:
            TunnelError: when there is no such spring.
        """
        if number not in self.springs:
            known = ", ".join(str(n) for n in self.springs)
            raise TunnelError(f"there is no spring {number}", remedy=f"use one of {known}")
        return self.springs[number]
