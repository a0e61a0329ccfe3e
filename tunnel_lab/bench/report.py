"""The stage Report: the report of the session's diagnosis, with its author and notes."""

from __future__ import annotations

import asyncio
import time
from datetime import datetime

from nicegui import ui

from tunnel_lab.bench.parts import Fault, Frame, address, button, show_command
from tunnel_lab.bench.workspace import Session, read_result
from tunnel_sim.files.reading import read_json
from tunnel_sim.files.writing import write_json


def build_report(session: Session, frame: Frame) -> None:
    """Build the page."""
    del frame
    _Report(session)


class _Report:
    """The page: the report is written anew when author or notes change."""

    def __init__(self, session: Session) -> None:
        self._session = session
        stated = {"author": "", "notes": ""}
        if session.byline.is_file():
            stated |= read_json(session.byline, remedy="delete it")
        with ui.element("div").classes("fields wide"):
            self._author = ui.input("Author", value=str(stated["author"])).props("dense")
            self._notes = ui.textarea(
                "Notes, shown at the head of the report", value=str(stated["notes"])
            ).props("dense autogrow")
        self._author.on("change", self._write)
        self._notes.on("change", self._write)
        self._fault = Fault()
        with ui.element("p").classes("buttons"):
            button("Download the report", self._download, main=True)
            ui.link("Open in a tab", address(session, "report.html"), new_tab=True).classes("button")
        ui.label(f"Written: {session.report}").classes("soft")
        show_command(
            f"tunnel diagnose {session.campaign} --report {session.report} --author NAME --notes TEXT"
        )
        self._place = ui.element("div").classes("preview")
        ui.timer(0.0, self._write, once=True)

    async def _write(self) -> None:
        author, notes = str(self._author.value or ""), str(self._notes.value or "")
        with self._fault.around():
            write_json(self._session.byline, {"author": author, "notes": notes})
            await asyncio.to_thread(write_session_report, self._session, author, notes)
            if self._place.is_deleted:  # the page was left
                return
            self._place.clear()
            source = f"{address(self._session, 'report.html')}?{time.time_ns()}"
            with self._place:
                ui.element("iframe").props(f'src="{source}" title="Preview of the report"')

    async def _download(self) -> None:
        ui.download(self._session.report, f"{self._session.name}-report.html")


def write_session_report(session: Session, author: str, notes: str) -> None:
    """Write the report of the session's diagnosis, as ``tunnel diagnose --report`` does.

    Args:
        author: who made it; may be empty.
        notes: for the head of the page; may be empty.

    Raises:
        TunnelError: when it cannot be written.
    """
    from diagnosis.diagnosable import diagnosable
    from tunnel_lab.report import Byline, write_report
    from tunnel_sim.files.campaign_folder import read_campaign

    document = read_result(session.diagnosis)
    assert document is not None  # else the stage is closed
    made = datetime.fromtimestamp(session.diagnosis.stat().st_mtime).astimezone().date().isoformat()
    campaign = diagnosable(read_campaign(session.campaign)).campaign
    write_report(document, campaign, session.report, Byline(made, author, notes))
