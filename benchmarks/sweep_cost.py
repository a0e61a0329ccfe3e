"""A sweep from end to end against the bare simulation of its runs, processes against threads, and memory.

Run as ``python -m benchmarks.sweep_cost``; see README.md beside it. Every sweep runs in a separate process,
including its start. The bare rate is for ``mujoco.batch`` stepping the same runs without
recording, on as many threads.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

SWEEP = """
name = "benchmark"
seed = 1
replicates = {replicates}
estimators = [{estimators}]
records = {records}

[conditions]
springs = [5, 8]
wind_speeds = [0.0, 15.0]
release_angles_deg = [20.0]
duration = 10.0

[truth]
cn_beta = 0.4719
cn_r = -0.1033

[sensor]
noise_std = [0.0001, 0.0002, 0.0005, 0.001, 0.002]

[[effects]]
name = "none"
[[effects]]
name = "coulomb_friction"
parameters = {{ friction_moment = [0.002, 0.004] }}
[[effects]]
name = "quadratic_damping"
parameters = {{ coefficient = [0.001, 0.002] }}
"""
RUNS_PER_REPLICATE = 5 * 5 * 4
STEPS = 9_999  # between the samples of 10 s at 1 kHz
BARE_RUNS = 100


def bare(file: Path, threads: int) -> dict[str, float]:
    """Seconds per run of `mujoco.batch` on runs of the sweep with all its conditions and effects."""
    import numpy as np
    from mujoco import batch as mujoco_batch

    from tunnel_lab.experiments.sweep import read_sweep
    from tunnel_sim.effects import EffectChain
    from tunnel_sim.engine.model import build_model
    from tunnel_sim.engine.virtual_campaign import plan_effects, run_settings

    sweep, rng = read_sweep(file), np.random.default_rng(1)
    step = max(1, sweep.size // (BARE_RUNS // 4))
    cases = [sweep.case(place) for place in range(0, sweep.size, step)][: BARE_RUNS // 4]
    runs = [
        EffectChain.draw(run_settings(case.plan.truth, condition), plan_effects(case.plan), rng).physics()
        for case in cases
        for condition in case.plan.conditions
    ]
    model = build_model(cases[0].rig, runs[0])
    batch = mujoco_batch.Batch(model.mj, nsim=len(runs), nthread=threads)
    names = ("jnt_stiffness", "dof_damping", "numeric_data", "body_inertia")
    fields = {name: batch.expand(name) for name in names}
    states = {name: batch.bind(name) for name in ("qpos", "qvel", "plugin_state")}
    for place, run in enumerate(runs):
        case = model.with_settings(run)
        for name, values in fields.items():
            values[place] = getattr(case.mj, name)
        data = case.release_state()
        for name, values in states.items():
            values[place] = getattr(data, name)
    batch.set_const()
    wall, cpu = time.perf_counter(), time.process_time()
    batch.step(nstep=STEPS)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return {"wall": wall / len(runs), "cpu": cpu / len(runs)}


def sweep(file: Path, out: Path, workers: int, threads: int) -> dict[str, float]:
    """Seconds per run and peak memory of a sweep, with several processes or with simulation threads in one."""
    wall, cpu = time.perf_counter(), time.process_time()
    from tunnel_lab.experiments.experiment import run_in
    from tunnel_lab.experiments.runner import processes
    from tunnel_lab.experiments.sweep import read_sweep, sweep_of
    from tunnel_lab.experiments.sweep_work import run_shard

    plan = read_sweep(file)
    experiment = sweep_of(plan)
    if threads > 1:
        experiment = replace(experiment, work=partial(run_shard, plan, nthread=threads))
    run_in(experiment, out, processes(0 if threads > 1 else workers, print))
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = time.process_time() - cpu + children.ru_utime + children.ru_stime
    return {
        "wall": (time.perf_counter() - wall) / plan.runs,
        "cpu": cpu / plan.runs,
        "parent": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "worker": children.ru_maxrss / 1024,
    }


def apart(*words: str | int | Path) -> dict[str, float]:
    """One measurement in a separate process."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.sweep_cost", *map(str, words)],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return dict(json.loads(done.stdout.splitlines()[-1]))


def write(folder: Path, runs: int, estimators: str) -> Path:
    names = ", ".join(f'"{name}"' for name in estimators.split("+") if name)
    file = folder / f"{estimators or 'simulate'}-{runs}.toml"
    text = SWEEP.format(
        replicates=max(1, runs // RUNS_PER_REPLICATE), estimators=names, records="false" if names else "true"
    )
    file.write_text(text, encoding="utf-8")
    return file


def between(
    file: Path, out: Path, options: argparse.Namespace, workers: int, threads: int
) -> tuple[dict[str, float], float, float]:
    """A sweep between two bare simulations, and the ratio of the rates: elapsed and CPU."""
    before = apart("--bare", file, "--workers", options.workers)
    took = apart("--sweep", file, out, "--workers", workers, "--threads", threads)
    after = apart("--bare", file, "--workers", options.workers)
    wall, cpu = ((before[key] + after[key]) / 2.0 / took[key] for key in ("wall", "cpu"))
    return took, wall, cpu


def compare(folder: Path, options: argparse.Namespace) -> None:
    """Each kind of sweep and the bare rate, in turn."""
    kinds = {
        "simulate only, records kept": ("", options.workers, 1),
        "conventional": ("conventional", options.workers, 1),
        "conventional, threads": ("conventional", 1, options.workers),
        "output_error": ("output_error", options.workers, 1),
        "both": ("conventional+output_error", options.workers, 1),
    }
    found: dict[str, list[tuple[float, float, float]]] = {}
    for turn in range(options.turns):
        for name, (estimators, workers, threads) in kinds.items():
            file = write(folder, options.small, estimators)
            took, *rates = between(file, folder / f"{turn}-{name}", options, workers, threads)
            found.setdefault(name, []).append((*rates, 1e3 * took["cpu"]))
    print(f"{options.small} runs of 10 s on {options.workers} processors, median of {options.turns} turns")
    for name, turns in found.items():
        wall, cpu, each = (median(column) for column in zip(*turns, strict=True))
        print(f"  {name:30s} rate / bare {wall:5.2f} elapsed, {cpu:5.2f} CPU; {each:6.1f} ms CPU a run")


def grow(folder: Path, options: argparse.Namespace) -> None:
    """Rate and peak memory at two sizes."""
    for runs in (options.large // 10, options.large):
        file = write(folder, runs, "conventional")
        took, wall, cpu = between(file, folder / f"grow-{runs}", options, options.workers, 1)
        print(
            f"{runs} runs, conventional: rate / bare {wall:.2f} elapsed, {cpu:.2f} CPU; "
            f"{1e3 * took['wall']:.1f} ms elapsed and {1e3 * took['cpu']:.1f} ms CPU a run; "
            f"peak {took['parent']:.0f} MiB parent, {took['worker']:.0f} MiB worker",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.sweep_cost", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--small", type=int, default=400, help="runs of each sweep that is compared in turn")
    parser.add_argument("--turns", type=int, default=3, help="turns")
    parser.add_argument("--large", type=int, default=10_000, help="runs of the largest sweep")
    parser.add_argument("--only", choices=("compare", "grow"), help="one half of it")
    parser.add_argument("--workers", type=int, default=2, help="processors")
    parser.add_argument("--threads", type=int, default=1, help=argparse.SUPPRESS)
    parser.add_argument("--bare", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--sweep", type=Path, nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.bare:
        print(json.dumps(bare(options.bare, options.workers)))
    elif options.sweep:
        print(json.dumps(sweep(*options.sweep, options.workers, options.threads)))
    else:
        with tempfile.TemporaryDirectory() as folder:
            if options.only != "grow":
                compare(Path(folder), options)
            if options.only != "compare":
                grow(Path(folder), options)


if __name__ == "__main__":
    main()
