"""Waiting times before and after a change: every job of the time limits, in turn.

Run as ``python -m benchmarks.waiting OLD NEW``; see README.md beside it. Each measurement runs in a separate
process in the measured tree, with the tree's own environment if it has one.
"""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.speed import arguments_of, printed, python_of, timed
from tunnel_reference.draw import CampaignDraw, EffectDraw, draw_conditions
from tunnel_reference.forms import FORMS
from tunnel_reference.make import as_campaign
from tunnel_reference.severity import read_and_fit, simulate_motions
from tunnel_sim.files.campaign_folder import write_campaign
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Record

GROWTH = (12, 48, 144)  # runs
FRICTION = 0.004  # N m
#: A link that moves up and down; the user's model lacks the rotor and the losses of the gear.
ARM = """<mujoco><option timestep="0.001" integrator="RK4"/><worldbody><body>
<joint name="elbow" axis="0 1 0" {}/><geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.02" mass="1.5"/></body>
</worldbody><actuator><motor name="motor" joint="elbow" gear="20"/></actuator></mujoco>"""
GEAR = 'armature="0.05" damping="0.4" frictionloss="0.6" solreffriction="0.002 1"'
LATE = 12  # number of samples by which the motor acts late, ms
#: The beginning of the code of a process.
HERE = "import json, os, sys, time; sys.path.insert(0, os.getcwd())\n"
#: Prints the modules imported by a diagnosis of a folder without a gap.
MODULES = (
    HERE
    + """
from diagnosis import diagnose
from tunnel_sim.files.campaign_folder import read_campaign
import tunnel_lab.cli, tunnel_lab.commands.diagnose
diagnose(read_campaign(sys.argv[1]))
ours = ("diagnosis", "tunnel_sim", "tunnel_lab", "identification", "numpy", "scipy", "rich", "typer")
print(json.dumps([name for name in list(sys.modules) if name.partition(".")[0] in ours]))
"""
)
#: Imports modules named in a list.
IMPORTS = (
    HERE
    + """
import importlib
for name in json.loads(sys.argv[1]):
    try:
        importlib.import_module(name)
    except ImportError:
        pass
"""
)
#: Repeats linearisations of a diagnosis, and as many predictions. Prints the cost of a Gauss–Newton step in
#: predictions, by number of parameters, and counts of the diagnosis.
STEPS = (
    HERE
    + """
import collections, statistics
import numpy as np
import diagnosis.likelihood.least_squares as least_squares
import diagnosis.likelihood.motions as motions
from diagnosis import diagnose
from diagnosis.likelihood.problem import Problem
from tunnel_sim.files.campaign_folder import read_campaign
linearise, calls = least_squares.sensitivities, []
def kept(problem, point, base=None, prediction=None):
    if base is None:
        calls.append((problem, point, prediction))
    counts["linearisations"] += 1
    return linearise(problem, point, base, prediction)
counts, predict, integrate = collections.Counter(), Problem.predict, motions.integrate
def counted(self, points):
    counts["predictions"] += len(points)
    return predict(self, points)
def stepped(law, rows, samples):
    counts["runs"] += len(rows)
    counts["steps"] += int(np.sum(samples * rows["steps"] / np.maximum(rows["stride"], 1)))
    return integrate(law, rows, samples)
least_squares.sensitivities, Problem.predict, motions.integrate = kept, counted, stepped
campaign = read_campaign(sys.argv[1])
begun = time.process_time()
diagnose(campaign)
counts["seconds"] = time.process_time() - begun
least_squares.sensitivities, Problem.predict = linearise, predict
ratios = collections.defaultdict(list)
for problem, point, prediction in calls[::2]:
    taken = []
    for work in (lambda: problem.predict([point]), lambda: linearise(problem, point, None, prediction)):
        work()
        begun = time.process_time()
        work()
        taken.append(time.process_time() - begun)
    ratios[len(problem.names) + point.per_run.shape[1]].append(1.0 + taken[1] / taken[0])
print(json.dumps({"counts": counts, "ratios": {p: statistics.median(r) for p, r in sorted(ratios.items())}}))
"""
)
#: Prints the nanoseconds of the bare integrator for a step of one of eight smooth runs side by side.
RATE = (
    HERE
    + """
import numpy as np
from tunnel_sim.physics.forward import integrate
from tunnel_sim.physics.moment_law import parameter_names, run_dtype
law, rows, wind = np.zeros((8, len(parameter_names()))), np.zeros(8, run_dtype()), np.zeros(1)
for name, value in {"spring_stiffness": 16.0, "mechanical_damping": 0.01, "yaw_inertia": 0.1}.items():
    law[:, parameter_names().index(name)] = value
rows["wind"], rows["wind_count"], rows["angle"], rows["step"], rows["steps"] = wind.ctypes.data, 1, 0.3, 0.008, 1
taken = []
for _ in range(30):
    begun = time.thread_time()
    integrate(law, rows, 20000)
    taken.append(time.thread_time() - begun)
print(json.dumps({"value": min(taken) / 160000 * 1e9}))
"""
)


@dataclass(frozen=True)
class Measurement:
    """A job: its name, the unit of its values, and its measurement in a tree."""

    name: str
    unit: str
    of: Callable[[Path], float]


def elapsed(command: list[str], tree: Path) -> float:
    """Wall time of a command in a tree, s; status 1 also counts as an answer."""
    begun = time.perf_counter()
    done = subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False)
    if done.returncode > 1:
        raise RuntimeError(done.stderr)
    return time.perf_counter() - begun


def friction(runs: int, folder: Path) -> Path:
    """A campaign with dry friction, drawn by the reference simulator."""
    once = draw_conditions(np.random.default_rng(1))
    places = np.arange(runs) % once.runs
    fields = {
        field.name: value[places]
        for field in dataclasses.fields(once)
        if isinstance(value := getattr(once, field.name), np.ndarray) and value.shape == (once.runs,)
    }
    spread = 1.0 + 0.03 * np.random.default_rng(2).standard_normal(runs)
    conditions = dataclasses.replace(once, **{**fields, "start_angle": once.release_angle[places] * spread})
    form = next(form for form in FORMS if form.family == "coulomb_friction")
    draw = CampaignDraw("single", conditions, (EffectDraw(form, {}, 1, 1.0, FRICTION),), seed=3)
    simulated = read_and_fit(draw, simulate_motions([draw])[0])
    return write_campaign(as_campaign(simulated, f"friction-{runs}"), folder)


def joint(folder: Path) -> tuple[Path, Path]:
    """A campaign of a joint with two faults, friction and a late motor, by plain MuJoCo, and the user's model."""
    rng, time_s, runs = np.random.default_rng(1), 1e-3 * np.arange(18_000), []
    truth = mujoco.MjModel.from_xml_string(ARM.format(GEAR))
    for number, peak in enumerate((0.3, 0.2, 0.25, 0.35)):
        turns = np.outer(time_s, np.arange(0.2, 4.0, 0.1))  # lines from 0.2 to 4 Hz
        control = np.sin(2.0 * np.pi * (turns + rng.uniform(size=turns.shape[1]))).sum(axis=1)
        control *= peak / np.abs(control).max()
        data, angle = mujoco.MjData(truth), np.empty(time_s.size)
        data.qpos[0] = np.pi / 2
        for place, value in enumerate(np.concatenate([np.full(LATE, control[0]), control[:-LATE]])):
            angle[place], data.ctrl[0] = data.qpos[0], value
            mujoco.mj_step(truth, data)
        record = Record(time_s, angle + rng.normal(0.0, 2e-4, angle.size))
        runs.append(Run(f"r{number}", record, 0.0, drive=Input("drive", control, "zero")))
    campaign = Campaign("joint", RigProperties(), SensorProperties(1000.0), tuple(runs))
    model = folder.with_suffix(".xml")
    model.write_text(ARM.format(""))
    return write_campaign(campaign, folder), model


def diagnosed(name: str, folder: Path, *model: str) -> Iterator[Measurement]:
    """Processor seconds and peak memory of a diagnosis.

    Args:
        model: file and joint of the user's model; empty: none.
    """
    cache: dict[Path, dict[str, float]] = {}

    def seconds(tree: Path) -> float:
        cache[tree] = timed(tree, folder, *model)
        return cache[tree]["seconds"]

    yield Measurement(name, "CPU s", seconds)
    yield Measurement(f"{name}, peak memory", "MiB", lambda tree: cache[tree]["peak"])


def waited(folder: Path) -> Iterator[Measurement]:
    """Wall time of `tunnel diagnose`, and the share of the imports."""

    def command(tree: Path) -> float:
        return elapsed([python_of(tree), "-m", "tunnel_lab", "diagnose", str(folder)], tree)

    def imports(tree: Path) -> float:
        modules = printed(tree, MODULES, str(folder))
        return elapsed([python_of(tree), "-c", IMPORTS, modules], tree)

    yield Measurement("`tunnel diagnose` without a gap", "s", command)
    yield Measurement("its imports", "s", imports)


def demo() -> Iterator[Measurement]:
    """The run of the demo, without the installation."""

    def command(tree: Path) -> float:
        with tempfile.TemporaryDirectory() as out:
            return elapsed([python_of(tree), "-m", "tunnel_lab", "demo", "--out", out], tree)

    yield Measurement("`tunnel demo`", "s", command)


def percentile(folders: list[Path]) -> Iterator[Measurement]:
    """The 90th percentile of the processor seconds over a set."""

    def seconds(tree: Path) -> float:
        taken = [timed(tree, folder)["seconds"] for folder in folders]
        return float(np.quantile(taken, 0.9))

    yield Measurement(f"90th percentile of {len(folders)} campaigns", "CPU s", seconds)


def compared(measurement: Measurement, trees: list[Path], turns: int) -> list[str]:
    """The row of a job: medians of both trees, and the median of their ratios within a turn."""
    found = np.array([[measurement.of(tree) for tree in trees] for _ in range(turns)])
    old, new = np.median(found, axis=0)
    ratio = np.median(found[:, 1] / found[:, 0])
    return [measurement.name, measurement.unit, f"{old:.2f}", f"{new:.2f}", f"{ratio:.2f}"]


def on_paper(tree: Path, folder: Path, rate: float) -> list[str]:
    """The least integration of a diagnosis, one pass through all runs for each step of its fits.

    Args:
        rate: time of the bare integrator, ns per step.
    """
    found: Mapping[str, Mapping[str, float]] = json.loads(printed(tree, STEPS, str(folder)))
    counts = found["counts"]
    steps = (
        counts["linearisations"]
        * counts["steps"]
        / max(counts["runs"], 1)
        * len(list((folder / "runs").iterdir()))
    )
    least = steps * rate * 1e-9
    ratios = ", ".join(f"{number}: {ratio:.1f}" for number, ratio in found["ratios"].items())
    return [
        folder.name, f"{counts['linearisations']:.0f}", f"{counts['predictions']:.0f}", f"{steps / 1e6:.0f}",
        f"{least:.2f}", f"{counts['seconds']:.1f}", f"{counts['seconds'] / least:.1f}", ratios,
    ]  # fmt: skip


def main() -> None:
    """Measure all jobs and print two tables."""
    parser = arguments_of(prog="python -m benchmarks.waiting", description=__doc__)
    parser.add_argument(
        "--campaign", type=Path, action="append", default=[], help="a folder to diagnose; repeat"
    )
    parser.add_argument(
        "--still", type=Path, help="a folder without a gap, for `tunnel diagnose` by the clock"
    )
    parser.add_argument("--set", type=Path, help="a folder of campaign folders, for the 90th percentile")
    parser.add_argument("--set-turns", type=int, default=1, help="turns of the set (default: 1)")
    parser.add_argument("--growth", action="store_true", help="campaigns of 12, 48 and 144 runs")
    parser.add_argument("--joint", action="store_true", help="a robot's joint with two faults")
    parser.add_argument("--demo", action="store_true", help="the demo")
    parser.add_argument(
        "--paper", type=Path, action="append", default=[], help="a folder for the limit; repeat"
    )
    asked = parser.parse_args()
    trees = [asked.old.resolve(), asked.new.resolve()]
    table = Table(title=f"Medians of {asked.turns} turns")
    for head in ("job", "unit", "old", "new", "new/old"):
        table.add_column(head, justify="left" if head in ("job", "unit") else "right")
    with tempfile.TemporaryDirectory() as written:
        jobs = [
            (one, asked.turns)
            for folder in asked.campaign
            for one in diagnosed(folder.name, folder.resolve())
        ]
        for runs in GROWTH if asked.growth else ():
            folder = friction(runs, Path(written) / f"runs{runs}")
            jobs += [(one, asked.turns) for one in diagnosed(f"{runs} runs of dry friction", folder)]
        if asked.joint:
            folder, model = joint(Path(written) / "joint")
            jobs += [
                (one, asked.turns) for one in diagnosed("joint, two faults", folder, str(model), "elbow")
            ]
        jobs += [(one, asked.turns) for one in (waited(asked.still.resolve()) if asked.still else ())]
        jobs += [(one, asked.turns) for one in (demo() if asked.demo else ())]
        if asked.set:
            folders = sorted(path.parent.resolve() for path in asked.set.glob("*/campaign.toml"))
            jobs += [(one, asked.set_turns) for one in percentile(folders)]
        for measurement, turns in jobs:
            row = compared(measurement, trees, turns)
            table.add_row(*row)
            print("  ".join(row), file=sys.stderr, flush=True)  # of a long table, as it grows
    Console().print(table)
    if asked.paper:
        rate = json.loads(printed(trees[1], RATE))["value"]
        limits = Table(title=f"The limit on paper, with {rate:.1f} ns a step of one of eight smooth runs")
        for head in (
            "campaign", "steps of fits", "predictions", "10⁶ steps at least", "least, s", "taken, CPU s",
            "taken/least", "predictions in a step of a fit, by parameters",
        ):  # fmt: skip
            limits.add_column(
                head, justify="left" if head.startswith(("campaign", "predictions in")) else "right"
            )
        for folder in asked.paper:
            for tree in trees:
                limits.add_row(*on_paper(tree, folder.resolve(), rate))
        Console(width=200).print(limits)


if __name__ == "__main__":
    main()
