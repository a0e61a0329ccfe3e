"""An entry's side: the format of an answer, and the programs of this folder that answer all campaigns of a set.

An entry is any program that writes one JSON file for each campaign; ``answer.schema.json`` defines its content.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from tunnel_lab.experiments.blind.sets import campaign_folders, write_document
from tunnel_sim.effects import ALL_EFFECTS, BetweenRuns
from tunnel_sim.processes import in_processes
from tunnel_sim.vocabulary.errors import TunnelError

SCHEMA = Path(__file__).parent / "answer.schema.json"
UNKNOWN = "unknown"
_LAST_PLACE = 32  # last place in the vocabulary of the sets: they do not have later effects
KINDS = tuple(kind for kind in ALL_EFFECTS if kind.place <= _LAST_PLACE)
"""The vocabulary of the sets."""
NAMES: tuple[str, ...] = tuple(
    sorted(kind.name for kind in KINDS if not (kind.driven or issubclass(kind, BetweenRuns)))
)
"""The causes of free decays, which all campaigns of the sets are; `unknown` is one more. Scatter is beside them."""

Answer = Callable[[Path], dict[str, Any]]


@dataclass(frozen=True)
class About:
    """The description of a method, for the table.

    Args:
        title: name in the table.
        setting: the documented setting, in a sentence.
        names: causes that it can name, including `unknown` if applicable.
        not_seen: tracks that it cannot process, marked "–" in the table.
        program: address of its program, for the page; empty: not stated.
    """

    title: str
    setting: str
    names: Sequence[str] = (*NAMES, UNKNOWN)
    not_seen: Sequence[str] = ()
    program: str = ""


def answer_of(
    causes: Sequence[str],
    probability: Mapping[str, float],
    sets: Sequence[tuple[Sequence[str], float]] = (),
    coefficients: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """An answer as a document.

    Args:
        causes: names; empty without a gap, ``["unknown"]`` if no cause in the vocabulary explains the gap.
        probability: probability that each cause acts, by name; 0 for missing names.
        sets: sets of causes with their probabilities; empty: causes count as independent.
        coefficients: ``before`` and ``after`` the causes are added, each ``cn_beta`` and ``cn_r`` (1/rad) with
            ``value`` and ``std``; None: not estimated.
    """
    document: dict[str, Any] = {
        "schema_version": 1,
        "causes": sorted(causes),
        "probability": {name: round(float(p), 6) for name, p in sorted(probability.items()) if p > 0.0},
    }
    if sets:
        document["sets"] = [{"causes": sorted(names), "probability": float(p)} for names, p in sets]
    if coefficients is not None:
        document["coefficients"] = coefficients
    return document


def answer_all(
    answer: Answer, campaigns: Path, answers: Path, *, jobs: int = 1, first: int | None = None
) -> int:
    """Answer the unanswered campaigns, one file each.

    Args:
        answer: function of one campaign's folder.
        answers: folder of the answers; an interrupted run is continued.
        first: number of campaigns to answer, in the order of names; None: all.

    Returns:
        The number of new answers. If the method fails, ``causes`` is null with the error, which counts as
        wrong.
    """
    answers.mkdir(parents=True, exist_ok=True)
    todo = [f for f in campaign_folders(campaigns)[:first] if not (answers / f"{f.name}.json").exists()]
    work = partial(_answer_one, answer)
    for number, (folder, document) in enumerate(in_processes(work, todo, jobs if jobs > 1 else 0), 1):
        write_document(answers / f"{folder.name}.json", document)
        said = "no answer" if document["causes"] is None else " + ".join(document["causes"]) or "none"
        print(f"{number}/{len(todo)} {folder.name}: {said}, {document['seconds']:.1f} s", flush=True)
    return len(todo)


def _answer_one(answer: Answer, folder: Path) -> dict[str, Any]:
    begun = time.process_time()
    try:
        document = answer(folder)
    except Exception as error:  # one bad campaign must not end a night's work; the score counts it as wrong
        said = str(error) if isinstance(error, TunnelError) else f"{type(error).__name__}: {error}"
        document = {"schema_version": 1, "causes": None, "probability": {}, "error": said}
    return {"campaign": folder.name, **document, "seconds": round(time.process_time() - begun, 3)}


def main(answer: Answer, arguments: Sequence[str] | None = None) -> None:
    """Run a method as a program: ``CAMPAIGNS ANSWERS [--jobs N] [--first N]``.

    Args:
        answer: function of one campaign's folder.
        arguments: arguments of the command line; None: the process's.
    """
    parser = argparse.ArgumentParser(description="Answer campaigns, one JSON file each.")
    parser.add_argument("campaigns", type=Path)
    parser.add_argument("answers", type=Path)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--first", type=int)
    given = parser.parse_args(arguments)
    answer_all(answer, given.campaigns, given.answers, jobs=given.jobs, first=given.first)


def schema() -> dict[str, Any]:
    """The JSON schema of an answer."""
    found: dict[str, Any] = json.loads(SCHEMA.read_text(encoding="utf-8"))
    return found
