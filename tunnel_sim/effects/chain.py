"""The effects of one run, in the order in which they act: their changes to its physics, times and readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from tunnel_sim.effects.base import Drawn, Effect
from tunnel_sim.effects.capabilities import Clock, ReadingEffect, SecondOscillation
from tunnel_sim.physics.run_settings import Motion, RunSettings, SettingsTable
from tunnel_sim.physics.steps import for_contact, for_rod
from tunnel_sim.vocabulary.plan import SensorModel
from tunnel_sim.vocabulary.quantities import PerRun
from tunnel_sim.vocabulary.record import Array, Record


@dataclass(frozen=True, eq=False)
class EffectChain:
    """The effects that act in one run.

    Args:
        effects: in the order in which they act.
        drawn: the random part of each effect in this run.
        deviations: relative deviations of the true wind speed, spring and mechanical damping from their stated
            values, by name.
    """

    stated: RunSettings
    effects: tuple[Effect, ...]
    drawn: tuple[Drawn, ...]
    deviations: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def draw(cls, stated: RunSettings, effects: Sequence[Effect], rng: np.random.Generator) -> EffectChain:
        """Draw the random parts of the effects in one run.

        Args:
            effects: in the order in which they act.
            rng: parent generator. Each effect draws from generators spawned from it, one for the motion and one
                for the sensor, so an effect never changes later draws from ``rng`` itself.
        """
        motion, sensor = rng.spawn(len(effects)), rng.spawn(len(effects))
        drawn = tuple(
            effect.draw(stated, of_sensor if _of_angle(effect) else of_motion)
            for effect, of_motion, of_sensor in zip(effects, motion, sensor, strict=True)
        )
        return cls(stated, tuple(effects), drawn)

    def physics(self) -> RunSettings:
        """The physics of the run with the effects, with steps short enough for a rod and a contact."""
        deviations = {name: np.array([value]) for name, value in self.deviations.items()}
        runs = with_effects(self.stated.table, [self.effects], [self.drawn], deviations)
        return for_rod(for_contact(runs.row(0)))

    @property
    def skips(self) -> bool:
        """Whether the motion is read at other times than stated."""
        return any(isinstance(effect, Clock) and not effect.is_null for effect in self.effects)

    def true_times(self, time_s: Array) -> Array:
        """The true times of the readings.

        Args:
            time_s: times by the stamps, s, shape (n,).

        Returns:
            The true times since the release, s, shape (n,).
        """
        for effect, drawn in zip(self.effects, self.drawn, strict=True):
            if isinstance(effect, Clock):
                time_s = effect.on_time(time_s, self.stated, drawn)
        return time_s

    def sensed(self, motion: Motion, time_s: Array, derivative: int = 0) -> Array:
        """The sensor's view of a motion, before its zero and noise.

        Args:
            motion: motion of the rod's upper end, as long as `physics` requires.
            time_s: times of the samples by their time stamps, s, shape (n,); they may differ from the times of
                the motion.
            derivative: which derivative of the angle the sensor measures: 0, 1 or 2.

        Returns:
            The measured angle, rad, or its derivative, rad/s or rad/s², shape (n,); cubic between the times of
            the motion.
        """
        from scipy.interpolate import CubicHermiteSpline  # imported here because it is slow to load

        true = self.true_times(time_s)
        path = CubicHermiteSpline(motion.time_s, motion.angle, motion.rate)
        return self.angle(np.asarray(path(true, derivative), np.float64), true, derivative)

    def angle(self, angle: Array, time_s: Array, derivative: int = 0) -> Array:
        """The angle measured by the sensor, before zero and noise are added.

        Args:
            angle: angle of the rod's upper end, or its derivative, rad, rad/s or rad/s², shape (n,).
            time_s: true times since the release, s, shape (n,).
            derivative: which derivative of the angle the sensor measures: 0, 1 or 2.

        Returns:
            The measured angle or its derivative, in the same unit, shape (n,).
        """
        stated = self.stated
        seen_by = [
            (effect, drawn)
            for effect, drawn in zip(self.effects, self.drawn, strict=True)
            if isinstance(effect, ReadingEffect)
        ]
        swings = any(isinstance(effect, SecondOscillation) for effect, _ in seen_by)
        if swings and stated.drive is not None:  # with its delay and its actuator
            stated = replace(stated, drive=self.physics().drive)
        for effect, drawn in seen_by:
            if isinstance(effect, SecondOscillation) and not effect.is_null:
                angle = angle + effect.oscillation(time_s, stated, drawn, derivative)
            angle = effect.on_angle(angle, time_s, self.stated, drawn)
        return angle

    def sensor(self, sensor: SensorModel) -> SensorModel:
        """The true sensor, given the stated one."""
        for effect in self.effects:
            sensor = effect.on_sensor(sensor) if isinstance(effect, ReadingEffect) else sensor
        return sensor

    def reading(self, reading: Array) -> Array:
        """Change the reading after noise and before quantisation.

        Args:
            reading: with zero and noise, rad, shape (n,).

        Returns:
            The changed reading, rad, shape (n,).
        """
        for effect in self.effects:
            reading = effect.on_reading(reading) if isinstance(effect, ReadingEffect) else reading
        return reading

    @property
    def reads_plainly(self) -> bool:
        """Whether no effect changes the measured angle or the reading."""
        return reads_plainly(self.effects)


def with_effects(
    stated: SettingsTable,
    effects: Sequence[Sequence[Effect]],
    drawn: Sequence[Sequence[Drawn]],
    deviations: Mapping[str, PerRun] | None = None,
) -> SettingsTable:
    """The physics of runs with their effects; a spring with a moving root acts with its true stiffness.

    Args:
        effects: effects of every run, in the order in which they act; all runs have the same classes.
        drawn: the random part of each effect, by run.
        deviations: as in `EffectChain`, by run.
    """
    runs = stated.copy()
    for alike, own in zip(zip(*effects, strict=True), zip(*drawn, strict=True), strict=True):
        type(alike[0]).on_runs(runs, stated, alike, own)
    for name, relative in (deviations or {}).items():
        runs.deviate(name, relative)
    runs.change_inputs(
        runs.spring_stiffness.tolist(),
        lambda spring, drive: replace(drive, scale=spring) if drive.kind.of_spring else drive,
    )
    return runs


def reads_plainly(effects: Sequence[Effect]) -> bool:
    """Whether no effect in a list changes the measured angle or the reading."""
    return not any(
        isinstance(effect, Clock) or _of_angle(effect) or _overrides(effect, "on_reading")
        for effect in effects
    )


def _of_angle(effect: Effect) -> bool:
    """Whether an effect changes the angle that the sensor measures."""
    return isinstance(effect, SecondOscillation) or _overrides(effect, "on_angle")


def _overrides(effect: Effect, hook: Literal["on_angle", "on_reading"]) -> bool:
    kind = type(effect)
    return issubclass(kind, ReadingEffect) and getattr(kind, hook) is not getattr(ReadingEffect, hook)


def read_motion(
    motion: Motion, sensor: SensorModel, rng: np.random.Generator, chain: EffectChain | None = None
) -> Record:
    """The reading y = quantised(β + zero + noise) with the effects on sensor and reading; of unlimited range."""
    angle, time = motion.angle, motion.time_s
    if chain is not None and chain.skips:
        time = time[: round(chain.stated.duration / (time[1] - time[0]))]
        angle = chain.sensed(motion, time)
    elif chain is not None:
        angle = chain.angle(angle, time)
    sensor = sensor if chain is None else chain.sensor(sensor)
    reading = angle + sensor.zero + sensor.noise_std * rng.standard_normal(angle.shape)
    if chain is not None:
        reading = chain.reading(reading)
    return Record(time, quantise(reading, sensor.resolution))


def quantise(reading: Array, step: float) -> Array:
    """Round to a multiple of the resolution.

    Args:
        reading: reading, rad, any shape.
        step: resolution, rad; 0: the reading is unchanged.
    """
    return np.round(reading / step) * step if step > 0.0 else reading
