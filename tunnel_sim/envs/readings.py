"""The readings of runs in progress, block by block; bit-identical to `tunnel_sim.effects.chain.read_motion`.

Zero, noise and quantisation are vectorised, effects act run by run.
"""

from __future__ import annotations

import copy

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.effects import EffectChain
from tunnel_sim.effects.chain import quantise
from tunnel_sim.envs.conditions import FreeDecayConfig
from tunnel_sim.envs.errors import EnvError
from tunnel_sim.vocabulary.plan import SensorModel
from tunnel_sim.vocabulary.record import Array, Record


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


class Readings:
    """The potentiometer readings of many runs; ``row`` is the index of a run."""

    def __init__(self, config: FreeDecayConfig, count: int) -> None:
        self._samples = config.samples_per_step
        self._steps = config.steps
        self._times = config.sample_times
        self._interval = 1.0 / config.sample_rate
        self._chains: list[RunningSensor | None] = [None] * count
        self._rngs: list[np.random.Generator] = [np.random.default_rng(0)] * count
        self._altered: set[int] = set()  # runs with effects on the reading
        self._sensor = np.zeros((3, count, 1))  # zero, noise, resolution
        self._values = np.zeros((count, config.steps * config.samples_per_step))

    def start(self, row: int, chain: RunningSensor, rng: np.random.Generator) -> None:
        """Start a run with its effects on the reading."""
        self._chains[row], self._rngs[row] = chain, rng
        self._sensor[:, row, 0] = chain.sensor.zero, chain.sensor.noise_std, chain.sensor.resolution
        (self._altered.discard if chain.is_plain else self._altered.add)(row)

    def held(self, row: int, angle: float) -> Array:
        """Readings (rad) of the control period before the release, shape (samples,).

        Their noise is not drawn from the run's generator.

        Args:
            angle: at which the rod's upper end is held, rad.
        """
        chain = self._chain(row)
        sensor = chain.sensor
        time = np.arange(-self._samples, 0, dtype=np.float64) * self._interval
        noise = self._rngs[row].spawn(1)[0].standard_normal(self._samples)
        held = chain.held(np.full(self._samples, angle), time)
        return quantise(chain.reading(held + sensor.zero + sensor.noise_std * noise), sensor.resolution)

    def take(self, angle: Array, step: NDArray[np.int64], running: NDArray[np.bool_]) -> Array:
        """The next readings of all runs, shape (runs, samples), rad.

        Args:
            angle: of the rod's upper end at the samples, shape (runs, samples), rad.
            step: number of the control period, shape (runs,).
            running: which runs are in progress, shape (runs,); the generators of the others are not used.
        """
        noise = np.zeros_like(angle)
        for row in np.flatnonzero(running).tolist():
            self._rngs[row].standard_normal(out=noise[row])
        first = np.minimum(step, self._steps - 1) * self._samples
        if self._altered:
            angle = angle.copy()
        for row in self._altered:
            times = self._times[first[row] : first[row] + self._samples]
            angle[row] = self._chain(row).angle(angle[row], times)
        zero, noise_std, resolution = self._sensor
        readings = angle + zero + noise_std * noise
        for row in self._altered:
            readings[row] = self._chain(row).reading(readings[row])
        size = np.where(resolution > 0.0, resolution, 1.0)
        readings = np.where(resolution > 0.0, np.round(readings / size) * size, readings)
        if (first == first[0]).all():
            self._values[:, first[0] : first[0] + self._samples] = readings
        else:
            columns = first[:, None] + np.arange(self._samples)
            self._values[np.arange(len(first))[:, None], columns] = readings
        return readings

    def record(self, row: int, steps: int) -> Record:
        """The record of a run over its first control periods."""
        count = steps * self._samples
        if count < 2:
            raise EnvError("there is no reading yet", where="record", remedy="call step() first")
        return Record(self._times[:count], self._values[row, :count])

    def snapshot(self, row: int) -> tuple[Array, RunningSensor, np.random.Generator]:
        """Copies of the state of a run."""
        return self._values[row].copy(), self._chain(row).copied(), copy.deepcopy(self._rngs[row])

    def restore(
        self, row: int, values: Array, chain: RunningSensor, rng: np.random.Generator
    ) -> np.random.Generator:
        """Restore a run from a snapshot, with copies; the generator that it uses from now on.

        Args:
            values: readings from `snapshot`, shape (n,), rad.
        """
        if np.shape(values) != self._values[row].shape:
            raise EnvError("the state belongs to a different configuration", remedy="use the same arguments")
        self.start(row, chain.copied(), copy.deepcopy(rng))
        self._values[row] = values
        return self._rngs[row]

    def _chain(self, row: int) -> RunningSensor:
        chain = self._chains[row]
        if chain is None:
            raise EnvError("no episode has begun", remedy="call reset() first")
        return chain
