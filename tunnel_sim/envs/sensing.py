"""The reading of a run in progress, block by block; bit-identical to `tunnel_sim.engine.sensor.read_motion`."""

from __future__ import annotations

import copy

import numpy as np

from tunnel_sim.effects import EffectChain
from tunnel_sim.vocabulary.plan import SensorModel
from tunnel_sim.vocabulary.record import Array


class RunningSensor:
    """The effects of one run on its reading."""

    def __init__(self, chain: EffectChain, sensor: SensorModel) -> None:
        self._chain = chain
        self.sensor = chain.sensor(sensor)
        self._remembers = any(effect.remembers for effect in chain.effects)
        self._angles: list[Array] = []
        self._times: list[Array] = []

    @property
    def is_plain(self) -> bool:
        """Whether the reading differs from the angle by zero, noise and quantisation only."""
        return self._chain.reads_plainly

    def copied(self) -> RunningSensor:
        """An independent copy at the same point of the run."""
        other = copy.copy(self)
        vars(other).update(_angles=list(self._angles), _times=list(self._times))
        return other

    def angle(self, angle: Array, time_s: Array) -> Array:
        """The angle that the sensor measures in the next samples, before zero and noise are added.

        Args:
            angle: of the rod's upper end, shape (n,), rad.
            time_s: shape (n,), s; continues from the previous call.

        Returns:
            Shape (n,), rad.
        """
        if not self._remembers:
            return self._chain.angle(angle, time_s)
        self._angles.append(angle.copy())
        self._times.append(time_s)
        seen = self._chain.angle(np.concatenate(self._angles), np.concatenate(self._times))
        return seen[-len(angle) :]

    def held(self, angle: Array, time_s: Array) -> Array:
        """The measured angle before the release, which later samples do not depend on; arguments as in `angle`."""
        return self._chain.angle(angle, time_s)

    def reading(self, reading: Array) -> Array:
        """Apply the effects that act after the noise; rad, shape (n,) in and out."""
        return self._chain.reading(reading)
