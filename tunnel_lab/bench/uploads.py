"""Dropped files: the drop zone, the upload addresses, and the storage."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from fastapi.responses import PlainTextResponse, Response
from nicegui import ui
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request

from tunnel_lab.bench.parts import Fault, address
from tunnel_lab.bench.workspace import Session, new_session, open_session, safe_name
from tunnel_sim.files.writing import output_folder, temporary_names, write_whole
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.limits import UPLOAD_BYTES

if TYPE_CHECKING:
    from fastapi import FastAPI

NEW = "/upload"
"""Address for the files of a new session."""
_MOST_FILES = 1000  # maximum number of files in a request
_one_at_a_time = Lock()  # two requests must not take the same new name


def too_large(size: int) -> str:
    """The reason for refusing an upload of ``size`` bytes."""
    most = f"{UPLOAD_BYTES / 1e6:.0f} MB of an upload"
    return f"{size / 1e6:.0f} MB are more than the {most}; use tunnel import, or drop fewer files at a time"


def drop_zone(url: str, saved: Callable[[str], Awaitable[None] | None], fault: Fault) -> None:
    """A zone to drop or choose files; a refusal is shown as a fault.

    Args:
        url: address for the files.
        saved: function called with the address of the files' page when all are saved.
    """
    most = UPLOAD_BYTES - 1_000_000  # less the frame of the request
    label = f"Drop files here, or press + to choose (at most {UPLOAD_BYTES / 1e6:.0f} MB)"
    zone = ui.element("q-uploader").classes("drop")
    zone.props(f'label="{label}" url="{url}" max-total-size={most} multiple batch auto-upload flat bordered')
    zone.props('aria-label="Files of a data logger"')

    async def taken(answer: str) -> None:
        with fault.around():
            done = saved(answer)
            if done is not None:
                await done

    answer = "(info) => emit(info.xhr.responseText.trim())"
    zone.on("uploaded", lambda event: taken(str(event.args)), js_handler=answer)
    zone.on(
        "failed",
        lambda event: fault.show(str(event.args) or "The files did not arrive; drop them again"),
        js_handler=answer,
    )
    # The browser knows the size before it sends anything.
    zone.on(
        "rejected",
        lambda event: fault.show(too_large(int(event.args))),
        js_handler="(found) => emit(found.reduce((sum, one) => sum + one.file.size, 0))",
    )


def add_uploads(app: FastAPI, folder: Path) -> None:
    """Add the upload addresses of a workspace; each answers with the address of the files' page."""

    @app.post(NEW)
    async def to_new(request: Request) -> Response:
        return await _take(request, lambda names: new_session(folder, *names))

    @app.post("/{name}/upload")
    async def to_more(name: str, request: Request) -> Response:
        session = open_session(folder, name)
        return await _take(request, lambda _: session)


async def _take(request: Request, session_for: Callable[[Sequence[str]], Session]) -> Response:
    """Save the files of a request in the session for their names."""

    def kept(files: Sequence[UploadFile]) -> Session:
        contents = [(file.filename or "", file.file.read()) for file in files]
        with _one_at_a_time:
            session = session_for([name for name, _ in contents])
            keep(session, contents)
        return session

    try:
        async with request.form(max_files=_MOST_FILES) as form:
            files = [value for _, value in form.multi_items() if isinstance(value, UploadFile)]
            if not files:
                raise HTTPException(400, "No file is in the request.")
            session = await asyncio.to_thread(kept, files)
    except ClientDisconnect:  # nobody waits for the answer
        raise HTTPException(400, "The request ended before its files did.") from None
    return PlainTextResponse(address(session, "records"))


def keep(session: Session, files: Sequence[tuple[str, bytes]]) -> None:
    """Save files, all or none, under safe names; a file with the same name is replaced.

    Args:
        files: name and content of each.

    Raises:
        TunnelError: when two files have the same name, or they cannot be written.
    """
    names = [safe_name(name) for name, _ in files]
    if len(set(names)) < len(names):
        raise TunnelError("two files of one name were dropped", remedy="rename one, or drop them separately")
    staged: list[tuple[Path, Path]] = []
    try:
        target = output_folder(session.uploads)
        for name, (_, content) in zip(names, files, strict=True):
            staged.append((temporary_names(target / name)[0], target / name))
            write_whole(staged[-1][0], content)
        for partial, final in staged:
            partial.replace(final)
    finally:
        for partial, _ in staged:
            partial.unlink(missing_ok=True)
        with suppress(OSError):
            session.uploads.rmdir()  # this succeeds only for an empty folder
