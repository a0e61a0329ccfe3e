"""Processor seconds of a diagnosis before and after a change, in turn.

Run as ``python -m benchmarks.speed OLD NEW``; see README.md beside it. Each diagnosis runs in a separate process in
the measured tree, with the tree's own environment if it has one. Imports are not counted.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.diagnosis import make_campaign
from tunnel_sim.files.campaign_folder import write_campaign
from tunnel_sim.vocabulary.plan import EffectSetting

SPRINGS = (16.12, 35.02, 67.98)
FRICTION = EffectSetting("coulomb_friction", {"friction_moment": 0.004})
CUBIC = EffectSetting("cubic_stiffness", {"coefficient": 0.4})
DAMPING = EffectSetting("nonlinear_yaw_damping", {"coefficient": 4.0})
LAG = EffectSetting("unsteady_aero_lag", {"lag": 1.0})
JOBS: dict[str, tuple[EffectSetting, ...]] = {
    "12 runs, no cause": (),
    "12 runs, one cause": (FRICTION,),
    "12 runs, three causes": (FRICTION, CUBIC, DAMPING),
    "12 runs, four causes": (FRICTION, CUBIC, DAMPING, LAG),
}
#: The code of a process: it diagnoses a folder, perhaps with a model and the name of its joint, and prints
#: processor seconds, peak MiB, and the causes.
TIMED = """
import json, os, re, sys
sys.path.insert(0, os.getcwd())
from diagnosis import diagnose, read_model
from tunnel_sim.files.campaign_folder import read_campaign
campaign = read_campaign(sys.argv[1])
before = os.times()
answer = diagnose(campaign, model=read_model(*sys.argv[2:], campaign) if sys.argv[2:] else None)
after = os.times()
seconds = after.user - before.user + after.system - before.system
# of this process alone; the kernel's count for getrusage begins with that of the parent
peak = int(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1]) / 1024.0
print(json.dumps({"seconds": seconds, "peak": peak, "causes": list(answer.causes)}))
"""


def python_of(tree: Path) -> str:
    """The interpreter of a tree."""
    own = tree / ".venv/bin/python"
    return str(own) if own.exists() else sys.executable


def printed(tree: Path, code: str, *arguments: str) -> str:
    """The last line of output of some code in a tree."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [python_of(tree), "-c", code, *arguments],
        cwd=tree, env=environment, check=True, capture_output=True, text=True,
    )  # fmt: skip
    return done.stdout.splitlines()[-1] if done.stdout else ""


def timed(tree: Path, folder: Path, *model: str) -> dict[str, Any]:
    """One diagnosis of a campaign's folder with the code of a tree: seconds, MiB, and causes.

    Args:
        model: file and joint of the user's model; empty: none.
    """
    found: dict[str, Any] = json.loads(printed(tree, TIMED, str(folder), *model))
    return found


def arguments_of(prog: str, description: str | None) -> argparse.ArgumentParser:
    """The options of a comparison of two trees."""
    parser = argparse.ArgumentParser(
        prog=prog, description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("old", type=Path, metavar="OLD", help="a tree of the code before")
    parser.add_argument("new", type=Path, metavar="NEW", help="a tree of the code after")
    parser.add_argument("--turns", type=int, default=5, help="turns of every job (default: 5)")
    return parser


def compared(name: str, folder: Path, trees: list[Path], turns: int) -> list[str]:
    """The row of a job: medians of both trees, the median of their ratios in a turn, memory and answers."""
    found = [[timed(tree, folder) for tree in trees] for _ in range(turns)]
    seconds = np.array([[one["seconds"] for one in turn] for turn in found])
    old, new = np.median(seconds, axis=0)
    ratio = float(np.median(seconds[:, 1] / seconds[:, 0]))
    peaks = [max(turn[side]["peak"] for turn in found) for side in (0, 1)]
    answers = [", ".join(found[0][side]["causes"]) or "none" for side in (0, 1)]
    same = answers[0] if answers[0] == answers[1] else " → ".join(answers)
    return [
        name,
        f"{old:.1f}",
        f"{new:.1f}",
        f"{ratio:.2f}",
        f"{peaks[0]:.0f}",
        f"{peaks[1]:.0f}",
        same,
    ]


def main() -> None:
    """Measure all jobs and print a table."""
    parser = arguments_of(prog="python -m benchmarks.speed", description=__doc__)
    parser.add_argument("--campaign", type=Path, action="append", default=[], help="a further folder; repeat")
    parser.add_argument("--only", default="", help="jobs whose names contain this")
    asked = parser.parse_args()
    trees = [asked.old.resolve(), asked.new.resolve()]
    table = Table(title=f"Processor seconds of a diagnosis, medians of {asked.turns}")
    for head in ("job", "old, s", "new, s", "new/old", "old, MiB", "new, MiB", "answer"):
        table.add_column(head, justify="left" if head in ("job", "answer") else "right")
    with tempfile.TemporaryDirectory() as written:
        folders = {folder.name: folder.resolve() for folder in asked.campaign}
        for number, (name, effects) in enumerate(JOBS.items()):
            if asked.only in name:
                campaign = make_campaign(effects, springs=SPRINGS, duration=10.0, rate=1000.0)
                folders[name] = write_campaign(campaign, Path(written) / f"job{number}")
        for name, folder in folders.items():
            row = compared(name, folder, trees, asked.turns)
            table.add_row(*row)
            print("  ".join(row), file=sys.stderr, flush=True)  # progress of a long table
    Console().print(table)


if __name__ == "__main__":
    main()
