"""The two presets of ``Campaign-v0``: what is at hand, and how noisy the sensor is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from types import MappingProxyType

from tunnel_sim.errors import TunnelError
from tunnel_sim.plan import SensorModel


@dataclass(frozen=True)
class Preset:
    """Values for arguments that are left out.

    Args:
        springs: numbers of the rig's table.
        wind_speeds: m/s.
        release_angles_deg: degrees.
        durations: s.
        noise_std: rad.
        sample_rate: Hz.
        max_runs: number of runs after which an episode is truncated.
        severities: the vocabulary: each effect with the range its severity is drawn from, in its unit; empty:
            none.
    """

    springs: tuple[int, ...]
    wind_speeds: tuple[float, ...]
    release_angles_deg: tuple[float, ...]
    durations: tuple[float, ...]
    noise_std: float
    sample_rate: float
    max_runs: int
    severities: Mapping[str, tuple[float, float]] = field(default_factory=lambda: MappingProxyType({}))


PRESETS = {
    # The noise is a hundred times the paper rig's at a tenth of its rate: with the paper's own, any two runs that
    # separate the coefficients reach the targets, and there is nothing to choose.
    "identification": Preset(
        springs=(3, 5, 6, 8),
        wind_speeds=(0.0, 10.0, 15.0, 20.0),
        release_angles_deg=(2.5, 5.0, 10.0),
        durations=(5.0, 10.0, 20.0),
        noise_std=0.05,
        sample_rate=100.0,
        max_runs=24,
    ),
    # Two causes that change the damping with the amplitude and two that change the frequency, one of each
    # mechanical and one aerodynamic, about as severe as those that explain the paper's Table III.
    "diagnosis": Preset(
        springs=(5, 8),
        wind_speeds=(0.0, 10.0, 20.0),
        release_angles_deg=(10.0, 20.0),
        durations=(5.0, 10.0),
        noise_std=0.01,
        sample_rate=100.0,
        max_runs=12,
        severities=MappingProxyType(
            {
                "quadratic_damping": (0.003, 0.006),
                "nonlinear_yaw_damping": (60.0, 120.0),
                "cubic_stiffness": (0.2, 0.4),
                "nonlinear_yaw_moment": (4.0, 8.0),
            }
        ),
    ),
}


def preset_sensor(preset: Preset, noise_std: float | None, sample_rate: float | None) -> SensorModel:
    """The preset's sensor with what is given in place of its numbers; its reading is continuous.

    Args:
        preset: one of `PRESETS`.
        noise_std: rad; None takes the preset's.
        sample_rate: Hz; likewise.

    Raises:
        TunnelError: when a number is not positive, or the rate does not divide the rig's 1000 steps per second.
    """
    noise = preset.noise_std if noise_std is None else noise_std
    rate = preset.sample_rate if sample_rate is None else sample_rate
    for name, value, unit in (("noise_std", noise, "rad"), ("sample_rate", rate, "Hz")):
        if isinstance(value, bool) or not (isfinite(value) and value > 0.0):
            raise TunnelError(
                f"{name} = {value!r} must be above 0", where="Campaign-v0", remedy=f"give it in {unit}"
            )
    if rate > 1000.0 or abs(1000.0 / rate - round(1000.0 / rate)) > 1e-9:
        raise TunnelError(
            f"sample_rate = {rate:g} Hz does not divide the rig's 1000 steps per second",
            where="Campaign-v0",
            remedy="give 1000, 500, 250, 200, 125, 100 Hz or another divisor of 1000 Hz",
        )
    return SensorModel(sample_rate=float(rate), noise_std=float(noise), resolution=0.0)
