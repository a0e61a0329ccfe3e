"""What to simulate: aerodynamic derivatives, the plan of a campaign and its runs.

Sign convention: yaw angle β and yaw
rate r = β̇ have the same positive direction about the rod's axis; the aerodynamic moment is N = Ka β + Ca r on the
right-hand side of Izz β̈ + Cr β̇ + Kr β = N. A positive Cnβ lowers the frequency; a negative Cnr adds damping. A
is the frontal area and l the model's length.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi

from tunnel_sim.vocabulary.drive import Drive


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


DEFAULT_SAMPLE_RATE = 1000.0
"""Default sample rate of the potentiometer, Hz."""

POTENTIOMETER_RESOLUTION = 2.0 * pi / 3.0 / 4096.0
"""Step of a 12-bit converter over ±60°, rad."""


@dataclass(frozen=True)
class Truth:
    """The coefficients that the simulation uses, which the estimators are to recover.

    Args:
        cn_beta: Cnβ, 1/rad.
        cn_r: Cnr, 1/rad.
        yaw_inertia: Izz of model and support, kg m².
        mechanical_damping: Cr, N m s/rad.
    """

    cn_beta: float
    cn_r: float
    yaw_inertia: float
    mechanical_damping: float


@dataclass(frozen=True)
class Condition:
    """One run to simulate.

    Args:
        id: unique in the campaign; made of spring, speed, angle (or amplitude of the drive) and repeat.
        spring_stiffness: Kr, N m/rad.
        wind_speed: V, m/s; 0 is wind-off.
        air_density: ρ, kg/m³.
        release_angle: rad, nose-right positive; of a driven run 0, where it starts at rest.
        duration: of the record, s.
        drive: the input of a driven run at the samples of the sensor; None of a free decay.
    """

    id: str
    spring_stiffness: float
    wind_speed: float
    air_density: float
    release_angle: float
    duration: float
    drive: Drive | None = None


@dataclass(frozen=True)
class SensorModel:
    """The potentiometer: it adds its zero and noise to the angle, then quantises.

    Args:
        sample_rate: Hz.
        noise_std: standard deviation of the noise, rad.
        resolution: step of the reading, rad; 0: no quantisation.
        zero: added to the angle, rad; the same in all runs and unknown to the estimators.
    """

    sample_rate: float = DEFAULT_SAMPLE_RATE
    noise_std: float = 0.0005
    resolution: float = POTENTIOMETER_RESOLUTION
    zero: float = 0.0


@dataclass(frozen=True)
class EffectSetting:
    """One effect to inject, by name; ``tunnel_sim.effects`` validates it.

    Args:
        parameters: its parameters by name, SI units.
    """

    name: str
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class CampaignPlan:
    """Everything a simulated campaign depends on, apart from the rig.

    Args:
        conditions: the runs, at least one, with unique ids.
        effects: effects added to the nominal model.
    """

    name: str
    seed: int
    truth: Truth
    conditions: tuple[Condition, ...]
    sensor: SensorModel = SensorModel()
    effects: tuple[EffectSetting, ...] = ()
    description: str = ""
