"""Campaigns of the nominal model in closed form, written without the package's own numerics."""

from dataclasses import dataclass, replace

import numpy as np

from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

AREA, LENGTH, DENSITY = 0.036, 0.625, 1.204
RESOLUTION = 2.0 * np.pi / 3.0 / 4096.0


@dataclass(frozen=True)
class Truth:
    cn_beta: float = 0.49
    cn_r: float = -0.11
    yaw_inertia: float = 0.1014
    mechanical_damping: float = 0.012


@dataclass(frozen=True)
class Setting:
    spring: float | None
    speed: float
    release: float = 0.35
    rate: float = 0.0


# Two springs, wind-off and two speeds.
SIX = tuple(Setting(spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 15.0, 25.0))
# Three springs, wind-off and two speeds, and three more of other releases: twelve runs.
TWELVE = (
    *(Setting(spring, speed) for spring in (16.12, 21.02, 44.84) for speed in (0.0, 12.0, 24.0)),
    Setting(16.12, 0.0, 0.14),
    Setting(16.12, 24.0, 0.14, 0.3),
    Setting(21.02, 18.0, 0.24),
)


def damped_cosine(time, damping, stiffness, angle, rate):
    """Textbook underdamped response; damping and stiffness per unit inertia."""
    sigma = damping / 2.0
    omega = np.sqrt(stiffness - sigma**2)
    quadrature = (rate + sigma * angle) / omega
    return np.exp(-sigma * time) * (angle * np.cos(omega * time) + quadrature * np.sin(omega * time))


def angle_of(setting, truth, time):
    spring = 16.12 if setting.spring is None else setting.spring
    pressure = 0.5 * DENSITY * setting.speed**2 * AREA * LENGTH
    per_speed = 0.5 * DENSITY * setting.speed * AREA * LENGTH**2
    stiffness = (spring - pressure * truth.cn_beta) / truth.yaw_inertia
    damping = (truth.mechanical_damping - per_speed * truth.cn_r) / truth.yaw_inertia
    return damped_cosine(time, damping, stiffness, setting.release, setting.rate)


def campaign(
    settings=TWELVE,
    *,
    truth=None,
    noise=0.0,
    stated_noise="as is",
    resolution=None,
    zero=0.004,
    duration=10.0,
    rate=1000.0,
    rng=None,
    nominal_inertia=None,
    has_size=True,
    jitter=0.0,
):
    """Records of the nominal model; noise is white and Gaussian, resolution quantises, jitter delays samples.

    Args:
        jitter: greatest delay of a sample, a share of the interval.
    """
    truth = truth or Truth()
    even = np.arange(round(duration * rate)) / rate
    runs = []
    for number, setting in enumerate(settings, 1):
        time = even + jitter / rate * rng.uniform(size=even.size) if jitter else even
        yaw = angle_of(setting, truth, time) + zero
        if noise:
            yaw = yaw + noise * rng.standard_normal(time.size)
        if resolution:
            yaw = resolution * np.round(yaw / resolution)
        runs.append(
            Run(f"r{number:02d}", Record(time, yaw), setting.speed, setting.spring, DENSITY, setting.release)
        )
    size = {"frontal_area": AREA, "reference_length": LENGTH} if has_size else {}
    stated = noise if stated_noise == "as is" else stated_noise
    return Campaign(
        "synthetic",
        RigProperties(yaw_inertia=nominal_inertia, **size),
        SensorProperties(rate, resolution, stated),
        tuple(runs),
    )


def with_records(original, change):
    """The campaign with every reading passed through ``change(time, yaw)``."""
    runs = tuple(
        replace(
            run, record=Record(run.record.time_s, change(run.record.time_s, np.array(run.record.yaw_rad)))
        )
        for run in original.runs
    )
    return replace(original, runs=runs)
