"""The first page: drop files, or go on with a campaign."""

from __future__ import annotations

from pathlib import Path

from nicegui import events, ui

from tunnel_lab.bench.guard import too_large
from tunnel_lab.bench.parts import Fault, address
from tunnel_lab.bench.stages import STAGES, Stage, closed
from tunnel_lab.bench.workspace import Session, new_session, safe_name, sessions
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.limits import UPLOAD_BYTES


def build(folder: Path) -> None:
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


def drop_zone(dropped: events.Handler[events.MultiUploadEventArguments], fault: Fault) -> None:
    """A place to drop files on, or to choose them with.

    Args:
        dropped: called with the files of a drop together.
        fault: where a refusal is shown.
    """
    limit = f"at most {UPLOAD_BYTES / 1e6:.0f} MB"
    zone = ui.upload(
        label=f"Drop files here, or press + to choose ({limit})",
        multiple=True,
        auto_upload=True,
        max_total_size=UPLOAD_BYTES - 1_000_000,  # less the frame of the request
        on_multi_upload=dropped,
    )
    zone.classes("drop").props('flat bordered aria-label="Files of a data logger"')
    # The browser knows the size before it sends anything.
    zone.on(
        "rejected",
        lambda event: fault.show(too_large(int(event.args))),
        js_handler="(found) => emit(found.reduce((sum, one) => sum + one.file.size, 0))",
    )


async def keep(session: Session, given: events.MultiUploadEventArguments) -> None:
    """Keep dropped files under safe names; a file of the same name is replaced.

    Args:
        given: the drop.
    """
    from tunnel_sim.files.writing import output_folder, write_whole

    target = output_folder(session.uploads)
    names = [safe_name(file.name) for file in given.files]
    if len(set(names)) < len(names):
        raise TunnelError("two files of one name were dropped", remedy="rename one, or drop them separately")
    for name, file in zip(names, given.files, strict=True):
        write_whole(target / name, await file.read())


def _furthest(session: Session) -> Stage:
    """The last stage that is open."""
    try:
        return [stage for stage in STAGES if not closed(session, stage.key)][-1]
    except TunnelError:
        return STAGES[0]
