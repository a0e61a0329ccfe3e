"""What to simulate: the plan of a campaign and its runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi

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
        id: unique in the campaign; made of spring, speed, angle and repeat.
        spring_stiffness: Kr, N m/rad.
        wind_speed: V, m/s; 0 is wind-off.
        air_density: ρ, kg/m³.
        release_angle: rad, nose-right positive.
        duration: of the record, s.
    """

    id: str
    spring_stiffness: float
    wind_speed: float
    air_density: float
    release_angle: float
    duration: float


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
