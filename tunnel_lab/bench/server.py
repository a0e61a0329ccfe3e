"""The server of the bench, on the loopback interface only."""

from __future__ import annotations

import asyncio
import secrets
import socket
from contextlib import suppress
from importlib import resources
from pathlib import Path

from nicegui import app, background_tasks, core, ui

from tunnel_lab.bench import hand, work
from tunnel_lab.bench.guard import Guard
from tunnel_lab.bench.pages import add_pages
from tunnel_lab.terminal.tables import say
from tunnel_sim.vocabulary.errors import TunnelError

HOST = "127.0.0.1"


def serve(folder: Path, *, port: int, browser: bool, first: str) -> None:
    """Serve the bench until interrupted.

    Args:
        folder: the workspace, as it is shown and typed.
        port: TCP port (count); 0 takes a free one.
        first: path of the page to open.

    Raises:
        TunnelError: when the port is taken.
    """
    port = _free_port(port)
    token = secrets.token_urlsafe(24)
    address = f"{first}?token={token}"
    core.app.add_middleware(Guard, port=port, token=token)
    static = resources.files("tunnel_lab")
    for name, place in (("bench", "bench/static"), ("uplot", "report/vendor")):
        app.add_static_files(f"/static/{name}", str(static.joinpath(place)))
    add_pages(folder)
    words = f"The bench: http://{HOST}:{port}{address}\nCampaigns: {folder.resolve()}\nCtrl-C ends it."
    app.on_startup(lambda: background_tasks.create(_say_when_open(port, words)))
    app.on_shutdown(_end)
    with suppress(KeyboardInterrupt):  # the usual end
        _run(port, address if browser else "")


async def _say_when_open(port: int, words: str) -> None:
    """Print the address as soon as the port answers, which is after the start of the application."""
    while True:
        with suppress(OSError):
            _, writer = await asyncio.open_connection(HOST, port)
            writer.close()
            break
        await asyncio.sleep(0.02)
    say(words)


async def _end() -> None:
    """End what was started: the user has ended the bench, it has not crashed."""
    hand.end()
    await asyncio.to_thread(work.stop_all)


def _run(port: int, shown: str) -> None:
    icon = resources.files("tunnel_lab").joinpath("bench/static/favicon.svg")
    ui.run(
        host=HOST,
        port=port,
        title="Bench of the virtual wind tunnel",
        favicon=icon.read_text("utf-8"),
        dark=None,
        reload=False,
        show=shown or False,
        show_welcome_message=False,
        tailwind=False,
        storage_secret=None,
        language="en-GB",
    )


def _free_port(port: int) -> int:
    """The port, or a free one for 0.

    Raises:
        TunnelError: when it cannot be opened.
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
        return int(trial.getsockname()[1])
