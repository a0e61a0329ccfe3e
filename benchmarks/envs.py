"""Steps per second of FreeDecay-v0, native against bare mujoco.batch and Gymnasium's async, and of Campaign-v0.

Run as ``python -m benchmarks.envs``; see README.md beside it. Both sides of a ratio are measured in turn.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import gymnasium
import mujoco
import numpy as np
from mujoco import batch as mujoco_batch
from rich.console import Console
from rich.table import Table

import tunnel_sim.envs  # noqa: F401  registers the environments
from benchmarks.throughput import interleaved, numbers, ratio
from tunnel_sim.engine.model import build_model
from tunnel_sim.envs.episode_conditions import FreeDecayConfig, plan_run
from tunnel_sim.files.rig_file import load_rig

NAME = "tunnel_sim/FreeDecay-v0"
DURATION = 60.0  # s, too long for a run to end during the timing


def bare(count: int, periods: int, substeps: int) -> Callable[[], float]:
    """A repetition of ``mujoco.batch`` alone, without reading, drawing or recording: elapsed time, s."""
    rig = load_rig()
    plan = plan_run({}, FreeDecayConfig(), rig, np.random.default_rng(0))
    batch = mujoco_batch.Batch(build_model(rig, plan.stated()).mj, nsim=count)
    batch.bind("qpos")[:, 0] = np.linspace(0.1, 0.3, count)

    def repetition() -> float:
        begin = time.perf_counter()
        for _ in range(periods):
            batch.step(nstep=substeps)
        return time.perf_counter() - begin

    return repetition


def stepping(envs: Any, periods: int, clock: Callable[[], float] = time.perf_counter) -> Callable[[], float]:
    """A repetition of ``step`` with sampled actions: time by the clock, s."""
    envs.action_space.seed(1)
    actions = [envs.action_space.sample() for _ in range(periods)]

    def repetition() -> float:
        envs.reset(seed=1)
        begin = clock()
        for action in actions:
            envs.step(action)
        return clock() - begin

    return repetition


def processor_time(envs: Any) -> Callable[[], float]:
    """Processor time of this process and an async environment's workers, s (Linux)."""
    files = [Path(f"/proc/{worker.pid}/stat") for worker in getattr(envs, "processes", [])]

    def clock() -> float:
        spent = [file.read_text().rpartition(")")[2].split()[11:13] for file in files]
        ticks = sum(int(part) for parts in spent for part in parts)
        return time.process_time() + ticks / os.sysconf("SC_CLK_TCK")

    return clock


def vector(count: int, mode: str, preset: str) -> Any:
    """A vector environment of one kind."""
    arguments = {"preset": preset, "duration": DURATION}
    if preset == "operator":
        arguments["wind_limit"] = 20.0  # sampled set-points stay within the stable range
        arguments["moment_limit"] = 0.05
    return gymnasium.make_vec(NAME, num_envs=count, vectorization_mode=mode, **arguments)


def alone(table: Table, repetitions: int) -> None:
    """Steps per second of processor time of one environment, Pendulum-v1 and bare MuJoCo, in turn."""
    options = {"wind_limit": 20.0, "moment_limit": 0.05, "duration": DURATION}
    env = gymnasium.make(NAME, **options)
    env.reset(seed=1)
    plan = plan_run({}, FreeDecayConfig(), load_rig(), np.random.default_rng(0))
    model = build_model(load_rig(), plan.stated())

    def bare_steps() -> float:
        data, begin = model.release_state(), time.process_time()
        for _ in range(500):
            mujoco.mj_step(model.mj, data, 10)
        return time.process_time() - begin

    sides = {
        "mj_step of the rig's model, ten substeps": bare_steps,
        "Pendulum-v1": stepping(gymnasium.make("Pendulum-v1"), 500, time.process_time),
        "FreeDecay-v0": stepping(env, 500, time.process_time),
    }
    times: dict[str, list[float]] = {name: [] for name in sides}
    for _ in range(repetitions):
        for name, side in sides.items():
            times[name].append(side())
    for name, spent in times.items():
        table.add_row(name, f"{500 / median(spent):,.0f}", "≥ 3,000" if name == "FreeDecay-v0" else "")


def campaigns(table: Table) -> None:
    """Runs per second of processor time of Campaign-v0, with sampled actions."""
    for kind, count, aim in (("full", 20, ""), ("linear", 400, "≥ 100")):
        env = gymnasium.make("tunnel_sim/Campaign-v0", simulation=kind)
        env.action_space.seed(1)
        env.reset(seed=1)
        begin = time.process_time()
        for _ in range(count):
            *_, terminated, truncated, _ = env.step(env.action_space.sample())
            if terminated or truncated:
                env.reset()
        table.add_row(kind, str(count), f"{count / (time.process_time() - begin):.0f}", aim)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.envs", description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=256, help="runs in parallel, against mujoco.batch")
    parser.add_argument("--workers", type=int, default=32, help="runs in parallel, against async")
    parser.add_argument("--periods", type=int, default=40, help="control periods of a repetition")
    parser.add_argument("--repetitions", type=int, default=9, help="repetitions of each side")
    options = parser.parse_args()

    table = numbers(
        "FreeDecay-v0, control periods of 10 ms (ten RK4 steps) per second, all runs together",
        "comparison", "runs", "baseline", "subject", "ratio (median)", "ratio (best)", "target",
    )  # fmt: skip

    def line(name: str, count: int, one: Callable[[], float], other: Callable[[], float], aim: str) -> None:
        times = interleaved(one, other, options.repetitions)
        speeds = [f"{count * options.periods / median(side):,.0f}" for side in times]
        middle, best = ratio(*times)
        table.add_row(name, str(count), *speeds, f"{middle:.2f}", f"{best:.2f}", aim)

    for preset in ("plain", "operator"):
        envs = vector(options.count, "vector_entry_point", preset)
        sides = (bare(options.count, options.periods, 10), stepping(envs, options.periods))
        aim = "≥ 0.7" if preset == "plain" else ""
        line(f"{preset}: native against mujoco.batch", options.count, *sides, aim)
        envs.close()
    for preset in ("plain", "operator"):
        native = vector(options.workers, "vector_entry_point", preset)
        workers = vector(options.workers, "async", preset)
        sides = (stepping(workers, options.periods), stepping(native, options.periods))
        line(f"{preset}: native against async", options.workers, *sides, "≥ 5" if preset == "plain" else "")
        if Path("/proc/self/stat").exists():
            timed = [stepping(envs, options.periods, processor_time(envs)) for envs in (workers, native)]
            line("the same by processor time", options.workers, timed[0], timed[1], "")
        workers.close()
        native.close()
    Console(width=118).print(table)
    table = Table("one environment", "steps per second of processor time", "target", title="FreeDecay-v0")
    alone(table, options.repetitions)
    Console(width=118).print(table)
    table = Table("simulation", "runs", "runs per second of processor time", "target", title="Campaign-v0")
    campaigns(table)
    Console(width=118).print(table)


if __name__ == "__main__":
    main()
