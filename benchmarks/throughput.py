"""Throughput of the rig's model: with the plugin against without, and batches on two threads against one.

Run as ``python -m benchmarks.throughput``; see README.md beside it. Every repetition measures both sides one
after the other, so other load on the machine affects both; ratios are taken within repetitions.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from statistics import median

import mujoco
import numpy as np
from mujoco import batch as mujoco_batch
from rich.console import Console
from rich.table import Column, Table

from tunnel_sim.engine.model import build_model, build_spec
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.run_settings import RodTwist, RunSettings
from tunnel_sim.vocabulary.plan import AeroDerivatives

LINEAR = RunSettings(
    16.12, AeroDerivatives(0.35, -0.7), 0.1014, 0.018, wind_speed=20.0, air_density=1.204, release_angle=0.3
)
EVERYTHING = {
    "aero_lag": 2.0, "friction_moment": 0.01, "moment_cubic": 1.0, "damping_quadratic": 1.0,
    "quadratic_damping": 0.01, "stiffness_cubic": 1.0, "free_play": 0.001, "gravity_stiffness": 0.1,
    "shedding_amplitude": 0.01, "strouhal_number": 0.2,
}  # fmt: skip
SIMULATIONS = 32


def without_plugin(settings: RunSettings) -> mujoco.MjModel:
    """The same model, without the plugin and its sensor."""
    spec = build_spec(load_rig(), settings)
    spec.delete(spec.sensor("aerodynamic_moment"))
    for plugin in list(spec.plugins):
        spec.delete(plugin)
    model = spec.compile()
    if model.nplugin:
        raise RuntimeError("the plugin is still in the model")
    return model


def stepping(model: mujoco.MjModel, steps: int) -> Callable[[], float]:
    """A repetition on one thread: CPU time of `steps` steps, s."""
    data = mujoco.MjData(model)

    def repetition() -> float:
        mujoco.mj_resetData(model, data)
        data.qpos[0] = LINEAR.release_angle
        begin = time.thread_time()
        mujoco.mj_step(model, data, steps)
        return time.thread_time() - begin

    return repetition


def batching(model: mujoco.MjModel, steps: int, threads: int) -> Callable[[], float]:
    """A repetition of `SIMULATIONS` simulations on a pool: elapsed time, s."""
    batch = mujoco_batch.Batch(model, nsim=SIMULATIONS, nthread=threads)
    angles = batch.bind("qpos")

    def repetition() -> float:
        batch.reset()
        angles[:, 0] = np.linspace(0.1, 0.3, SIMULATIONS)
        begin = time.perf_counter()
        batch.step(nstep=steps)
        return time.perf_counter() - begin

    return repetition


def plain_threads(model: mujoco.MjModel, steps: int, threads: int) -> Callable[[], float]:
    """The same work on Python threads without mujoco.batch, as a measure of the machine: elapsed time, s."""
    data = [mujoco.MjData(model) for _ in range(threads)]

    def share(one: mujoco.MjData) -> None:
        for _ in range(SIMULATIONS // threads):
            mujoco.mj_resetData(model, one)
            mujoco.mj_step(model, one, steps)  # releases the interpreter's lock

    def repetition() -> float:
        begin = time.perf_counter()
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(share, data))
        return time.perf_counter() - begin

    return repetition


def numbers(title: str, name: str, *heads: str) -> Table:
    """A table of numbers, aligned to the right of a name."""
    return Table(name, *(Column(head, justify="right") for head in heads), title=title)


def interleaved(
    one: Callable[[], float], other: Callable[[], float], repetitions: int
) -> tuple[list[float], list[float]]:
    """Times of both, measured in turn; the first turn warms up and is discarded."""
    times: tuple[list[float], list[float]] = ([], [])
    for turn in range(repetitions + 1):
        order = (0, 1) if turn % 2 else (1, 0)
        for side in order:
            elapsed = (one, other)[side]()
            if turn:
                times[side].append(elapsed)
    return times


def ratio(one: list[float], other: list[float]) -> tuple[float, float]:
    """Speed of the second relative to the first: median over repetitions, and ratio of the best times."""
    return median(a / b for a, b in zip(one, other, strict=True)), min(one) / min(other)


def row(
    table: Table, name: str, steps: int, baseline: list[float], subject: list[float], target: str
) -> None:
    """One line: speeds by the medians, ratio within the repetitions and of the best."""
    middle, best = ratio(baseline, subject)
    speeds = [f"{steps / median(times):,.0f}" for times in (baseline, subject)]
    table.add_row(name, *speeds, f"{middle:.3f}", f"{best:.3f}", target)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.throughput", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--steps", type=int, default=20_000, help="steps of each repetition on one thread")
    parser.add_argument("--repetitions", type=int, default=25, help="repetitions of each side")
    options = parser.parse_args()
    steps, repetitions = options.steps, options.repetitions

    rig = load_rig()
    twist = RodTwist(1e-3, 0.3)
    linear = build_model(rig, LINEAR).mj
    busy = build_model(rig, replace(LINEAR, parameters=EVERYTHING)).mj
    rod = replace(LINEAR, rod_twist=twist)
    heads = ("comparison", "baseline", "subject", "ratio (median)", "ratio (best)", "target")
    table = numbers("Throughput, RK4 steps per second", *heads)

    def single(name: str, subject: mujoco.MjModel, settings: RunSettings, target: str) -> None:
        bare = stepping(without_plugin(settings), steps)
        row(table, name, steps, *interleaved(bare, stepping(subject, steps), repetitions), target)

    single("plugin against none", linear, LINEAR, "≥ 0.955")
    single("the same, rod that twists", build_model(rig, rod).mj, rod, "")
    single("every term of the law against none", busy, LINEAR, "≥ 0.90")
    each = max(1, steps // 20)
    for name, kind, goal in (
        ("batch, two threads against one", batching, "≥ 1.8"),
        ("two plain threads against one", plain_threads, "(the machine's)"),
    ):
        times = interleaved(kind(linear, each, 1), kind(linear, each, 2), 2 * repetitions)
        row(table, name, each * SIMULATIONS, *times, goal)
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
