"""The configuration of an environment, apart from rendering."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import isfinite, radians
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tunnel_sim.envs.errors import EnvError
from tunnel_sim.envs.information import Prior
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.errors import did_you_mean
from tunnel_sim.vocabulary.plan import POTENTIOMETER_RESOLUTION, SensorModel
from tunnel_sim.vocabulary.rig import Rig

PRESETS = ("operator", "plain")
LEAST_DEVIATION = 1e-6
"""Least standard deviation of a reading, rad: below it the prior is lost in the rounding of the information."""
_MAY_BE_ZERO = frozenset({"noise_std", "resolution", "effect_probability"})


@dataclass(frozen=True)
class FreeDecayConfig:
    """What all episodes of an environment have in common.

    Args:
        preset: ``operator``: the action sets the wind-speed set-point and an applied yaw moment; ``plain``: no
            control during a run.
        duration: of a run, s; a whole number of control periods.
        control_period: s; a whole number of sample intervals.
        sample_rate: of the potentiometer, Hz.
        noise_std: standard deviation of its noise, rad.
        resolution: step of its reading, rad; 0: no quantisation.
        wind_limit: greatest wind speed, m/s.
        wind_time_constant: of the tunnel's first-order response to its set-point, s.
        moment_limit: greatest moment that the operator can apply, N m.
        effect_probability: probability that an episode draws an effect, if its options do not name effects.
        prior: changes to `Prior` by name, in its units.
        expose_truth: whether ``info`` contains the truth.
        rig_file: a rig description; None: the packaged one.
    """

    preset: Literal["plain", "operator"] = "operator"
    duration: float = 10.0
    control_period: float = 0.01
    sample_rate: float = 1000.0
    noise_std: float = 0.0005
    resolution: float = POTENTIOMETER_RESOLUTION
    wind_limit: float = 40.0
    wind_time_constant: float = 2.0
    moment_limit: float = 0.5
    effect_probability: float = 0.0
    prior: Mapping[str, float] = field(default_factory=dict)
    expose_truth: bool = False
    rig_file: str | None = None

    def __post_init__(self) -> None:
        """Check every argument.

        Raises:
            EnvError: when one is out of range, or a duration is not a whole number of the shorter interval.
        """
        if self.preset not in PRESETS:
            raise EnvError(f"unknown preset {self.preset!r}", remedy=did_you_mean(str(self.preset), PRESETS))
        for item in fields(self):
            if item.type == "float":
                _check_number(item.name, getattr(self, item.name))
        if self.effect_probability > 1.0:
            raise EnvError("effect_probability is above 1", remedy="give a probability")
        if self.reading_variance < LEAST_DEVIATION**2:
            raise EnvError(
                f"noise_std and resolution together are below {LEAST_DEVIATION:g} rad",
                remedy="increase one of them: without noise a record holds infinite information",
            )
        _whole("control_period", self.control_period * self.sample_rate, "sample intervals")
        _whole("duration", self.duration / self.control_period, "control periods")
        if self.steps < 2:
            raise EnvError("duration is one control period", remedy="give a longer run")
        Prior.changed(self.prior)

    @property
    def samples_per_step(self) -> int:
        """Potentiometer samples in one control period."""
        return round(self.control_period * self.sample_rate)

    @property
    def steps(self) -> int:
        """Control periods in one run."""
        return round(self.duration / self.control_period)

    @property
    def sample_times(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Sample times of a whole run, s, as in `tunnel_sim.engine.simulate`."""
        return np.arange(self.steps * self.samples_per_step) / self.sample_rate

    @property
    def reading_variance(self) -> float:
        """Variance of one reading, its quantisation included, rad²."""
        return self.noise_std**2 + self.resolution**2 / 12.0

    def sensor(self, zero: float) -> SensorModel:
        """The potentiometer with a given zero, rad."""
        return SensorModel(self.sample_rate, self.noise_std, self.resolution, zero)

    def rig(self) -> Rig:
        """The rig of the description, or the packaged one."""
        return load_rig(Path(self.rig_file) if self.rig_file is not None else None)


def angle_limit(rig: Rig) -> float:
    """The angle at which a run is stopped, rad: the end of the potentiometer's range."""
    return radians(rig.potentiometer.half_range_deg)


def free_decay_config(arguments: Mapping[str, Any]) -> FreeDecayConfig:
    """The configuration of an environment from its keyword arguments.

    Raises:
        EnvError: when a name is unknown or a value out of range.
    """
    known = [item.name for item in fields(FreeDecayConfig)]
    for name in arguments:
        if name not in known:
            raise EnvError(
                f"unknown argument {name!r}", where="FreeDecay-v0", remedy=did_you_mean(name, known)
            )
    return FreeDecayConfig(**arguments)


def _check_number(name: str, value: object) -> None:
    number = isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
    if not number or value < 0.0 or (value == 0.0 and name not in _MAY_BE_ZERO):  # type: ignore[operator]
        least = "0 or more" if name in _MAY_BE_ZERO else "above 0"
        raise EnvError(f"{name} = {value!r} is out of range", remedy=f"give a finite number {least} (SI)")


def _whole(name: str, count: float, of: str) -> None:
    if round(count) < 1 or abs(count - round(count)) > 1e-9 * count:
        raise EnvError(f"{name} is {count:g} {of}", remedy=f"make it a whole number of {of}")
