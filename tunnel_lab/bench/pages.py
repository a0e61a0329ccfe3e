"""The addresses of the bench."""

from __future__ import annotations

from pathlib import Path

from fastapi.responses import FileResponse
from nicegui import app, ui

from tunnel_lab.bench import stage_conditions, stage_diagnose, stage_identify, stage_next_run, stage_records
from tunnel_lab.bench import stage_report, start, try_it
from tunnel_lab.bench.parts import Frame, address
from tunnel_lab.bench.stages import STAGES, closed
from tunnel_lab.bench.workspace import open_session
from tunnel_sim.vocabulary.errors import TunnelError

_BUILDERS = {
    "records": stage_records.build,
    "conditions": stage_conditions.build,
    "identify": stage_identify.build,
    "diagnose": stage_diagnose.build,
    "next-run": stage_next_run.build,
    "report": stage_report.build,
}


def add_pages(folder: Path) -> None:
    """Add the pages of a workspace.

    Args:
        folder: the workspace.
    """

    @ui.page("/")
    def first() -> None:
        frame = Frame("From a logger's files to a report")
        with frame.main:
            start.build(folder)

    @ui.page("/try")
    def rig() -> None:
        frame = Frame("Try it")
        with frame.main:
            try_it.build(folder)

    @app.get("/{name}/report.html")
    def report(name: str) -> FileResponse:
        session = open_session(folder, name)
        return FileResponse(session.report, headers={"cache-control": "no-store"})

    @ui.page("/{name}/{stage}")
    def stage(name: str, stage: str) -> None:
        try:
            session = open_session(folder, name)
            found = {one.key: one for one in STAGES}.get(stage, STAGES[0])
            frame = Frame(found.title, session, found.key)
            with frame.main:
                why = closed(session, found.key)
                if why:
                    ui.label(why).classes("fault")
                    ui.link("Back to the records", address(session, "records")).classes("button")
                else:
                    _BUILDERS[found.key](session, frame)
        except TunnelError as error:
            ui.label(f"tunnel: {error}").classes("fault")
            ui.link("All campaigns", "/")
