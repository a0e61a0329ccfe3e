"""Simulation of single runs and of many runs at once, and what the sensor reads of them.

From the angle of the rod's upper end to the reading of the potentiometer. Simulation of single runs and of many
runs at once.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import mujoco
import numpy as np
from mujoco import batch as mujoco_batch

from tunnel_sim.effects import Effect, EffectChain
from tunnel_sim.engine.model import Model, build_model
from tunnel_sim.physics.moment_law import forward_library
from tunnel_sim.physics.run_settings import Motion, RunSettings, sampling
from tunnel_sim.physics.steps import follow_fastest
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import SensorModel
from tunnel_sim.vocabulary.record import Array, Record
from tunnel_sim.vocabulary.rig import Rig


def read_motion(
    motion: Motion, sensor: SensorModel, rng: np.random.Generator, chain: EffectChain | None = None
) -> Record:
    """The reading y = quantised(β + zero + noise), with the effects that act on sensor and reading.

    Args:
        motion: of the rod's upper end.
        sensor: noise, zero and resolution; with a resolution of 0 the reading is not quantised.

    Returns:
        The record. The ideal converter has an unlimited range: clipping is an effect.
    """
    angle, time = motion.angle, motion.time_s
    if chain is not None and chain.skips:
        time = time[: round(chain.stated.duration / (time[1] - time[0]))]
        angle = chain.seen(motion, time)
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
        reading: rad, any shape.
        step: rad; 0 leaves the reading as it is.

    Returns:
        The rounded reading, rad.
    """
    return np.round(reading / step) * step if step > 0.0 else reading


Progress = Callable[[int, int], None]
_CHUNK_STEPS = 4_000_000  # steps recorded at once, to limit the memory of a large batch


def simulate_motion(model: Model, sample_rate: float) -> Motion:
    """Integrate one run with ``mj_step``.

    Args:
        sample_rate: Hz.

    Raises:
        TunnelError: when the motion grows without bound.
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
) -> Record:
    """Simulate one run as the sensor sees it.

    Raises:
        TunnelError: when the motion grows without bound or the settings are refused.
    """
    chain = EffectChain.draw(settings, effects, rng)
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
        sample_rate: Hz.
        nthread: number of threads; 0 uses all processors.
        progress: called with (runs done, runs in all).

    Raises:
        TunnelError: when the motion of a run grows without bound, its settings are refused, or its fastest motion
            requires too many steps.
    """
    motions: dict[int, Motion] = {}
    settings = [_followed(rig, run, number) for number, run in enumerate(settings, 1)]
    for group in _groups(settings):
        samples, steps = sampling(settings[group[0]], sample_rate)
        size = max(1, _CHUNK_STEPS // (samples * steps))
        for start in range(0, len(group), size):
            chunk = group[start : start + size]
            done = _integrate_chunk(rig, [settings[i] for i in chunk], sample_rate, nthread)
            for index, motion in zip(chunk, done, strict=True):
                _check_finite(motion.angle, f"run {index + 1}")
                motions[index] = motion
            if progress is not None:
                progress(len(motions), len(settings))
    return [motions[i] for i in range(len(settings))]


def _followed(rig: Rig, run: RunSettings, number: int) -> RunSettings:
    try:
        return follow_fastest(rig, run)
    except TunnelError as error:
        raise TunnelError(error.what, where=f"run {number}", remedy=error.remedy) from error


def _groups(settings: Sequence[RunSettings]) -> list[list[int]]:
    """Indices of the runs that can share one compiled model."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, run in enumerate(settings):
        groups.setdefault((run.duration, *run.layout()), []).append(i)
    return list(groups.values())


def _integrate_chunk(rig: Rig, runs: list[RunSettings], sample_rate: float, nthread: int) -> list[Motion]:
    model = build_model(rig, runs[0], drawn=False)
    batch = mujoco_batch.Batch(model.mj, nsim=len(runs), nthread=nthread)
    fields = {
        name: batch.expand(name) for name in ("jnt_stiffness", "dof_damping", "numeric_data", "body_inertia")
    }
    states = {name: batch.bind(name) for name in ("qpos", "qvel", "plugin_state")}
    for i, run in enumerate(runs):
        case = model.with_settings(run)
        for name, values in fields.items():
            values[i] = getattr(case.mj, name)
        data = case.release_state()
        for name, values in states.items():
            values[i] = getattr(data, name)
    batch.set_const()
    samples, steps = sampling(runs[0], sample_rate)
    qpos, qvel = states["qpos"].copy(), states["qvel"].copy()
    with no_log(), no_timers():
        recorded = batch.rollout(nstep=(samples - 1) * steps, record=("qpos", "qvel"))
    at = model.yaw_address
    time = np.arange(samples) / sample_rate
    motions = []
    for i in range(len(runs)):
        angle = np.concatenate([qpos[i, at : at + 1], recorded["qpos"][i, steps - 1 :: steps, at]])
        rate = np.concatenate([qvel[i, at : at + 1], recorded["qvel"][i, steps - 1 :: steps, at]])
        motions.append(Motion(time, angle, rate))
    return motions


@contextmanager
def no_log() -> Iterator[None]:
    """Suppress MuJoCo's warnings on the terminal and in a log file; the caller reports the same."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


@contextmanager
def no_timers() -> Iterator[None]:
    """Stop MuJoCo's timers, which nobody reads here and which take two fifths of a step."""
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
        raise TunnelError(
            "the motion grows without bound",
            where=where,
            remedy="check the sign of the damping, and that the total stiffness is positive (Kr > Ka)",
        )
