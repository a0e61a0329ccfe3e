"""The conditions that an operator can choose for a run, its cost in rig time, and the presets of both."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from itertools import product
from math import degrees, radians

import numpy as np

from tunnel_sim.vocabulary.arguments import COUNT, EnvError, Number, checked_numbers
from tunnel_sim.vocabulary.plan import Condition, SensorModel
from tunnel_sim.vocabulary.rig import Rig

WHERE = "Campaign-v0"
"""How errors name the environment."""


def refusal(what: str, remedy: str) -> EnvError:
    """The error of an argument or an action of the environment."""
    return EnvError(what, where=WHERE, remedy=remedy)


@dataclass(frozen=True)
class RunChoice:
    """The conditions of one run.

    Args:
        spring: number of the spring in the rig's table.
        spring_stiffness: stiffness Kr of the spring, N m/rad.
        wind_speed: V, m/s; 0 is wind-off.
        release_angle: release angle, rad.
        duration: duration of the record, s.
    """

    spring: int
    spring_stiffness: float
    wind_speed: float
    release_angle: float
    duration: float

    @property
    def words(self) -> str:
        """The run in words, such as ``spring 3, 10 m/s, 10°, 20 s``."""
        wind = f"{self.wind_speed:g} m/s" if self.wind_speed > 0.0 else "wind off"
        return f"spring {self.spring}, {wind}, {degrees(self.release_angle):.3g}°, {self.duration:g} s"

    def condition(self, name: str, air_density: float) -> Condition:
        """The run in the form of a plan.

        Args:
            air_density: ρ, kg/m³.
        """
        return Condition(
            name, self.spring_stiffness, self.wind_speed, air_density, self.release_angle, self.duration
        )


@dataclass(frozen=True)
class Menu:
    """The choices; an action is one index into each.

    Args:
        springs: (number, Kr in N m/rad) of the available springs.
        wind_speeds: wind speeds, m/s.
        release_angles: release angles, rad.
        durations: durations, s.
    """

    springs: tuple[tuple[int, float], ...]
    wind_speeds: tuple[float, ...]
    release_angles: tuple[float, ...]
    durations: tuple[float, ...]

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Number of springs, speeds, angles and durations."""
        return len(self.springs), len(self.wind_speeds), len(self.release_angles), len(self.durations)

    def choice(self, action: Iterable[int]) -> RunChoice:
        """The run of an action: indices of spring, speed, angle and duration.

        Raises:
            TunnelError: when the action is not four indices within the menu.
        """
        remedy = f"give four whole numbers from 0 to below {', '.join(map(str, self.shape))}"
        numbers = np.asarray(action)
        if numbers.shape != (4,) or not np.issubdtype(numbers.dtype, np.integer):
            raise refusal(f"{action!r} is not an action", remedy)
        if np.any(numbers < 0) or np.any(numbers >= self.shape):
            raise refusal(f"action {numbers.tolist()} is outside the menu", remedy)
        spring, speed, angle, duration = numbers.tolist()
        number, stiffness = self.springs[spring]
        return RunChoice(
            number, stiffness, self.wind_speeds[speed], self.release_angles[angle], self.durations[duration]
        )

    def actions(self) -> Iterator[tuple[int, int, int, int]]:
        """Every action, durations fastest, springs slowest."""
        springs, speeds, angles, durations = self.shape
        return product(range(springs), range(speeds), range(angles), range(durations))


def make_menu(
    rig: Rig,
    springs: Sequence[int],
    wind_speeds: Sequence[float],
    release_angles_deg: Sequence[float],
    durations: Sequence[float],
) -> Menu:
    """Check and convert the arguments of an environment: springs by number, m/s, degrees and s.

    Raises:
        TunnelError: when a list is empty, repeats a value, or has a value that the rig does not allow.
    """
    numbers = [int(number) for number in checked_numbers(springs, "springs", WHERE, COUNT)]
    for number in numbers:
        if number not in rig.springs:
            remedy = f"use one of {', '.join(map(str, rig.springs))}"
            raise refusal(f"springs: there is no spring {number}", remedy)
    angles = checked_numbers(
        release_angles_deg, "release_angles_deg", WHERE, Number(above=True, unit="degrees")
    )
    return Menu(
        tuple((number, rig.spring(number)) for number in numbers),
        checked_numbers(wind_speeds, "wind_speeds", WHERE, Number(unit="m/s")),
        tuple(map(radians, angles)),
        checked_numbers(durations, "durations", WHERE, Number(above=True, unit="s")),
    )


@dataclass(frozen=True)
class Costs:
    """Rig time of a run, s; its parts are assumed, not measured.

    Args:
        setup: time to bring the model to rest, zero the sensor and release the model, s.
        spring_change: time to open the section and change the spring, s.
        speed_change: time until the wind has settled at another speed, s.
    """

    setup: float = 60.0
    spring_change: float = 300.0
    speed_change: float = 60.0

    def __post_init__(self) -> None:
        """Refuse values that are not times."""
        for name, value in vars(self).items():
            Number(unit="s").checked(value, f"costs: {name}", WHERE)

    def of(self, choice: RunChoice, last: RunChoice | None) -> float:
        """Rig time of a run after another, s; the first run (None) needs a change of spring and speed."""
        spring = last is None or choice.spring != last.spring
        speed = last is None or choice.wind_speed != last.wind_speed
        return self.setup + choice.duration + spring * self.spring_change + speed * self.speed_change


@dataclass(frozen=True)
class Preset:
    """Default values of the arguments of `CampaignEnv`.

    Args:
        wind_speeds: wind speeds, m/s.
        durations: durations, s.
        noise_std: noise of the sensor, rad.
        sample_rate: sample rate, Hz.
    """

    springs: Sequence[int]
    wind_speeds: Sequence[float]
    release_angles_deg: Sequence[float]
    durations: Sequence[float]
    noise_std: float
    sample_rate: float
    max_runs: int
    severities: Mapping[str, Sequence[float]] = field(default_factory=dict)


_FILE = resources.files("tunnel_lab") / "data" / "campaign-presets.toml"
PRESETS = {name: Preset(**table) for name, table in tomllib.loads(_FILE.read_text("utf-8")).items()}


def preset_sensor(preset: Preset, noise_std: float | None, sample_rate: float | None) -> SensorModel:
    """The preset's sensor with the given values, without quantisation; None takes the preset's value.

    Args:
        noise_std: noise of the sensor, rad.
        sample_rate: sample rate, Hz.

    Raises:
        TunnelError: when a number is not positive, or the rate does not divide the rig's 1000 steps per second.
    """
    noise = preset.noise_std if noise_std is None else noise_std
    rate = preset.sample_rate if sample_rate is None else sample_rate
    noise = Number(above=True, unit="rad").checked(noise, "noise_std", WHERE)
    rate = Number(above=True, unit="Hz").checked(rate, "sample_rate", WHERE)
    if rate > 1000.0 or abs(1000.0 / rate - round(1000.0 / rate)) > 1e-9:
        what = f"sample_rate = {rate:g} Hz does not divide the rig's 1000 steps per second"
        raise refusal(what, "give 1000, 500, 250, 200, 125, 100 Hz or another divisor of 1000 Hz")
    return SensorModel(sample_rate=rate, noise_std=noise, resolution=0.0)
