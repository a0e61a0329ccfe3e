"""The server of the bench, on the loopback interface only: its access control and its addresses."""

from __future__ import annotations

import asyncio
import hmac
import os
import re
import secrets
import socket
from contextlib import suppress
from importlib import import_module, resources
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl, quote, urlencode

from fastapi.responses import HTMLResponse, Response
from nicegui import app, background_tasks, core, ui
from starlette.exceptions import HTTPException
from starlette.requests import Request

from tunnel_lab.bench import work
from tunnel_lab.bench.parts import Fault, Frame, address
from tunnel_lab.bench.refusals import add_refusals, refusal, say_odd_messages
from tunnel_lab.bench.uploads import NEW, add_uploads, drop_zone, too_large
from tunnel_lab.bench.workspace import STAGES, closed, open_session, read_diagnosis, sessions
from tunnel_lab.terminal.outputs import say
from tunnel_sim.files.reading import as_described
from tunnel_sim.vocabulary.errors import TunnelError, shown
from tunnel_sim.vocabulary.limits import UPLOAD_BYTES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from starlette.types import ASGIApp, Receive, Scope, Send


HOST = "127.0.0.1"
_OTHERS_MASK = 0o077
"""Permissions removed from files and folders that the bench and its commands write: all those of other users."""
_CONFLICT = 409  # HTTP status of requests that the present files do not allow
_LENGTH = re.compile(r"[0-9]{1,20}")


def serve(folder: Path, *, port: int, browser: bool, first: str) -> None:
    """Serve a workspace until interrupted, on a TCP port or a free one (0), with the path of the page to open.

    Raises:
        TunnelError: when the port is taken.
    """
    with socket.socket() as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind((HOST, port))
        except OSError as error:
            raise TunnelError(
                f"cannot be opened ({(error.strerror or str(error)).lower()})",
                where=f"--port {port}",
                remedy="name another one, or leave it out",
            ) from error
        port = int(trial.getsockname()[1])
    os.umask(_OTHERS_MASK)
    token = secrets.token_urlsafe(24)
    address = f"{first}?token={token}"
    core.app.add_middleware(Guard, port=port, token=token)
    static = resources.files("tunnel_lab")
    for name, place in (("bench", "bench/static"), ("uplot", "report/vendor")):
        app.add_static_files(f"/static/{name}", str(static.joinpath(place)))
    add_pages(folder)
    words = f"The bench: http://{HOST}:{port}{address}\nCampaigns: {folder.resolve()}\nCtrl-C ends it."
    app.on_startup(lambda: background_tasks.create(_say_when_open(port, words)))
    app.on_startup(say_odd_messages)
    app.on_shutdown(_end)
    with suppress(KeyboardInterrupt):  # Ctrl-C is the usual end
        icon = resources.files("tunnel_lab").joinpath("bench/static/favicon.svg")
        ui.run(
            host=HOST,
            port=port,
            title="Bench of the virtual wind tunnel",
            favicon=icon.read_text("utf-8"),
            dark=None,
            reload=False,
            show=address if browser else False,
            show_welcome_message=False,
            tailwind=False,
            storage_secret=None,
            language="en-GB",
        )


async def _say_when_open(port: int, words: str) -> None:
    """Print the address as soon as the port answers, after the start of the application."""
    while True:
        with suppress(OSError):
            _, writer = await asyncio.open_connection(HOST, port)
            writer.close()
            break
        await asyncio.sleep(0.02)
    say(words)


async def _end() -> None:
    """End the commands that were started: the user has ended the bench, it has not crashed."""
    work.end_fits()
    await asyncio.to_thread(work.stop_all)


class Guard:
    """Admits only requests with the secret token of this start of the server."""

    def __init__(self, app: ASGIApp, port: int, token: str) -> None:
        self._app = app
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        self._token = token
        self._cookie = f"tunnel-bench-{port}"  # cookies do not distinguish ports

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        query = dict(parse_qsl(scope.get("query_string", b"").decode("latin-1")))
        status, words = self._refusal(headers, query)
        if status and scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": words[:120]})
        elif status:  # the rest of the request is not read
            await _answer(send, status, (b"connection", b"close"), body=f"{words}\n".encode())
        elif "token" in query and scope["type"] == "http" and scope["method"] == "GET":
            # The token moves from the address into a cookie, to keep it out of histories and bookmarks.
            rest = urlencode({name: value for name, value in query.items() if name != "token"})
            # the path cannot name another host or end the header
            path = "/" + quote(scope["path"].lstrip("/\\"), errors="replace")
            place = path + (f"?{rest}" if rest else "")
            cookie = f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/"
            await _answer(send, 303, (b"location", place.encode()), (b"set-cookie", cookie.encode()))
        else:
            await self._app(scope, receive, send)

    def _refusal(self, headers: Mapping[str, str], query: Mapping[str, str]) -> tuple[int, str]:
        """HTTP status and text of a refused request; 0 for a request that is admitted."""
        host, origin = headers.get("host", ""), headers.get("origin")
        if host not in self._hosts:
            return 421, "The bench is not at this address; use the address that tunnel bench printed."
        if origin is not None and origin != f"http://{host}":
            return 403, "The request comes from another page; use the bench itself."
        pairs = (part.strip().partition("=") for part in headers.get("cookie", "").split(";"))
        cookies = {name: value for name, _, value in pairs}
        given = query.get("token") or cookies.get(self._cookie, "")
        if not hmac.compare_digest(given.encode(), self._token.encode()):
            return 403, "The token is missing or old; use the whole address that tunnel bench printed."
        length = headers.get("content-length", "0")
        if "transfer-encoding" in headers or not _LENGTH.fullmatch(length):
            return 411, "The length of the request is not stated."
        if int(length) > UPLOAD_BYTES:
            return 413, too_large(int(length))
        return 0, ""


async def _answer(send: Send, status: int, *headers: tuple[bytes, bytes], body: bytes = b"") -> None:
    plain = [(b"content-type", b"text/plain; charset=utf-8"), (b"cache-control", b"no-store")]
    await send({"type": "http.response.start", "status": status, "headers": [*plain, *headers]})
    await send({"type": "http.response.body", "body": body})


def _report(page: bytes | str) -> HTMLResponse:
    """A report; it may come from elsewhere with its campaign, so it must not act as a page of the bench."""
    from tunnel_lab.report import security_policy

    headers = {"cache-control": "no-store", "content-security-policy": security_policy()}
    return HTMLResponse(page, headers=headers)


def add_pages(folder: Path) -> None:
    """Add the pages of a workspace, and its other addresses."""
    add_refusals(app)
    add_uploads(app, folder)

    @ui.page("/")
    def first(request: Request) -> Response | None:
        try:
            frame = Frame("From a logger's files to a report")
            with frame.main:
                build_start(folder)
        except TunnelError as error:
            return refusal(request, error)
        return None

    @ui.page("/try")
    def rig() -> None:
        frame = Frame("Try it")
        with frame.main:
            import_module("tunnel_lab.bench.try_it").TryItPage(folder)

    @app.get("/{name}/report.html")
    def report(name: str) -> Response:
        session = open_session(folder, name)
        if not session.report.is_file():
            why = closed(session, "report") or "Open the page Report first: it writes the report."
            raise HTTPException(_CONFLICT, why)
        return _report(session.report.read_bytes())

    @app.get("/{name}/fit.html")
    def fit(name: str) -> HTMLResponse:
        from tunnel_lab.report import render_fit

        session = open_session(folder, name)
        answer = read_diagnosis(session)
        if answer is None:
            raise HTTPException(_CONFLICT, "Diagnose the campaign first.")
        with as_described("cannot be drawn", shown(session.diagnosis), "diagnose the campaign again"):
            page = render_fit(answer)
        return _report(page)

    @ui.page("/{name}/{stage}")
    def stage(name: str, stage: str, request: Request) -> Response | None:
        try:
            session = open_session(folder, name)
            opened = {each.key: each for each in STAGES}.get(stage)
            if opened is None:
                raise HTTPException(404)
            frame = Frame(opened.title, session, opened.key)
            with frame.main:
                why = closed(session, opened.key)
                if why:
                    ui.context.client.status_code = _CONFLICT
                    ui.label(why).classes("fault")
                    ui.link("Back to the records", address(session, "records")).classes("button")
                else:
                    # Only here: the first page need not wait for the imports of the stages.
                    module, _, build = opened.builder.partition(".")
                    getattr(import_module(f"tunnel_lab.bench.{module}"), build)(session, frame)
        except (TunnelError, HTTPException) as error:
            return refusal(request, error)
        return None


def build_start(folder: Path) -> None:
    """The first page: a drop zone for files, and the campaigns."""
    words = "Drop the files of a data logger. Every step writes the files that the commands write."
    ui.label(words).classes("lede")
    drop_zone(NEW, ui.navigate.to, Fault())
    place = folder if folder.name else folder.resolve()
    words = f"Dropped files are kept in {place}, in a separate folder beside the campaign."
    ui.label(words).classes("soft")
    campaigns = sessions(folder)
    if campaigns:
        with ui.element("h2"):
            ui.html("Campaigns here", sanitize=False, tag="span")
        with ui.element("ul").classes("sessions"):
            for session in campaigns:
                try:
                    stage = [stage for stage in STAGES if not closed(session, stage.key)][-1]
                except TunnelError:
                    stage = STAGES[0]
                with ui.element("li"):
                    ui.link(session.name, address(session, stage.key))
                    ui.label(f"open up to {stage.title}").classes("soft")
