"""Simulation of single runs and of many runs at once."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from mujoco import batch as mujoco_batch

from tunnel_sim.effects import Effect, EffectChain
from tunnel_sim.effects.chain import read_motion
from tunnel_sim.engine.model import Model, build_model
from tunnel_sim.physics.moment_law import forward_library
from tunnel_sim.physics.run_settings import Motion, RunSettings, sampling
from tunnel_sim.physics.steps import follow_fastest
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import SensorModel
from tunnel_sim.vocabulary.record import Array, Record
from tunnel_sim.vocabulary.rig import Rig

Progress = Callable[[int, int], None]
STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""State for a bit-identical continuation: full physics with plugin state, inputs, and the solver's warm start."""

_CONTROL = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED) | int(mujoco.mjtState.mjSTATE_USERDATA)
_VARIED = ("jnt_stiffness", "dof_damping", "numeric_data", "body_inertia")
_CHUNK_STEPS = 4_000_000  # steps recorded at once, to limit the memory of a large batch


def simulate_motion(model: Model, sample_rate: float) -> Motion:
    """Integrate one run with ``mj_step``.

    Args:
        sample_rate: sample rate, Hz.
    """
    samples, steps = sampling(model.settings, sample_rate)
    data = model.release_state()
    angle, rate = np.empty(samples), np.empty(samples)
    at = model.yaw_address
    with no_timers():
        for i in range(samples):
            angle[i], rate[i] = data.qpos[at], data.qvel[at]
            if i + 1 < samples:
                mujoco.mj_step(model.mj, data, steps)
    _check_finite(angle, "the run")
    return Motion(np.arange(samples) / sample_rate, angle, rate)


def simulate(
    rig: Rig,
    settings: RunSettings,
    sensor: SensorModel,
    rng: np.random.Generator,
    *,
    effects: Sequence[Effect] = (),
    deviations: Mapping[str, float] | None = None,
) -> Record:
    """Simulate one run as the sensor sees it.

    Args:
        deviations: relative deviations of the true wind speed, spring and mechanical damping from the settings,
            by name.

    Raises:
        TunnelError: when the motion diverges or the settings are refused.
    """
    chain = replace(EffectChain.draw(settings, effects, rng), deviations=deviations or {})
    motion = simulate_motion(build_model(rig, follow_fastest(rig, chain.physics())), sensor.sample_rate)
    return read_motion(motion, sensor, rng, chain)


def simulate_motions(
    rig: Rig,
    settings: Sequence[RunSettings],
    sample_rate: float,
    *,
    nthread: int = 0,
    progress: Progress | None = None,
) -> list[Motion]:
    """Integrate many runs on a thread pool, bit-identical to `simulate_motion`.

    Args:
        sample_rate: sample rate, Hz.
        nthread: number of threads; 0 uses all processors.
    """
    runs: list[RunSettings] = []
    groups: dict[tuple[object, ...], list[int]] = {}  # runs that share a compiled model, by layout
    for i, stated in enumerate(settings):
        try:
            run = follow_fastest(rig, stated)
        except TunnelError as error:
            raise TunnelError(error.what, where=f"run {i + 1}", remedy=error.remedy) from error
        runs.append(run)
        groups.setdefault((run.duration, *run.layout()), []).append(i)
    motions: dict[int, Motion] = {}
    for group in groups.values():
        samples, steps = sampling(runs[group[0]], sample_rate)
        time = np.arange(samples) / sample_rate
        size = max(1, _CHUNK_STEPS // (samples * steps))
        for chunk in (group[at : at + size] for at in range(0, len(group), size)):
            model = build_model(rig, runs[chunk[0]], drawn=False)
            batch = RunBatch(model, len(chunk), steps, nthread)
            first = [batch.start(row, model.with_settings(runs[i])) for row, i in enumerate(chunk)]
            with no_log(), no_timers():
                angle, rate = batch.advance(samples - 1, np.array(first).T)
            for row, i in enumerate(chunk):
                _check_finite(angle[row], f"run {i + 1}")
                motions[i] = Motion(time, angle[row], rate[row])
            if progress is not None:
                progress(len(motions), len(runs))
    return [motions[i] for i in range(len(runs))]


class RunBatch:
    """Runs of one layout on ``mujoco.batch``, each with its own numbers; ``row`` is the index of a run."""

    def __init__(self, model: Model, count: int, steps: int, nthread: int) -> None:
        self._batch = mujoco_batch.Batch(model.mj, nsim=count, nthread=nthread)
        self._address, self._steps = model.yaw_address, steps
        self._fields = {name: self._batch.expand(name) for name in _VARIED}
        self._states = {name: self._batch.bind(name) for name in ("qpos", "qvel")}
        self._started: set[int] = set()
        self._out: dict[str, Array] = {}

    @property
    def state(self) -> Array:
        """MuJoCo's `STATE` of the runs, in SI units, shape (runs, n); writing a row sets its run."""
        state: Array = self._batch.state
        return state

    def qpos(self, row: int) -> Array:
        """Positions of a run's joints, rad."""
        positions: Array = self._states["qpos"][row]
        return positions

    def now(self, row: int) -> tuple[float, float]:
        """Angle (rad) and rate (rad/s) of the rod's upper end."""
        return tuple(float(self._states[name][row, self._address]) for name in ("qpos", "qvel"))  # type: ignore[return-value]

    def start(self, row: int, model: Model) -> tuple[float, float]:
        """Start the run of a model at its release; result as in `now`."""
        data = model.release_state()
        for name in _VARIED:
            self._fields[name][row] = getattr(model.mj, name)
        mujoco.mj_getState(model.mj, data, self._batch.state[row], STATE)
        self._started.add(row)
        return float(data.qpos[self._address]), float(data.qvel[self._address])

    def advance(
        self, samples: int, first: Array, rows: Any = None, control: tuple[Array, Array] | None = None
    ) -> tuple[Array, Array]:
        """Integrate runs over a number of samples.

        Args:
            samples: number of samples after the first.
            first: angle (rad) and rate (rad/s) of the rod's upper end now, shape (2, runs).
            rows: indices of the runs to advance; None: all.
            control: departure of the wind speed in each sample interval, shape (runs, samples), m/s, and moment on
                the rod's upper end, shape (runs,), N m, for the advanced runs; None: neither.

        Returns:
            Angle (rad) and rate (rad/s) of the rod's upper end, now and at each sample, shape (runs, samples + 1).
        """
        if self._started:
            self._batch.set_const(np.array(sorted(self._started), dtype=np.int32))
            self._started.clear()
        applied = None
        if control is not None:
            departure, moment = np.repeat(control[0], self._steps, axis=1), control[1]
            joints = self._batch.model.nv
            applied = np.zeros((*departure.shape, joints + self._batch.model.nuserdata))
            applied[..., self._address] = moment[:, None]
            applied[..., joints] = departure
        out = self._out if rows is None else None
        recorded = self._batch.rollout(
            samples * self._steps, applied, _CONTROL, ("qpos", "qvel"), ids=rows, out=out
        )
        if rows is None:
            self._out = recorded  # reuse the same buffers
        angle, rate = (
            np.concatenate(
                (now[:, None], recorded[name][:, self._steps - 1 :: self._steps, self._address]), axis=1
            )
            for now, name in zip(first, ("qpos", "qvel"), strict=True)
        )
        return angle, rate


@contextmanager
def no_log() -> Iterator[None]:
    """Suppress MuJoCo's warnings on the terminal and in a log file; the caller reports the fault itself."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


@contextmanager
def no_timers() -> Iterator[None]:
    """Stop MuJoCo's timers: they are not used here and take 40 % of a step."""
    before = mujoco.get_mjcb_time()
    mujoco.set_mjcb_time(_no_clock())
    try:
        yield
    finally:
        mujoco.set_mjcb_time(before)


@functools.cache
def _no_clock() -> Callable[[], float]:
    return ctypes.CFUNCTYPE(ctypes.c_double)(("vwt_no_clock", forward_library()))


def _check_finite(angle: Array, where: str) -> None:
    if not np.all(np.isfinite(angle)) or np.max(np.abs(angle)) > 1e3:
        remedy = "check the sign of the damping, and that the total stiffness is positive (Kr > Ka)"
        raise TunnelError("the motion grows without bound", where=where, remedy=remedy)
