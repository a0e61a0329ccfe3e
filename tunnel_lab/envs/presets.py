"""The two presets of ``Campaign-v0``: available conditions, and the noise of the sensor."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from math import isfinite
from types import MappingProxyType
from typing import Any

from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import SensorModel


@dataclass(frozen=True)
class Preset:
    """Default values of the arguments.

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


def _load() -> dict[str, Preset]:
    text = (resources.files("tunnel_lab") / "data" / "campaign-presets.toml").read_text(encoding="utf-8")
    return {name: _preset(values) for name, values in tomllib.loads(text).items()}


def _preset(values: Mapping[str, Any]) -> Preset:
    severities = {name: (low, high) for name, (low, high) in values.get("severities", {}).items()}
    plain = {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
    return Preset(**(plain | {"severities": MappingProxyType(severities)}))


PRESETS = _load()


def preset_sensor(preset: Preset, noise_std: float | None, sample_rate: float | None) -> SensorModel:
    """The preset's sensor with the given values; its reading is not quantised.

    Args:
        preset: one of `PRESETS`.
        noise_std: rad; None takes the preset's.
        sample_rate: Hz; None takes the preset's.

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
