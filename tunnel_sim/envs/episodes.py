"""Parallel episodes: readings, information, end, and the resulting campaign; a vector environment has many of them.

Readings are bit-identical to `tunnel_sim.effects.chain.read_motion`: zero, noise and quantisation are
vectorised, effects act run by run.
"""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeAlias

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from tunnel_sim.effects import EffectChain
from tunnel_sim.effects.capabilities import ReadingEffect
from tunnel_sim.effects.chain import quantise
from tunnel_sim.engine.virtual_campaign import stated_run
from tunnel_sim.envs import EnvError, as_env_error
from tunnel_sim.envs.engines import ManyRuns, OneRun, Operation, OperatorLog, WindAnswer, check_plain, decode
from tunnel_sim.envs.episode_conditions import FreeDecayConfig, RunPlan, angle_limit, plan_run
from tunnel_sim.envs.information import Information, Prior
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError, counted
from tunnel_sim.vocabulary.plan import SensorModel
from tunnel_sim.vocabulary.record import Array, Record
from tunnel_sim.vocabulary.rig import Rig

Flags = NDArray[np.bool_]

READING_BOUND = 2.0 * np.pi
"""Bound of a reading in the observation, rad; the record is not clipped."""

Engine: TypeAlias = OneRun | ManyRuns


@dataclass(frozen=True, eq=False)
class EpisodeState:
    """The complete state of an episode in progress; continuing from it gives bit-identical results.

    Args:
        mujoco: ``mj_getState`` of ``mjSTATE_INTEGRATION``, including the plugin's state, shape (n,).
    """

    plan: RunPlan
    physics: RunSettings
    mujoco: Array
    arrays: Mapping[str, Any]
    sensor: RunningSensor
    rng: np.random.Generator


def observation_space(config: FreeDecayConfig) -> spaces.Box:
    """The space of one environment's observations: readings (rad), then time (s) and wind speed (m/s)."""
    low = np.array([-READING_BOUND] * config.samples_per_step + [0.0, 0.0])
    high = np.array([READING_BOUND] * config.samples_per_step + [config.duration, config.wind_limit])
    return spaces.Box(low, high, dtype=np.float64)


class Episodes:
    """Parallel episodes of one configuration; ``row`` is the index of an episode."""

    def __init__(self, config: FreeDecayConfig, rig: Rig, engine: Engine, count: int) -> None:
        self._config, self._rig, self._engine, self._count = config, rig, engine, count
        samples = config.samples_per_step
        interval, variance = 1.0 / config.sample_rate, config.reading_variance
        self.information = Information(count, samples, interval, variance, Prior.changed(config.prior))
        self._wind = WindAnswer(config.control_period, samples, config.wind_time_constant)
        self._limit = angle_limit(rig)
        self._plans: list[RunPlan | None] = [None] * count
        self._physics: list[RunSettings | None] = [None] * count
        self._readings = Readings(config, count)
        self._log = np.zeros((count, 3, config.steps))  # set-point, speed, moment
        self._stated_speed = np.zeros(count)
        self._speed = np.zeros(count)
        self.step_count = np.zeros(count, dtype=np.int64)
        self.ended = np.ones(count, dtype=np.bool_)  # no run is in progress before the first reset

    def start(
        self, row: int, options: Mapping[str, Any] | None, rng: np.random.Generator
    ) -> tuple[Array, dict[str, Any]]:
        """Start an episode."""
        plan = plan_run(options, self._config, self._rig, rng)
        stated = plan.stated()
        try:
            chain = EffectChain.draw(stated, plan.effects, rng)
            physics = chain.physics()
            end_angle = self._engine.start(row, physics)
        except TunnelError as error:
            raise as_env_error(error, "reset options") from error
        self._plans[row], self._physics[row] = plan, physics
        self._readings.start(row, RunningSensor(chain, plan.sensor), rng)
        self.information.start(row, stated, self._rig.body)
        self._stated_speed[row] = self._speed[row] = plan.condition.wind_speed
        self.step_count[row], self.ended[row] = 0, False
        time = self.step_count[row] * self._config.control_period
        shown = np.clip(self._readings.held(row, end_angle), -READING_BOUND, READING_BOUND)
        observation = np.concatenate((shown, (min(time, self._config.duration), self._speed[row])))
        given = ("spring_stiffness", "wind_speed", "air_density", "release_angle")  # known to the operator
        info: dict[str, Any] = {name: getattr(plan.condition, name) for name in given}
        if self._config.expose_truth:
            info["truth"] = plan
        return observation, info

    def advance(self, actions: Any) -> tuple[Array, Array, Flags, Flags]:
        """Advance all episodes: observations, shape (runs, samples + 2), rewards (nats) and ends, shape (runs,)."""
        operation = None
        if self._config.preset == "plain":
            check_plain(actions, self._count)
            speeds = np.broadcast_to(self._speed[:, None], (self._count, self._config.samples_per_step))
            moment = np.zeros(self._count)
        else:
            set_point, moment = decode(self._config, actions)
            if len(moment) != self._count:
                raise EnvError(
                    f"{counted(len(moment), 'action')} for {counted(self._count, 'run')}",
                    remedy="give one per run",
                )
            speeds, self._speed = self._wind.speeds(self._speed, set_point)
            at = np.minimum(self.step_count, self._config.steps - 1)
            self._log[np.arange(self._count), :, at] = np.stack((set_point, self._speed, moment), axis=1)
            operation = Operation(speeds - self._stated_speed[:, None], moment)
        angle, rate = self._engine.advance(operation)
        wild = ~(np.abs(angle).max(axis=1) <= self._limit)
        if wild.any():
            angle, rate = (np.nan_to_num(np.clip(values, -1e3, 1e3)) for values in (angle, rate))
        readings = self._readings.take(angle[:, :-1], self.step_count, ~self.ended)
        before = self.information.known
        rewards = self.information.advance(angle, rate, speeds.mean(axis=1), moment)
        if wild.any():  # the run is lost: the sum of its rewards is the penalty
            rewards = np.where(wild, -before - self._config.stop_penalty, rewards)
        self.step_count += 1
        observations = np.empty((self._count, self._config.samples_per_step + 2))
        np.clip(readings, -READING_BOUND, READING_BOUND, out=observations[:, :-2])
        observations[:, -2] = np.minimum(self.step_count * self._config.control_period, self._config.duration)
        observations[:, -1] = self._speed
        truncated = ~wild & (self.step_count >= self._config.steps)
        self.ended |= wild | truncated
        return observations, rewards, wild, truncated

    def outcome(self, row: int) -> dict[str, Any]:
        """The content of ``info`` at the end of an episode, as the environment's page lists it."""
        plan, record = self._plan(row), self.record(row)
        info: dict[str, Any] = {"record": record}
        if self._config.preset == "plain":
            info["run"] = stated_run(plan.condition, record)
        else:
            steps = int(self.step_count[row])
            time = np.arange(steps, dtype=np.float64) * self._config.control_period
            info["operator_log"] = OperatorLog(time, *(values[:steps].copy() for values in self._log[row]))
        if self._config.expose_truth:
            info["truth"] = plan
        return info

    def record(self, row: int) -> Record:
        """The record of a run so far."""
        return self._readings.record(row, int(self.step_count[row]))

    def _plan(self, row: int) -> RunPlan:
        plan = self._plans[row]
        if plan is None:
            raise EnvError("no episode has begun", remedy="call reset() first")
        return plan

    def get_state(self, row: int) -> EpisodeState:
        """The complete state of an episode in progress."""
        plan, physics = self._plan(row), self._physics[row]
        assert physics is not None
        values, chain, rng = self._readings.snapshot(row)
        own = {
            "readings": values,
            "log": self._log[row],
            "speed": self._speed[row],
            "step_count": self.step_count[row],
            "ended": self.ended[row],
        }
        arrays = {name: np.array(value) for name, value in own.items()} | self.information.snapshot(row)
        return EpisodeState(plan, physics, self._engine.get_state(row), arrays, chain, rng)

    def set_state(self, row: int, state: EpisodeState) -> np.random.Generator:
        """Continue an episode from a state of the same configuration; returns the generator for its next steps."""
        rng = self._readings.restore(row, state.arrays["readings"], state.sensor, state.rng)
        self._engine.start(row, state.physics)
        self._engine.set_state(row, state.mujoco)
        self._plans[row], self._physics[row] = state.plan, state.physics
        self.information.restore(row, state.plan.stated(), self._rig.body, state.arrays)
        self._log[row] = state.arrays["log"]
        self._speed[row], self._stated_speed[row] = state.arrays["speed"], state.plan.condition.wind_speed
        self.step_count[row], self.ended[row] = state.arrays["step_count"], state.arrays["ended"]
        return rng


class _HasRig(Protocol):
    """A free-decay environment or vector environment, unwrapped."""

    config: FreeDecayConfig
    rig: Rig


def campaign_of(runs: Iterable[Run], env: _HasRig, *, name: str = "episodes") -> Campaign:
    """The runs of finished episodes (plain preset) as one campaign, without the truth; equal ids are numbered."""
    listed = list(runs)
    if not listed:
        raise EnvError("no run is given", where="campaign_of", remedy="give info['run'] of finished episodes")
    repeated = {label for label, count in Counter(run.id for run in listed).items() if count > 1}
    seen: Counter[str] = Counter()
    numbered = []
    for run in listed:
        seen[run.id] += 1
        numbered.append(replace(run, id=f"{run.id}-{seen[run.id]}") if run.id in repeated else run)
    sensor = SensorProperties.of(env.config.sensor(0.0))
    return Campaign(name, RigProperties.of(env.rig), sensor, tuple(numbered))


class RunningSensor:
    """The effects of one run on its reading."""

    def __init__(self, chain: EffectChain, sensor: SensorModel) -> None:
        self.chain = chain
        self.sensor = chain.sensor(sensor)
        self._remembers = any(
            isinstance(effect, ReadingEffect) and effect.remembers for effect in chain.effects
        )
        self._angles: list[Array] = []
        self._times: list[Array] = []

    def copied(self) -> RunningSensor:
        """An independent copy at the same point of the run."""
        other = copy.copy(self)
        vars(other).update(_angles=list(self._angles), _times=list(self._times))
        return other

    def angle(self, angle: Array, time_s: Array) -> Array:
        """The angle that the sensor measures in the next samples, before zero and noise are added.

        Args:
            angle: angle of the rod's upper end, shape (n,), rad.
            time_s: times, shape (n,), s; they continue from the previous call.
        """
        if not self._remembers:
            return self.chain.angle(angle, time_s)
        self._angles.append(angle.copy())
        self._times.append(time_s)
        seen = self.chain.angle(np.concatenate(self._angles), np.concatenate(self._times))
        return seen[-len(angle) :]


class Readings:
    """The potentiometer readings of many runs; ``row`` is the index of a run."""

    def __init__(self, config: FreeDecayConfig, count: int) -> None:
        self._samples = config.samples_per_step
        self._steps = config.steps
        self._times = np.arange(config.steps * config.samples_per_step) / config.sample_rate
        self._interval = 1.0 / config.sample_rate
        self._running: list[RunningSensor | None] = [None] * count
        self._rngs: list[np.random.Generator] = [np.random.default_rng(0)] * count
        self._altered: set[int] = set()  # runs with effects on the reading
        self._sensor = np.zeros((3, count, 1))  # zero, noise, resolution
        self._values = np.zeros((count, config.steps * config.samples_per_step))

    def start(self, row: int, running: RunningSensor, rng: np.random.Generator) -> None:
        """Start a run with its effects on the reading."""
        self._running[row], self._rngs[row] = running, rng
        sensor = running.sensor
        self._sensor[:, row, 0] = sensor.zero, sensor.noise_std, sensor.resolution
        (self._altered.discard if running.chain.reads_plainly else self._altered.add)(row)

    def held(self, row: int, angle: float) -> Array:
        """Readings (rad) of the control period before the release, shape (samples,), with independent noise.

        Args:
            angle: angle of the held upper end of the rod, rad.
        """
        chain, sensor = self._of(row).chain, self._of(row).sensor
        time = np.arange(-self._samples, 0, dtype=np.float64) * self._interval
        noise = self._rngs[row].spawn(1)[0].standard_normal(self._samples)
        held = chain.angle(np.full(self._samples, angle), time)  # later samples do not depend on it
        return quantise(chain.reading(held + sensor.zero + sensor.noise_std * noise), sensor.resolution)

    def take(self, angle: Array, step: NDArray[np.int64], running: NDArray[np.bool_]) -> Array:
        """The next readings of all runs, shape (runs, samples), rad.

        Args:
            angle: angle of the rod's upper end at the samples, shape (runs, samples), rad.
            step: number of the control period, shape (runs,).
            running: mask of the runs in progress, shape (runs,); the generators of the others are not used.
        """
        noise = np.zeros_like(angle)
        for row in np.flatnonzero(running).tolist():
            self._rngs[row].standard_normal(out=noise[row])
        first = np.minimum(step, self._steps - 1) * self._samples
        if self._altered:
            angle = angle.copy()
        for row in self._altered:
            times = self._times[first[row] : first[row] + self._samples]
            angle[row] = self._of(row).angle(angle[row], times)
        zero, noise_std, resolution = self._sensor
        readings = angle + zero + noise_std * noise
        for row in self._altered:
            readings[row] = self._of(row).chain.reading(readings[row])
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
        return self._values[row].copy(), self._of(row).copied(), copy.deepcopy(self._rngs[row])

    def restore(
        self, row: int, values: Array, running: RunningSensor, rng: np.random.Generator
    ) -> np.random.Generator:
        """Restore a run from copies of a snapshot; returns the generator for its next steps.

        Args:
            values: readings from `snapshot`, shape (n,), rad.
        """
        if np.shape(values) != self._values[row].shape:
            raise EnvError("the state belongs to a different configuration", remedy="use the same arguments")
        self.start(row, running.copied(), copy.deepcopy(rng))
        self._values[row] = values
        return self._rngs[row]

    def _of(self, row: int) -> RunningSensor:
        running = self._running[row]
        if running is None:
            raise EnvError("no episode has begun", remedy="call reset() first")
        return running
