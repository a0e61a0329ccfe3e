"""The addresses of the bench."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from fastapi.responses import FileResponse
from nicegui import app, ui

from tunnel_lab.bench import start
from tunnel_lab.bench.parts import Frame, address
from tunnel_lab.bench.stages import STAGES, closed
from tunnel_lab.bench.workspace import open_session
from tunnel_sim.vocabulary.errors import TunnelError


def add_pages(folder: Path) -> None:
    """Add the pages of a workspace."""

    @ui.page("/")
    def first() -> None:
        frame = Frame("From a logger's files to a report")
        with frame.main:
            start.build(folder)

    @ui.page("/try")
    def rig() -> None:
        frame = Frame("Try it")
        with frame.main:
            import_module("tunnel_lab.bench.try_it").build(folder)

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
                    # Only here: the first page need not wait for what the stages load.
                    module = f"tunnel_lab.bench.stage_{found.key.replace('-', '_')}"
                    import_module(module).build(session, frame)
        except TunnelError as error:
            ui.label(f"tunnel: {error}").classes("fault")
            ui.link("All campaigns", "/")
