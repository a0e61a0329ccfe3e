"""The runs that identify and diagnose leave out: one choice for both pages."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import ui

from diagnosis.result import Diagnosis
from tunnel_lab.bench.workspace import Session
from tunnel_sim.files.campaign_folder import CAMPAIGN_FILE, read_document
from tunnel_sim.files.reading import read_json
from tunnel_sim.files.writing import write_json


def runs_left_out(session: Session) -> tuple[str, ...]:
    """Ids of the campaign's runs that the user chose to leave out."""
    if not session.left_out.is_file():
        return ()
    chosen = read_json(session.left_out, remedy="delete it, and choose again").get("runs", ())
    return tuple(name for name in _ids(session) if name in chosen)


def options(session: Session) -> tuple[str, ...]:
    """The options of a command that leave these runs out."""
    return tuple(word for name in runs_left_out(session) for word in ("--leave-out", name))


def left_out_of(answer: Diagnosis) -> tuple[str, ...]:
    """Ids of the runs that a diagnosis left out at the user's request."""
    return tuple(answer.provenance.get("left_out", ()))


def build_choice(session: Session, changed: Callable[[], None]) -> None:
    """Build the field; at most all runs but one can be chosen.

    Args:
        changed: function called after a choice is written.
    """
    ids = _ids(session)
    if len(ids) < 2:
        return

    def write() -> None:
        if len(field.value) == len(ids):
            field.set_value(field.value[:-1])
        write_json(session.left_out, {"runs": sorted(field.value)})
        changed()

    field = ui.select(list(ids), label="Leave out runs", value=list(runs_left_out(session)), multiple=True)
    field.props("dense use-chips").on_value_change(write)


def _ids(session: Session) -> tuple[str, ...]:
    if not session.imported:
        return ()
    return tuple(run.id for run in read_document(session.campaign / CAMPAIGN_FILE).runs)
