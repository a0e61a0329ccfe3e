"""Planned drives against free decays: ``python -m docs.studies.planned_drives docs`` fills the page's table.

Both plans of a case take the same rig time. The bounds are from `tunnel plan`; the errors are from estimates of
simulated campaigns, by output error in still air and by filter error in buffeting.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import radians
from pathlib import Path

import numpy as np

from docs.studies.page_text import replaced
from identification import identify
from identification.uncertainty.drive_design import Limits, peak_response, plan_bound, propose_drive
from tunnel_sim.engine.virtual_campaign import simulate_campaign
from tunnel_sim.files.plan_file import EffectTable, PlanDocument, plan_from, read_plan
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.files.writing import write_whole

SEEDS = 40
LIMITS = Limits(moment=0.5, angle=radians(20.0))  # the angle limit equals the release angle
MISTAKE = 0.02  # relative error of the prior guess of Izz
INTENSITY = 0.02  # size of the buffeting: the example of the vocabulary
PAUSE = 60.0  # s of rig time before each record, as `tunnel plan` assumes
PLAN = """
name = "study"
seed = 0
springs = {springs}
wind_speeds = {speeds}
release_angles_deg = [20.0]
repeats = {repeats}
duration = 20.0
truth = {{ cn_beta = 0.4719, cn_r = -0.1033 }}
sensor.sample_rate = 100.0
"""
_FOUR = {"springs": [3, 5, 6, 8], "speeds": [0, 10, 15, 20]}
LONG = "four springs, four speeds, three releases"  # without simulations, to save time
PLANS = {
    "spring 5, 0 and 15 m/s, five releases": {"springs": [5], "speeds": [0, 15], "repeats": 5},
    "spring 5, 0 and 15 m/s, one release": {"springs": [5], "speeds": [0, 15], "repeats": 1},
    LONG: {**_FOUR, "repeats": 3},
    "four springs, four speeds, one release": {**_FOUR, "repeats": 1},
}


@dataclass(frozen=True)
class Case:
    """One plan in one air.

    Args:
        drive: kind and number of frequencies of the planned drive.
        bounds: Cnβ and Cnr of the free decays, then of the planned drive, 1/rad.
        wrong: for a prior guess of Izz 2 % too small or too large, the lesser ratio of Cnr's bounds (1) and the
            larger peak of the response (rad).
        errors: root-mean-square errors of the estimates, in the order of ``bounds``, 1/rad; empty if not simulated.
    """

    plan: str
    air: str
    drive: str
    bounds: tuple[float, float, float, float]
    wrong: tuple[float, float]
    errors: tuple[float, ...] = ()


def document_of(name: str, *, buffeted: bool) -> PlanDocument:
    """The free decays of a case.

    Args:
        name: name in `PLANS`.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plan.toml"
        path.write_text(PLAN.format(**PLANS[name]), encoding="utf-8")
        document = read_plan(path)
    effects = [EffectTable(name="buffeting", parameters={"intensity": INTENSITY})] if buffeted else []
    return document.model_copy(update={"effects": effects})


def compare(name: str, *, buffeted: bool, seeds: int = SEEDS) -> Case:
    """One case.

    Args:
        name: name in `PLANS`.
        seeds: number of simulated campaigns for each plan; 0 gives the bounds alone.
    """
    free, rig = document_of(name, buffeted=buffeted), load_rig()
    duration = free.repeats * (free.duration + PAUSE) - PAUSE
    best = propose_drive(free, rig, LIMITS, duration=duration)
    assert best.drive is not None
    plans = [plan_from(each, rig, name) for each in (free, best)]
    bounds = [plan_bound(plan, rig).std(each) for plan in plans for each in ("cn_beta", "cn_r")]
    drive = best.drive.kind.replace("_", " ")
    if best.drive.frequencies_hz:
        drive += f", {len(best.drive.frequencies_hz)} frequencies"
    estimator = "filter_error" if buffeted else "output_error"
    found: list[float] = []
    for plan in plans if seeds else ():
        errors = []
        for seed in range(seeds):
            estimate = identify(simulate_campaign(replace(plan, seed=seed)), estimator)
            assert estimate.cn_beta is not None
            assert estimate.cn_r is not None
            truth = plan.truth
            errors.append([estimate.cn_beta.value - truth.cn_beta, estimate.cn_r.value - truth.cn_r])
        found += np.sqrt(np.mean(np.square(errors), axis=0)).tolist()
    ratios, peaks = [], []
    for factor in (1.0 - MISTAKE, 1.0 + MISTAKE):
        truth = replace(plans[0].truth, yaw_inertia=factor * plans[0].truth.yaw_inertia)
        decays, moved = (replace(plan, truth=truth) for plan in plans)
        ratios.append(plan_bound(decays, rig).std("cn_r") / plan_bound(moved, rig).std("cn_r"))
        peaks.append(peak_response(moved, rig))
    air, all_bounds = "buffeting" if buffeted else "still", (bounds[0], bounds[1], bounds[2], bounds[3])
    return Case(name, air, drive, all_bounds, (min(ratios), max(peaks)), tuple(found))


def table(cases: Sequence[Case]) -> str:
    """The comparison in Markdown."""
    head = (
        "| plan of free decays | air | planned drive | Cnr, free decays [1/rad] | Cnr, planned [1/rad] | "
        "ratio of Cnr | ratio of Cnβ | Izz 2 % off: ratio of Cnr | peak [rad] |\n" + 9 * "|---" + "|"
    )
    rows = [
        f"| {c.plan} | {c.air} | {c.drive} | {_both(c, '.2g', 1)} | {_both(c, '.2g', 3)} | "
        f"{_both(c, '.2f', 1, 3)} | {_both(c, '.2f', 0, 2)} | {c.wrong[0]:.2f} | {c.wrong[1]:.2f} |"
        for c in cases
    ]
    return "\n".join([head, *rows])


def _both(case: Case, form: str, place: int, over: int | None = None) -> str:
    """A bound, or the ratio of two bounds, with any result of the simulations in brackets."""
    shown = [
        f"{values[place] / (1.0 if over is None else values[over]):{form}}"
        for values in (case.bounds, case.errors)
        if values
    ]
    return shown[0] if len(shown) == 1 else f"{shown[0]} ({shown[1]})"


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare the plans and fill the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("docs", type=Path, help="the folder docs of the source tree")
    page: Path = parser.parse_args(arguments).docs / "campaign-design.md"
    cases = [
        compare(name, buffeted=buffeted, seeds=0 if name == LONG else SEEDS)
        for name in PLANS
        for buffeted in (False, True)
    ]
    text = replaced(page.read_text(encoding="utf-8"), "planned drives", table(cases))
    write_whole(page, text.encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
