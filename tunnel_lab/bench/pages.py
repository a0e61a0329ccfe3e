"""The addresses of the bench."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from fastapi.responses import FileResponse
from nicegui import app, events, ui

from tunnel_lab.bench.parts import Fault, Frame, address, drop_zone, keep
from tunnel_lab.bench.workspace import (
    STAGES,
    Session,
    Stage,
    closed,
    new_session,
    open_session,
    sessions,
)
from tunnel_sim.vocabulary.errors import TunnelError


def add_pages(folder: Path) -> None:
    """Add the pages of a workspace."""

    @ui.page("/")
    def first() -> None:
        frame = Frame("From a logger's files to a report")
        with frame.main:
            build_start(folder)

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
                    module = f"tunnel_lab.bench.{found.key.replace('-', '_')}"
                    import_module(module).build(session, frame)
        except TunnelError as error:
            ui.label(f"tunnel: {error}").classes("fault")
            ui.link("All campaigns", "/")


def build_start(folder: Path) -> None:
    """Build the page."""
    ui.label("Drop the files of a data logger. Every step writes the files that the commands write.").classes(
        "lede"
    )
    fault = Fault()

    async def dropped(given: events.MultiUploadEventArguments) -> None:
        with fault.around():
            session = new_session(folder, given.files[0].name)
            await keep(session, given)
            ui.navigate.to(address(session, "records"))

    drop_zone(dropped, fault)
    place = folder if folder.name else folder.resolve()
    ui.label(f"Dropped files are kept in {place}, in a folder of their own beside the campaign.").classes(
        "soft"
    )
    found = sessions(folder)
    if found:
        with ui.element("h2"):
            ui.html("Campaigns here", sanitize=False, tag="span")
        with ui.element("ul").classes("sessions"):
            for session in found:
                with ui.element("li"):
                    stage = _furthest(session)
                    ui.link(session.name, address(session, stage.key))
                    ui.label(f"open up to {stage.title}").classes("soft")


def _furthest(session: Session) -> Stage:
    """The last stage that is open."""
    try:
        return [stage for stage in STAGES if not closed(session, stage.key)][-1]
    except TunnelError:
        return STAGES[0]
