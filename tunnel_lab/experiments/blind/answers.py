"""The answers to a blind set as an experiment: a task is a campaign, its result the document of a diagnosis.

Answers are JSON files in a folder of their own. Its ``seal.json`` has their hashes: an answer that was changed
afterwards is refused, not given again.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any

from diagnosis._diagnose import diagnose, vocabulary
from tunnel_lab.experiments.blind.cases import ScoredAnswer
from tunnel_lab.experiments.blind.sets import (
    SCHEMA_VERSION,
    SEAL,
    campaign_folders,
    file_hash,
    folder_hash,
    read_hashes,
    write_document,
)
from tunnel_lab.experiments.experiment import Done, Experiment, run
from tunnel_lab.experiments.runner import Progress, Workers, processes
from tunnel_lab.report.diagnosis_file import diagnosis_of
from tunnel_sim.effects import Effect
from tunnel_sim.effects.expression_effect import read_effects
from tunnel_sim.effects.registry import answering_with
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.writing import json_text, output_folder, write_whole
from tunnel_sim.vocabulary.errors import TunnelError

ANSWERS = "answers"


def answers_folder(folder: Path, excluded: Sequence[str] = (), effects_file: Path | None = None) -> Path:
    """The folder of the answers to a set: its subfolder ``answers``, or ``answers-without-…-with-…``.

    The latter name ends with a hash of the file of added effects.
    """
    without = ["without", *sorted(set(excluded))] if excluded else []
    names = sorted(kind.name for kind in _own_effects(effects_file))
    own = ["with", *names, file_hash(effects_file)[:8]] if effects_file else []
    return folder / "-".join(["answers", *without, *own])


def _own_effects(effects_file: Path | None) -> tuple[type[Effect], ...]:
    return () if effects_file is None else read_effects(effects_file)


@dataclass(frozen=True)
class Sealed:
    """The folder of the answers to a set, with their seal.

    Args:
        about: further entries of the seal.
        hashes: SHA-256 of the answers, by the name of the campaign.
    """

    folder: Path
    about: dict[str, Any]
    hashes: dict[str, str] = field(default_factory=dict)

    def finished(self) -> set[str]:
        """Campaigns with an answer.

        Raises:
            TunnelError: when an answer was changed afterwards.
        """
        if (self.folder / SEAL).exists():
            again = "remove the folder and answer again"
            self.hashes.update(read_hashes(self.folder / SEAL, "answers_sha256", again))
        for name, known in self.hashes.items():
            path = self.folder / f"{name}.json"
            if not path.is_file() or file_hash(path) != known:
                remedy = f"remove {self.folder} and answer all campaigns again"
                raise TunnelError("is not the answer that was given", where=str(path), remedy=remedy)
        return set(self.hashes)

    def keep(self, name: str, done: Done) -> None:
        """Write an answer, and seal it."""
        content = done.files[ANSWERS]
        write_whole(self.folder / f"{name}.json", content)
        self.hashes[name] = hashlib.sha256(content).hexdigest()
        seal = {"schema_version": SCHEMA_VERSION, **self.about}
        write_document(self.folder / SEAL, {**seal, "answers_sha256": dict(sorted(self.hashes.items()))})


def answer_set(
    folder: Path,
    *,
    excluded: Sequence[str] = (),
    workers: Workers | None = None,
    progress: Progress | None = None,
    effects_file: Path | None = None,
) -> str:
    """Diagnose every campaign of a set that has no answer yet.

    An interrupted run leaves only complete answers, and the next run continues from there. A campaign that cannot
    be diagnosed gets an answer with the reason; it counts as wrong.

    Args:
        excluded: effects withheld from the vocabulary.
        workers: workers; None: this process.
        progress: function called with the number of answered campaigns and the total.
        effects_file: file of effects added to the vocabulary; None: none.

    Returns:
        SHA-256 over all answers, in hexadecimal: publish it before the key is opened.

    Raises:
        TunnelError: when the set has no campaign, an effect is unknown, or an answer was changed afterwards.
    """
    without = sorted(set(excluded))
    work = partial(answer_campaign, excluded=without, effects_file=effects_file)
    about: dict[str, Any] = {"excluded": without}
    answers = Experiment(ANSWERS, campaign_folders(folder), work, attrgetter("name"), about)
    vocabulary(exclude=excluded)
    target = output_folder(answers_folder(folder, excluded, effects_file))
    run(answers, Sealed(target, about), workers or processes(0), progress)
    return file_hash(target / SEAL)


def scored(document: Mapping[str, Any], where: str) -> ScoredAnswer:
    """The answer in a document of `answer_campaign`.

    Args:
        where: source of the document, for an error.

    Raises:
        TunnelError: when it is not an answer.
    """
    if document.get("causes", ()) is None:
        return ScoredAnswer()
    given, remedy = dict(document), "answer the set again"
    given.pop("data_sha256", None)
    seconds = given.pop("wall_s", None)
    if isinstance(seconds, bool) or not isinstance(seconds, float | int | None):
        raise TunnelError("is not an answer (wall_s: not a number of seconds)", where=where, remedy=remedy)
    return ScoredAnswer.of(diagnosis_of(given, where, remedy), seconds)


def answer_campaign(folder: Path, excluded: Sequence[str] = (), effects_file: Path | None = None) -> Done:
    """Diagnose one campaign of a set.

    Returns:
        The answer: the diagnosis' JSON document with ``wall_s`` (s) and ``data_sha256``; without a diagnosis,
            ``causes`` is null and ``error`` has the reason.
    """
    begun = time.perf_counter()
    try:
        with answering_with(_own_effects(effects_file)):
            found = diagnose(read_campaign(folder), kinds=vocabulary(exclude=excluded))
        answer = found.to_json_dict()
        answer.pop("maps", None)  # data of the figures: larger than the records, and not scored
    except Exception as error:  # one bad campaign must not end the whole set; the score counts it as wrong
        said = str(error) if isinstance(error, TunnelError) else f"{type(error).__name__}: {error}"
        answer = {"schema_version": SCHEMA_VERSION, "campaign": folder.name, "causes": None, "error": said}
    answer["data_sha256"] = folder_hash(folder)
    answer["wall_s"] = time.perf_counter() - begun
    return Done({ANSWERS: json_text(answer).encode()})
