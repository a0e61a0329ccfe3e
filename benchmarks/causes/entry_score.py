"""Scores an entry by the statistics of the project's blind checks.

Only this file converts answers to the cases of `tunnel_lab.experiments.blind`.
"""

from __future__ import annotations

import hashlib
import heapq
import json
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.causes.entry import NAMES, UNKNOWN, About
from benchmarks.causes.make import SEAL, differing, is_edition, published, truths_by_track
from diagnosis.answer.run_deviations import Spread
from diagnosis.findings.decision import decision
from diagnosis.findings.terms import SCATTERS
from diagnosis.settings import Settings
from identification.show.quantity import Quantity
from identification.statistics import Proportion
from tunnel_lab.experiments.blind.cases import NAMES as COEFFICIENTS
from tunnel_lab.experiments.blind.cases import Case, ScoredAnswer, case, found_by_group, inclusions
from tunnel_lab.experiments.blind.scatter_score import scatter_score
from tunnel_lab.experiments.blind.set_score import calibration, smooth_calibration
from tunnel_sim.files.writing import as_json
from tunnel_sim.vocabulary.errors import TunnelError

FLOOR = 0.01
"""Least probability that the log score counts, and one minus the greatest: nobody knows better from so "
"few trials."""
WITHIN = 2.0  # maximum error of a coefficient in standard deviations
# maximum number of listed sets of independent causes; the remaining probability is in no credible set
_SETS = 60


def likely_sets(answer: Mapping[str, Any]) -> list[tuple[tuple[str, ...], float]]:
    """Sets of causes with their probabilities, most probable first.

    Args:
        answer: an entry's document. Without stated sets, causes are independent, and `unknown` has a separate
            probability.
    """
    if answer.get("sets"):
        given = [(tuple(sorted(s["causes"])), float(s["probability"])) for s in answer["sets"]]
        return sorted(given, key=lambda one: -one[1])
    stated = dict(answer["probability"])
    unknown = min(float(stated.pop(UNKNOWN, 0.0)), 1.0)
    p = {name: float(np.clip(value, 0.0, 1.0)) for name, value in stated.items() if value > 0.0}
    best = tuple(sorted(name for name, value in p.items() if value > 0.5))
    top = float(np.prod([max(value, 1.0 - value) for value in p.values()]))
    # flips of the most probable set, cheapest first: a heap of (cost, last place, flipped names)
    costs = sorted((abs(np.log(max(v, 1e-12) / max(1.0 - v, 1e-12))), name) for name, v in p.items())
    heap: list[tuple[float, int, tuple[str, ...]]] = [(0.0, -1, ())]
    found: list[tuple[tuple[str, ...], float]] = [((UNKNOWN,), unknown)] if unknown else []
    while heap and len(found) < _SETS:
        cost, last, flipped = heapq.heappop(heap)
        found.append((tuple(sorted(set(best) ^ set(flipped))), top * float(np.exp(-cost)) * (1.0 - unknown)))
        for place in range(last + 1, len(costs)):
            heapq.heappush(heap, (cost + costs[place][0], place, (*flipped, costs[place][1])))
    return sorted(found, key=lambda one: -one[1])


def as_case(name: str, truth: Mapping[str, Any], answer: Mapping[str, Any]) -> Case:
    """Truth and answer of a campaign in the form of the blind checks."""
    seconds = float(answer.get("seconds", 0.0))
    if answer["causes"] is None:
        return case(name, truth, ScoredAnswer(seconds=seconds))
    own = tuple(sorted(answer["causes"]))
    # the given answer comes first, as the blind checks expect; the order of equals does not matter
    sets = sorted(likely_sets(answer), key=lambda one: (one[0] != own, -one[1]))
    likely = [(" + ".join(names) or "none", min(p, 1.0)) for names, p in sets]
    stated = answer.get("coefficients", {})
    before, after = (
        {key: Quantity(one["value"], one["std"], "1/rad") for key, one in stated.get(when, {}).items() if one}
        for when in ("before", "after")
    )
    said = ScoredAnswer(
        causes=tuple(answer["causes"]),
        probabilities=dict(likely),
        decision=decision(likely, Settings().answer) if likely else None,
        inclusion={n: float(answer["probability"].get(n, 0.0)) for n in NAMES},
        before=before,
        after=after,
        spreads=tuple(_spreads(answer.get("scatter", {}))),
        seconds=seconds,
    )
    return case(name, truth, said)


def _spreads(scatter: Mapping[str, Any]) -> Iterator[Spread]:
    """An entry's scatter between runs."""
    effects = {number: name for name, number in SCATTERS.items()}
    for number, one in scatter.items():
        low, high = one["interval_90"]
        yield Spread(effects[number], one["value"], (low, high), None, one["named"], {})


def log_score(cases: Sequence[Case]) -> float | None:
    """Mean over campaigns of the log probability of the acting and absent causes, nats; 0 is best.

    Args:
        cases: truth and answer of every campaign; a missing answer counts as a half for every cause.
    """
    stated = {c.name: dict.fromkeys(NAMES, 0.5) | c.answer.inclusion for c in cases}
    scores = []
    for c in cases:
        p = {n: float(np.clip(v, FLOOR, 1.0 - FLOOR)) for n, v in stated[c.name].items() if n not in c.small}
        scores.append(sum(np.log(v) if name in c.truth else np.log1p(-v) for name, v in p.items()))
    return float(np.mean(scores)) if scores else None


def _coefficients(cases: Sequence[Case]) -> dict[str, Any]:
    """Errors of both coefficients before and after, where stated by an entry."""
    found: dict[str, Any] = {}
    for name in COEFFICIENTS:
        for when in ("before", "after"):
            errors = [e for c in cases if (e := c.error(name, when)) is not None]
            if errors:
                found[f"{name} {when}"] = {
                    "within_2_std": Proportion.of([abs(e.stds) <= WITHIN for e in errors]).to_json_dict(),
                    "median_relative_error": float(np.median([abs(e.share) for e in errors])),
                }
    return found


def figures(cases: Sequence[Case]) -> dict[str, Any]:
    """All figures of some campaigns.

    Args:
        cases: truth and answer of every campaign; at least one.
    """
    given = [(c.probability, c.right) for c in cases if c.probability is not None]
    error, bins = calibration([p for p, _ in given], [right for _, right in given])
    seconds = [c.answer.seconds or 0.0 for c in cases]
    return {
        "campaigns": len(cases),
        **as_json(found_by_group(cases)["all"]),
        "log_score": log_score(cases),
        "inclusion_calibration": as_json(smooth_calibration(inclusions(cases))),
        "answer_calibration": {"error": error, "bins": as_json(bins)},
        "coefficients": _coefficients(cases),
        "no_answer": sum(c.causes is None for c in cases),
        "seconds": {
            "median": float(np.median(seconds)),
            "largest": max(seconds),
            "sum": float(np.sum(seconds)),
        },
    }


def score(
    folder: Path, key: Mapping[str, Any], answers: Mapping[str, Mapping[str, Any]], name: str, about: About
) -> dict[str, Any]:
    """The score of an entry, as a file of ``results``.

    Args:
        key: document of the key, as returned by `benchmarks.causes.make.check`.
        answers: answers by campaign; campaigns without an answer are not scored, and their number is stated.

    Raises:
        TunnelError: when an answer is for a campaign outside the set.
    """
    strange = sorted(set(answers) - set(key["truths"]))
    if strange:
        what = f"answers the campaign '{strange[0]}', which is not in the set"
        raise TunnelError(what, where=name, remedy=f"answer the campaigns of {folder}")
    seal = json.loads((folder / SEAL).read_text(encoding="utf-8"))
    tracks: dict[str, Any] = {}
    every: list[Case] = []
    for track, members in truths_by_track(key).items():
        cases = [as_case(n, key["truths"][n], answers[n]) for n in members if n in answers]
        if cases and track not in about.not_seen:
            tracks[track] = figures(cases)
        every += cases
    nameable = [n in c.named for c in every for n in c.truth if n in about.names and n != UNKNOWN]
    made_with = key["made_with"]
    text = json.dumps(answers, sort_keys=True).encode()
    return {
        "schema_version": 1,
        "version": made_with["version"],
        "differing": differing(seal, published(made_with["version"])) if is_edition(made_with) else None,
        "method": name,
        "title": about.title,
        "setting": about.setting,
        "program": about.program,
        "names": sorted(about.names),
        "not_seen": sorted(about.not_seen),
        "key_sha256": seal["key_sha256"],
        "answers_sha256": hashlib.sha256(text).hexdigest(),
        "scored": datetime.now(UTC).date().isoformat(),
        "answered": len(every),
        "of": len(key["truths"]),
        "all": figures(every),
        "scatter": as_json(scatter_score(every)) if any(c.widths for c in every) else None,
        "found_of_nameable": Proportion.of(nameable).to_json_dict(),
        "tracks": tracks,
        "cases": {
            c.name: {
                "track": key["truths"][c.name]["track"],
                "right": c.right,
                "causes": None if c.causes is None else list(c.causes),
            }
            for c in every
        },
    }
