"""Answers a blind set, one file for each campaign, without opening the key."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from diagnosis._diagnose import diagnose, vocabulary
from diagnosis.blind.files import (
    SCHEMA_VERSION,
    SEAL,
    campaign_folders,
    file_hash,
    folder_hash,
    read_hashes,
    write_document,
)
from tunnel_sim.effects import Effect
from tunnel_sim.effects.expression_effect import read_effects
from tunnel_sim.effects.registry import answering_with
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.writing import output_folder
from tunnel_sim.processes import in_processes
from tunnel_sim.vocabulary.errors import TunnelError

Progress = Callable[[int, int, str], None]


def answers_folder(folder: Path, excluded: Sequence[str] = (), effects_file: Path | None = None) -> Path:
    """Where the answers to a set go.

    Args:
        excluded: effects withheld from the vocabulary.
        effects_file: of effects added to it; None: none.

    Returns:
        ``answers`` inside the set, or ``answers-without-…-with-…``, which ends with a hash of the effects file.
    """
    without = ["without", *sorted(set(excluded))] if excluded else []
    names = sorted(kind.name for kind in _own_effects(effects_file))
    own = ["with", *names, file_hash(effects_file)[:8]] if effects_file else []
    return folder / "-".join(["answers", *without, *own])


def _own_effects(effects_file: Path | None) -> tuple[type[Effect], ...]:
    return () if effects_file is None else read_effects(effects_file)


def answer_set(
    folder: Path,
    *,
    excluded: Sequence[str] = (),
    jobs: int = 1,
    progress: Progress | None = None,
    effects_file: Path | None = None,
) -> str:
    """Diagnose every campaign of a set that has no answer yet.

    An interrupted run leaves only complete answers, and the next run continues from there. A campaign that cannot
    be diagnosed gets an answer that says why; it counts as wrong.

    Args:
        excluded: effects withheld from the vocabulary.
        progress: called with the number of campaigns answered, the number in all, and the name of the last.
        effects_file: of effects added to the vocabulary; None: none.

    Returns:
        SHA-256 over all answers, in hexadecimal: publish it before the key is opened.

    Raises:
        TunnelError: when the set holds no campaign, an effect is unknown, or an answer was changed afterwards.
    """
    campaigns = campaign_folders(folder)
    vocabulary(exclude=excluded)
    target = answers_folder(folder, excluded, effects_file)
    output_folder(target)
    hashes = _answered(target)
    names = {path.name for path in campaigns}
    left = [path for path in campaigns if path.name not in hashes]
    if progress is not None:
        progress(len(names & hashes.keys()), len(campaigns), "")
    for name, answer in _answers(left, sorted(set(excluded)), jobs, effects_file):
        hashes[name] = write_document(target / f"{name}.json", answer)
        _write_seal(target, hashes, excluded)
        if progress is not None:
            progress(len(names & hashes.keys()), len(campaigns), name)
    return file_hash(target / SEAL)


def _answered(target: Path) -> dict[str, str]:
    """Hashes of the answers that exist, after a check of their files."""
    if not (target / SEAL).exists():
        return {}
    hashes = read_hashes(target / SEAL, "answers_sha256", "remove the folder and answer again")
    for name, known in hashes.items():
        path = target / f"{name}.json"
        if not path.is_file() or file_hash(path) != known:
            raise TunnelError(
                "is not the answer that was given",
                where=str(path),
                remedy=f"remove {target} and answer all campaigns again",
            )
    return hashes


def _write_seal(target: Path, hashes: dict[str, str], excluded: Sequence[str]) -> None:
    document = {
        "schema_version": SCHEMA_VERSION,
        "excluded": sorted(set(excluded)),
        "answers_sha256": dict(sorted(hashes.items())),
    }
    write_document(target / SEAL, document)


def _answers(
    campaigns: Sequence[Path], excluded: Sequence[str], jobs: int, effects_file: Path | None
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Name and answer of each campaign, as they come."""
    work = partial(answer_campaign, excluded=tuple(excluded), effects_file=effects_file)
    processes = jobs if jobs > 1 and len(campaigns) > 1 else 0
    return (answer for _, answer in in_processes(work, campaigns, processes))


def answer_campaign(
    folder: Path, excluded: Sequence[str] = (), effects_file: Path | None = None
) -> tuple[str, dict[str, Any]]:
    """Diagnose one campaign of a set.

    Args:
        excluded: effects withheld from the vocabulary.
        effects_file: of effects added to it; None: none.

    Returns:
        Its name and its answer: the diagnosis' JSON document with ``wall_s`` (s) and ``data_sha256``, or, where
        there is none, ``causes`` null and the ``error``.
    """
    begun = time.perf_counter()
    try:
        with answering_with(_own_effects(effects_file)):
            found = diagnose(read_campaign(folder), kinds=vocabulary(exclude=excluded))
        answer = found.to_json_dict()
        answer.pop("maps", None)  # pictures' data: larger than the records, and nothing is scored by them
    except Exception as error:  # one bad campaign must not end a night's work; the score counts it as wrong
        said = str(error) if isinstance(error, TunnelError) else f"{type(error).__name__}: {error}"
        answer = {"schema_version": SCHEMA_VERSION, "campaign": folder.name, "causes": None, "error": said}
    answer["data_sha256"] = folder_hash(folder)
    answer["wall_s"] = time.perf_counter() - begun
    return folder.name, answer
