"""The share of campaigns in which a disturbed run is named and the causes are exactly right.

Run as ``python -m benchmarks.disturbed FOLDER --seed N --count C``. Campaigns of the reference simulator have
up to two causes, and one run of each has a blow, a push or a bump of the reading. With ``--undisturbed`` there
is no disturbance; only the falsely named runs are counted, without a search for causes. Every answer is
appended to ``answers.jsonl`` in the folder; a second call continues.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from diagnosis import diagnose
from diagnosis.diagnosable import choose
from diagnosis.search.investigate import nominal_study
from tunnel_reference.disturbance import DISTURBANCE, with_disturbances
from tunnel_reference.draw import Mixture
from tunnel_reference.make import as_campaign, draw_set, truth_of
from tunnel_reference.severity import Simulated, read_and_fit, simulate_motions, size_separably
from tunnel_sim.effects import known_effects
from tunnel_sim.files.writing import as_json
from tunnel_sim.vocabulary.errors import TunnelError

KINDS = {"none": 1.0, "single": 2.0, "pair": 2.0}


def simulated(count: int, seed: int, variety: float, *, disturbed: bool) -> list[Simulated]:
    """Campaigns, each with a disturbed run unless ``disturbed`` is false."""
    mixture = Mixture(variety=variety, small=0.0)
    draws = size_separably(draw_set(count, seed, KINDS, mixture))
    if disturbed:
        draws = with_disturbances(draws, np.random.default_rng(seed + 1))
    return [read_and_fit(draw, motion) for draw, motion in zip(draws, simulate_motions(draws), strict=True)]


def answered(one: Simulated, name: str) -> dict[str, Any]:
    """The truth and the answer of a campaign."""
    hit = next((e for e in one.draw.effects if e.form.family == DISTURBANCE), None)
    scale = one.draw.conditions.time_scale
    truth = {
        "effects": truth_of(one)["effects"],
        "severity": one.excess,
        "form": hit and hit.form.name,
        "run": hit and f"r{int(hit.extra['run']) + 1:02d}",
        "at_s": hit and hit.extra["at"] * scale,
        "size": hit and hit.target,
    }
    begun, campaign = time.process_time(), as_campaign(one, name)
    try:
        if hit is None:
            chosen = choose(campaign, known_effects())
            accused = nominal_study(chosen.campaign, chosen.kinds).disturbed
            seconds = time.process_time() - begun
            return {"name": name, "truth": truth, "disturbed": as_json(accused), "seconds": seconds}
        found = diagnose(campaign)
    except TunnelError as error:
        return {"name": name, "truth": truth, "error": str(error)}
    return {
        "name": name,
        "truth": truth,
        "causes": list(found.causes),
        "decided": found.decision.decided,
        "probability": found.candidates[0].probability,
        "disturbed": as_json(found.disturbed),
        "seconds": time.process_time() - begun,
    }


def named(one: Mapping[str, Any]) -> bool:
    """Whether exactly the disturbed run is named; without a disturbance, whether no run is named."""
    return [d["run"] for d in one.get("disturbed", ())] == (
        [one["truth"]["run"]] if one["truth"]["run"] else []
    )


def exact(one: Mapping[str, Any]) -> bool:
    """Whether the causes are decided and exactly right."""
    return bool(one.get("decided")) and one.get("causes") == one["truth"]["effects"]


def main() -> None:
    """Answer the campaigns, and print the counts."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.disturbed", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--variety", type=float, default=0.0)
    parser.add_argument("--undisturbed", action="store_true")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    file = given.folder / "answers.jsonl"
    known = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    done = {one["name"] for one in known}
    for number, one in enumerate(
        simulated(given.count, given.seed, given.variety, disturbed=not given.undisturbed)
    ):
        name = f"c{number:04}"
        if name not in done:
            known.append(answered(one, name))
            with file.open("a") as stream:
                stream.write(json.dumps(known[-1]) + "\n")
    for kind in range(3):
        some = [one for one in known if len(one["truth"]["effects"]) == kind]
        both = sum(named(one) and exact(one) for one in some)
        print(
            f"{kind} causes: {len(some)} campaigns, {sum(map(named, some))} with the run right, "
            f"{sum(map(exact, some))} with the causes right, {both} with both"
        )


if __name__ == "__main__":
    main()
