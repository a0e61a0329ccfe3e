"""The explainable part of the gap and the proposed law, on a blind set with the whole vocabulary withheld.

Run as ``python -m benchmarks.laws SET`` from the root; see README.md beside it.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from diagnosis.remainder.explain import closable
from diagnosis.search.investigate import investigate
from identification.statistics import Proportion
from tunnel_lab.experiments.blind.sets import KEY
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.writing import as_json

STATE = ("angle", "rate", "state")
TIME = ("time", "event")
#: Correct kinds, by form of the truth; written before the first answer to the reported set.
RIGHT: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(("magnetic_detent", "scraping", "stops", "one_stop", "cogging", "centre_damper",
                     "widening_damping", "one_way_damper", "hysteresis_loop"), STATE),
    **dict.fromkeys(("stall", "wake"), ("wind",)),
    **dict.fromkeys(("spring_creep", "slipping_clamp", "fading_friction", "breathing_spring", "moving_mass",
                     "bump_all_runs", "bump_one_run", "gust_one_run"), TIME),
    "platform_vibration": (*TIME, "line"),
    "damping_warms_up": ("between",),
    **dict.fromkeys(("gain_change", "reading_ripple", "reading_kink"), ("reading",)),
    **dict.fromkeys(("zero_step_one_run", "wandering_zero"), ("wander",)),
    "amplitude_zero": ("reading", "wander"),
    "held_samples": ("noise", "reading"),
    **dict.fromkeys(("clock_jitter", "motion_noise", "spikes"), ("noise",)),
}  # fmt: skip


def answer(folder: Path) -> dict[str, Any]:
    """The answer to one campaign without any effect in the vocabulary."""
    begun = time.process_time()
    study = investigate(read_campaign(folder), ())
    found = closable(study, significant=study.gap.test.detected) if study.gap.test.detected else None
    return {
        "detected": study.gap.test.detected,
        "closable": as_json(found),
        "cpu_s": time.process_time() - begun,
    }


def _closes(found: Mapping[str, Any]) -> float:
    """Share of the explainable gap that the law explains; 0 without a law."""
    if found["law"] is None:
        return 0.0
    ceiling = next(one["closed"] for one in found["ceilings"] if one["kind"] == found["kind"])
    return float(found["law"]["closed"] / max(ceiling, 1e-9))


def tables(truths: Mapping[str, Any], answers: Mapping[str, Any]) -> list[Table]:
    """The figures, and one row per form."""
    seen = {name: (truths[name], answers[name]) for name in answers}
    nothing = {"kind": None, "law": None}
    gaps = {
        n: (t["form"][0], a["closable"] or nothing)
        for n, (t, a) in seen.items()
        if t["form"] and a["detected"]
    }
    state = {n: v for n, v in gaps.items() if RIGHT[v[0]] in (STATE, ("wind",))}
    empty = [a for t, a in seen.values() if not t["form"]]
    rows = {
        "kind right, of the gaps detected": [f["kind"] in RIGHT[form] for form, f in gaps.values()],
        "kind right, of moments of state": [f["kind"] in RIGHT[form] for form, f in state.values()],
        "law closes 0.8 of the closable, of moments of state": [_closes(f) >= 0.8 for _, f in state.values()],
        "a law where there is no gap": [bool(a["closable"] and a["closable"]["law"]) for a in empty],
    }
    found = sum(a["detected"] for _, a in seen.values())
    heads = ("figure", "count", "of", "share", "95 %")
    figures = Table(*heads, title=f"{len(seen)} campaigns, {found} gaps detected")
    for name, values in rows.items():
        share = Proportion.of(values)
        low, high = share.interval
        shown = "–" if share.value is None else f"{100 * share.value:.1f} %"
        interval = f"{100 * low:.1f}–{100 * high:.1f} %"
        figures.add_row(name, str(share.count), str(share.total), shown, interval)
    heads = ("form", "gaps", "kind right", "kinds", "law closes of the closable (median)")
    forms = Table(*heads, title="By form")
    for form in sorted({form for form, _ in gaps.values()}):
        own = [f for other, f in gaps.values() if other == form]
        kinds = sorted({str(f["kind"]) for f in own})
        right = sum(f["kind"] in RIGHT[form] for f in own)
        closes = [_closes(f) for f in own]
        forms.add_row(form, str(len(own)), str(right), ", ".join(kinds), f"{np.median(closes):.2f}")
    return [figures, forms]


def main() -> None:
    """Answer every campaign that has no answer yet, then score."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.laws", description=__doc__)
    parser.add_argument("folder", type=Path, help="a set made by tunnel blind make")
    parser.add_argument(
        "--part", default="0/1", help="K/N: answer every Nth campaign from the Kth on, and do not score"
    )
    given = parser.parse_args()
    first, step = map(int, given.part.split("/"))
    out = given.folder / "laws"
    out.mkdir(exist_ok=True)
    truths = json.loads((given.folder / KEY).read_text())["truths"]
    for name in sorted(truths)[first::step]:
        path = out / f"{name}.json"
        if not path.exists():
            path.write_text(json.dumps(answer(given.folder / name)))
    if step == 1:
        answers = {path.stem: json.loads(path.read_text()) for path in sorted(out.glob("*.json"))}
        console = Console(width=140)
        for table in tables(truths, answers):
            console.print(table)


if __name__ == "__main__":
    main()
