"""The reading of a run in progress, block by block, with the bits of `tunnel_sim.sensor.read_motion`."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np

from tunnel_sim.effects import Effect
from tunnel_sim.effects.sensor_hysteresis import SensorHysteresis
from tunnel_sim.plan import SensorModel
from tunnel_sim.record import Array
from tunnel_sim.run_settings import RunSettings

#: Effects whose reading hangs on what came before: they are given the whole run so far.
WITH_MEMORY: tuple[type[Effect], ...] = (SensorHysteresis,)


class SensorChain:
    """What one run's effects do to the reading.

    Args:
        stated: the run as the campaign states it.
        sensor: the potentiometer as stated.
        effects: all effects of the run, in the order in which they act.
        rng: what effects draw comes from generators spawned of it, as in `read_motion`.
    """

    def __init__(
        self, stated: RunSettings, sensor: SensorModel, effects: Sequence[Effect], rng: np.random.Generator
    ) -> None:
        self._stated = stated
        self._on_angle: list[tuple[Effect, np.random.Generator, Any]] = []
        for effect in effects:
            child = rng.spawn(1)[0]
            sensor = effect.on_sensor(sensor)
            if type(effect).on_angle is not Effect.on_angle and not effect.is_null:
                self._on_angle.append((effect, child, child.bit_generator.state))
        self._on_reading = [effect for effect in effects if type(effect).on_reading is not Effect.on_reading]
        self.sensor = sensor
        self._past: list[list[Array]] = [[] for _ in self._on_angle]
        self._times: list[Array] = []

    @property
    def is_plain(self) -> bool:
        """Whether the reading is zero, noise and quantisation alone."""
        return not self._on_angle and not self._on_reading

    def copied(self) -> SensorChain:
        """The same chain at the same point of its run, sharing nothing that changes."""
        other = copy.copy(self)
        vars(other).update(
            _on_angle=[(effect, copy.deepcopy(rng), state) for effect, rng, state in self._on_angle],
            _past=[list(past) for past in self._past],
            _times=list(self._times),
        )
        return other

    def angle(self, angle: Array, time_s: Array) -> Array:
        """What the sensor sees of the run's next samples before its zero and noise.

        Args:
            angle: of the rod's upper end, shape (n,), rad.
            time_s: shape (n,), s, following on the call before.

        Returns:
            Shape (n,), rad.
        """
        self._times.append(time_s)
        for place in range(len(self._on_angle)):
            past = self._past[place]
            past.append(angle.copy())
            angle = self._seen(place, past, self._times) if self._remembers(place) else self._seen(
                place, [angle], [time_s]
            )  # fmt: skip
        return angle

    def held(self, angle: Array, time_s: Array) -> Array:
        """The same while the body is still held, outside the run's past; arguments as in `angle`."""
        for place in range(len(self._on_angle)):
            angle = self._seen(place, [angle], [time_s])
        return angle

    def reading(self, reading: Array) -> Array:
        """What effects do after the noise; rad, shape (n,) in and out."""
        for effect in self._on_reading:
            reading = effect.on_reading(reading)
        return reading

    def _remembers(self, place: int) -> bool:
        return isinstance(self._on_angle[place][0], WITH_MEMORY)

    def _seen(self, place: int, angles: list[Array], times: list[Array]) -> Array:
        effect, rng, state = self._on_angle[place]
        rng.bit_generator.state = state  # every call draws what the run's first one drew
        seen = effect.on_angle(np.concatenate(angles), np.concatenate(times), self._stated, rng)
        return seen[-len(angles[-1]) :]
