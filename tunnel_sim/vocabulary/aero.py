"""Aerodynamic derivatives, and the stiffness and damping that follow from them.

Sign convention: yaw angle β and yaw rate r = β̇ have the same positive direction about the rod's axis; the
aerodynamic moment is N = Ka β + Ca r on the right-hand side of Izz β̈ + Cr β̇ + Kr β = N. A positive Cnβ lowers
the frequency; a negative Cnr adds damping. A is the frontal area and l the model's length.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AeroDerivatives:
    """Yaw-moment derivatives.

    Args:
        cn_beta: Cnβ = ∂Cn/∂β, 1/rad.
        cn_r: Cnr = ∂Cn/∂(r l/V), 1/rad.
    """

    cn_beta: float
    cn_r: float


def aerodynamic_stiffness(
    cn_beta: float, *, air_density: float, wind_speed: float, frontal_area: float, reference_length: float
) -> float:
    """Ka = ½ρV²·A·l·Cnβ (paper, eq. 4).

    Args:
        cn_beta: Cnβ, 1/rad.
        air_density: ρ, kg/m³.
        wind_speed: V, m/s.
        frontal_area: A, m².
        reference_length: l, m.

    Returns:
        Ka, N m/rad.
    """
    return 0.5 * air_density * wind_speed**2 * frontal_area * reference_length * cn_beta


def aerodynamic_damping(
    cn_r: float, *, air_density: float, wind_speed: float, frontal_area: float, reference_length: float
) -> float:
    """Ca = ½ρV·A·l²·Cnr (paper, eq. 5).

    Args:
        cn_r: Cnr, 1/rad.
        air_density: ρ, kg/m³.
        wind_speed: V, m/s.
        frontal_area: A, m².
        reference_length: l, m.

    Returns:
        Ca, N m s/rad.
    """
    return 0.5 * air_density * wind_speed * frontal_area * reference_length**2 * cn_r
