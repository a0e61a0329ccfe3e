"""The stages and their order: each checks what is on the disk before the next opens."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from tunnel_lab.bench.work import work_of
from tunnel_lab.bench.workspace import Session

ESTIMATOR = "output_error"
"""The estimator whose estimate opens the diagnosis."""


@dataclass(frozen=True)
class Stage:
    """A stage.

    Args:
        key: in addresses.
        title: of the page.
    """

    key: str
    title: str


STAGES = (
    Stage("records", "Records"),
    Stage("conditions", "Conditions"),
    Stage("identify", "Identify"),
    Stage("diagnose", "Diagnose"),
    Stage("next-run", "Next run"),
    Stage("report", "Report"),
)


def closed(session: Session, key: str) -> str:
    """Why a stage cannot be opened.

    Returns:
        What to do first, in one line; empty where the stage is open.
    """
    place = [stage.key for stage in STAGES].index(key)
    checks = (_recorded, _stated, _identified, _diagnosed, lambda _: "")
    return next((why for check in checks[:place] if (why := check(session))), "")


def _recorded(session: Session) -> str:
    return "" if session.imported else "Write the campaign on the page Records first."


def _stated(session: Session) -> str:
    return "Correct the conditions that are marked first." if session.draft.is_file() else ""


def _identified(session: Session) -> str:
    document = read_result(session.estimate(ESTIMATOR))
    if document is None or not is_current(session, session.estimate(ESTIMATOR)):
        return f"Identify the campaign with {ESTIMATOR} first."
    if work_of(session.log(ESTIMATOR)).status == 1:
        return "The campaign could not be identified; the page Identify says why."
    return ""


def _diagnosed(session: Session) -> str:
    if read_result(session.diagnosis) is None or not is_current(session, session.diagnosis):
        return "Diagnose the campaign first."
    return ""


def is_current(session: Session, result: Path) -> bool:
    """Whether a result is of the campaign as it is now."""
    document = read_result(result)
    if document is None:
        return False
    stated = document.get("provenance", {}).get("sha256")
    if stated is not None:  # a copied folder has new times but the same content
        return bool(stated == _hashes(session, session.state()))
    return max(changed for _, changed, _ in session.state()) <= result.stat().st_mtime_ns


@lru_cache(maxsize=16)
def _hashes(session: Session, state: object) -> dict[str, str]:
    """SHA-256 of the campaign's files; they are read again only when ``state`` has changed."""
    from tunnel_lab.terminal.inputs import file_hashes

    del state
    return file_hashes(session.campaign)


def read_result(path: Path) -> dict[str, Any] | None:
    """The JSON document that a command has written; None where there is none.

    Raises:
        TunnelError: when the file is not such a document.
    """
    from tunnel_sim.files.reading import read_json

    if not path.is_file():
        return None
    return read_json(path, remedy="delete it, and let the bench write it again")
