"""The conditions of episodes: the configuration of an environment, and its draws."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from math import radians
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tunnel_sim.effects import ALL_EFFECTS, Effect
from tunnel_sim.effects.capabilities import BetweenRuns, Clock
from tunnel_sim.engine.virtual_campaign import plan_effects, run_settings
from tunnel_sim.envs import EnvError, as_env_error, refuse_unknown
from tunnel_sim.envs.information import Prior
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.arguments import Number, checked_choice, checked_names, env_errors
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import (
    POTENTIOMETER_RESOLUTION,
    CampaignPlan,
    Condition,
    EffectSetting,
    SensorModel,
    Truth,
    aerodynamic_stiffness,
)
from tunnel_sim.vocabulary.rig import Rig

PRESETS = ("operator", "plain")
LEAST_DEVIATION = 1e-6
"""Least standard deviation of a reading, rad: below it rounding of the information hides the prior."""
WHERE = "FreeDecay-v0"
"""How errors name the environment."""
_NUMBERS: Mapping[str, Number] = {
    **{name: Number(above=True, unit="s") for name in ("duration", "control_period", "wind_time_constant")},
    "sample_rate": Number(above=True, most=limits.FASTEST_RATE, unit="Hz"),
    "noise_std": Number(unit="rad"),
    "resolution": Number(unit="rad"),
    "wind_limit": Number(above=True, unit="m/s"),
    "moment_limit": Number(above=True, unit="N m"),
    "stop_penalty": Number(unit="nats"),
    "effect_probability": Number(most=1.0),
}


@dataclass(frozen=True)
class FreeDecayConfig:
    """The common properties of all episodes of an environment.

    Args:
        preset: ``operator``: the action sets the wind-speed set-point and an applied yaw moment; ``plain``: no
            control during a run.
        duration: duration of a run, s; a whole number of control periods.
        control_period: control period, s; a whole number of sample intervals.
        sample_rate: sample rate of the potentiometer, Hz.
        noise_std: standard deviation of its noise, rad.
        resolution: step of its reading, rad; 0: no quantisation.
        wind_limit: greatest wind speed, m/s.
        wind_time_constant: time constant of the tunnel's first-order response to its set-point, s.
        moment_limit: greatest moment that the operator can apply, N m.
        effect_probability: probability that an episode draws an effect, if its options do not name effects.
        stop_penalty: penalty for a stopped run, in addition to the loss of its information, nats. The default
            equals a reduction of two standard deviations by a factor of e⁵ together, more than a run usually
            gains by control.
        prior: changes to `Prior` by name, in its units.
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
    stop_penalty: float = 5.0
    prior: Mapping[str, float] = field(default_factory=dict)
    expose_truth: bool = False
    rig_file: str | None = None

    def __post_init__(self) -> None:
        """Refuse an argument out of range, or a duration that is not a whole number of the shorter interval."""
        checked_choice(self.preset, PRESETS, "preset", WHERE)
        for name, kind in _NUMBERS.items():
            kind.checked(getattr(self, name), name, WHERE)
        if self.rig_file is not None and not isinstance(self.rig_file, str | Path):
            what = f"rig_file = {self.rig_file!r} is not a path"
            raise EnvError(what, where=WHERE, remedy="give the path of a rig description (TOML)")
        if self.reading_variance < LEAST_DEVIATION**2:
            raise EnvError(
                f"noise_std and resolution together are below {LEAST_DEVIATION:g} rad",
                where=WHERE,
                remedy="increase one of them: without noise a record holds infinite information",
            )
        _whole("control_period", self.control_period * self.sample_rate, "sample intervals")
        _whole("duration", self.duration / self.control_period, "control periods")
        if self.steps < 2:
            raise EnvError("duration is one control period", where=WHERE, remedy="give a longer run")
        refuse_long(self.duration, self.sample_rate, "duration", WHERE)
        Prior.changed(self.prior, WHERE)

    @property
    def samples_per_step(self) -> int:
        """Potentiometer samples in one control period."""
        return round(self.control_period * self.sample_rate)

    @property
    def steps(self) -> int:
        """Control periods in one run."""
        return round(self.duration / self.control_period)

    @property
    def reading_variance(self) -> float:
        """Variance of one reading, its quantisation included, rad²."""
        return self.noise_std**2 + self.resolution**2 / 12.0

    def sensor(self, zero: float) -> SensorModel:
        """The potentiometer with a given zero, rad."""
        return SensorModel(self.sample_rate, self.noise_std, self.resolution, zero)

    def rig(self) -> Rig:
        """The rig of the description, or the packaged one."""
        with env_errors(WHERE, "rig_file"):
            return load_rig(Path(self.rig_file) if self.rig_file is not None else None)


def angle_limit(rig: Rig) -> float:
    """The angle at which a run is stopped, rad: the end of the potentiometer's range."""
    return radians(rig.potentiometer.half_range_deg)


def free_decay_config(arguments: Mapping[str, Any], beside: Iterable[str] = ()) -> FreeDecayConfig:
    """The configuration of an environment from its keyword arguments.

    Args:
        arguments: arguments by name, in the units of `FreeDecayConfig`.
        beside: names of the environment's other arguments, for the remedy.
    """
    known = [item.name for item in fields(FreeDecayConfig)]
    refuse_unknown(arguments, (*known, *beside), WHERE)
    return FreeDecayConfig(**arguments)


def _whole(name: str, count: float, of: str) -> None:
    if round(count) < 1 or abs(count - round(count)) > 1e-9 * count:
        remedy = f"make it a whole number of {of}"
        raise EnvError(f"{name} is {count:g} {of}", where=WHERE, remedy=remedy)


def refuse_long(duration: float, rate: float, name: str, where: str) -> None:
    """Refuse a run of more samples than one record may have.

    Args:
        duration: duration, s.
        rate: sample rate, Hz.
    """
    if not duration * rate <= limits.RUN_SAMPLES:
        what = f"{name} = {duration:g} s at {rate:g} Hz is longer than a record can be"
        longest = limits.RUN_SAMPLES / rate
        remedy = f"give at most {longest:g} s: the samples of a record are {limits.RUN_SAMPLES:,} at most"
        raise EnvError(what, where=where, remedy=remedy)


OPTIONS = ("spring", "spring_stiffness", "wind_speed", "air_density", "release_angle", "truth", "effects")
TRUTH = ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping", "sensor_zero")

# Ranges of the uniform distributions from which properties are drawn.
WIND_SPEED = (10.0, 20.0)  # m/s
RELEASE_ANGLE = (radians(5.0), radians(20.0))  # rad, to either side
CN_BETA = (0.3, 0.6)  # 1/rad
CN_R = (-0.2, -0.05)  # 1/rad
INERTIA_SHARE = (0.95, 1.05)  # share of the rig's Izz
DAMPING_SHARE = (0.5, 1.5)  # share of the rig's Cr
SENSOR_ZERO = (-0.01, 0.01)  # rad
SEVERITY_SHARE = (0.5, 2.0)  # share of an effect's typical severity
_UNITS = {
    "cn_beta": "1/rad",
    "cn_r": "1/rad",
    "yaw_inertia": "kg m2",
    "mechanical_damping": "N m s/rad",
    "spring_stiffness": "N m/rad",
    "wind_speed": "m/s",
    "air_density": "kg/m3",
    "release_angle": "rad",
    "sensor_zero": "rad",
}
"""Keys of the numbers of a run."""
STIFFNESS_MARGIN = 1.3  # minimum ratio of a drawn spring's stiffness to the greatest Ka


@dataclass(frozen=True)
class RunPlan:
    """One run before it is simulated: stated conditions, truth, sensor with its true zero, and effects."""

    condition: Condition
    truth: Truth
    sensor: SensorModel
    effects: tuple[Effect, ...] = ()

    def stated(self) -> RunSettings:
        """The run's physics without its effects."""
        return run_settings(self.truth, self.condition)


def plan_run(
    options: Mapping[str, Any] | None, config: FreeDecayConfig, rig: Rig, rng: np.random.Generator
) -> RunPlan:
    """The run of one episode.

    Args:
        rng: draws the properties without options, in the order spring, wind speed, release angle, truth in the
            order of `TRUTH`, effects. Nothing is drawn for given options.
    """
    given = checked_names(options or {}, OPTIONS, "reset options", WHERE)
    if given.get("spring") is not None and given.get("spring_stiffness") is not None:
        raise EnvError("spring and spring_stiffness are both given", remedy="give one of them")
    if given.get("spring") is not None:
        try:
            stiffness = rig.spring(given["spring"])
        except (TunnelError, TypeError) as error:
            remedy = f"use one of {', '.join(map(str, rig.springs))}"
            what = f"there is no spring {given['spring']!r}"
            raise EnvError(what, where="option spring", remedy=remedy) from error
    elif given.get("spring_stiffness") is not None:
        stiffness = _number(given, "spring_stiffness", (0.0, 0.0), None, least=1e-6)
    else:
        # from springs stiffer than Ka at any drawn speed, or else from all
        needed = STIFFNESS_MARGIN * aerodynamic_stiffness(
            CN_BETA[1], **rig.body.flow(rig.air.density, WIND_SPEED[1])
        )
        springs = [value for value in rig.springs.values() if value > needed] or list(rig.springs.values())
        stiffness = springs[int(rng.integers(len(springs)))]
    wind = _number(given, "wind_speed", WIND_SPEED, rng, least=0.0, most=config.wind_limit)
    density = _number(given, "air_density", (rig.air.density, rig.air.density), None, least=0.0)
    if given.get("release_angle") is not None:
        limit = 0.99 * angle_limit(rig)
        angle = _number(given, "release_angle", (0.0, 0.0), None, least=-limit, most=limit)
    else:
        angle = float(rng.choice((-1.0, 1.0)) * rng.uniform(*RELEASE_ANGLE))
    own = checked_names(given.get("truth") or {}, TRUTH, "option truth", WHERE)
    nominal = rig.dynamics
    inertia = (INERTIA_SHARE[0] * nominal.yaw_inertia, INERTIA_SHARE[1] * nominal.yaw_inertia)
    damping = (DAMPING_SHARE[0] * nominal.mechanical_damping, DAMPING_SHARE[1] * nominal.mechanical_damping)
    truth = Truth(
        cn_beta=_number(own, "cn_beta", CN_BETA, rng),
        cn_r=_number(own, "cn_r", CN_R, rng),
        yaw_inertia=_number(own, "yaw_inertia", inertia, rng, least=1e-6),
        mechanical_damping=_number(own, "mechanical_damping", damping, rng),
    )
    zero = _number(own, "sensor_zero", SENSOR_ZERO, rng, least=-1.0, most=1.0)
    condition = Condition(
        id=f"k{stiffness:g}-v{wind:g}-a{np.rad2deg(angle):.3g}",
        spring_stiffness=stiffness,
        wind_speed=wind,
        air_density=density,
        release_angle=angle,
        duration=config.duration,
    )
    sensor = config.sensor(zero)
    settings = _effects(given.get("effects"), config, condition, rng)
    try:
        one_run = CampaignPlan("episode", 0, truth, (condition,), sensor, tuple(settings))
        effects = plan_effects(one_run)
        for effect in effects:
            # an episode reads the motion as it proceeds, so no part can be skipped
            if isinstance(effect, Clock) and not effect.is_null:
                what = "an episode cannot drop samples"
                remedy = "inject it with tunnel simulate, which makes whole records"
                raise TunnelError(what, where=f"effect {effect.name}", remedy=remedy)
        return RunPlan(condition, truth, sensor, effects)
    except TunnelError as error:
        raise as_env_error(error, "option effects") from error


def _number(
    given: Mapping[str, Any],
    name: str,
    bounds: tuple[float, float],
    rng: np.random.Generator | None,
    *,
    least: float = -1e6,
    most: float = 1e6,
) -> float:
    """A given number, checked; if none is given, a drawn number, or the first bound without a generator."""
    if given.get(name) is None:
        return float(rng.uniform(*bounds)) if rng is not None else bounds[0]
    return Number(least, most, unit=_UNITS[name]).checked(given[name], name, f"option {name}")


def _effects(
    stated: Any, config: FreeDecayConfig, condition: Condition, rng: np.random.Generator
) -> list[EffectSetting]:
    """The stated effects, or an effect of half to twice its typical severity, drawn with the stated probability."""
    if stated is None:
        if not (config.effect_probability > 0.0 and rng.random() < config.effect_probability):
            return []
        # for one run, which shows no scatter between runs
        kinds = [kind for kind in ALL_EFFECTS if not (kind.driven or issubclass(kind, (Clock, BetweenRuns)))]
        kind = kinds[int(rng.integers(len(kinds)))]
        severity = kind.parameters()[0]
        value = min(severity.upper, severity.scale * float(rng.uniform(*SEVERITY_SHARE)))
        spring = kind.chosen_spring()
        chosen = {} if spring is None else {spring: condition.spring_stiffness}
        return [EffectSetting(kind.name, {severity.name: value, **chosen})]
    if isinstance(stated, Mapping):
        for name, values in stated.items():
            if not isinstance(values, Mapping):
                what = f"effect {name} = {values!r} is not a mapping"
                raise EnvError(what, where="option effects", remedy="give its parameters by name")
        return [EffectSetting(str(name), dict(values)) for name, values in stated.items()]
    if isinstance(stated, Iterable) and not isinstance(stated, str):
        listed = list(stated)
        if all(isinstance(effect, Effect) for effect in listed):
            return [EffectSetting(effect.name, effect.to_json_dict()["parameters"]) for effect in listed]
    remedy = "give {name: {parameter: value}}, or a list of tunnel_sim.effects"
    raise EnvError(f"{stated!r} names no effects", where="option effects", remedy=remedy)
