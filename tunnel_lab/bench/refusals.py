"""Replies of the bench to requests that it refuses: an HTTP status, and a page or a line with the reason."""

from __future__ import annotations

import asyncio
import errno
import logging
from collections.abc import Mapping
from html import escape
from http import HTTPStatus
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fastapi.responses import HTMLResponse, PlainTextResponse, Response
from starlette.exceptions import HTTPException

from tunnel_lab.bench.parts import page_words
from tunnel_lab.bench.workspace import UnknownCampaign
from tunnel_lab.terminal.outputs import say
from tunnel_sim.vocabulary.errors import TunnelError, one_line

if TYPE_CHECKING:
    from fastapi import FastAPI
    from starlette.requests import Request

_FULL = {errno.ENOSPC, errno.EDQUOT}
_WORDS = {
    HTTPStatus.NOT_FOUND: "There is no such page.",
    HTTPStatus.METHOD_NOT_ALLOWED: "This address does not take such a request.",
}
# The theme follows the browser: this page has no script to choose it.
_PAGE = """<!doctype html>
<html lang="en-GB" style="color-scheme: light dark">
<head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title><link rel="stylesheet" href="/static/bench/bench.css">
<style>* {{ box-sizing: border-box; }} body {{ margin: 0; }}</style></head>
<body><div class="nicegui-content">
<header class="top"><a class="brand" href="/">Bench</a></header>
<main id="main"><h1>{title}</h1><p class="fault" role="alert">{words}</p>
<p><a class="button" href="/">All campaigns</a></p></main>
</div></body></html>
"""


def add_refusals(app: FastAPI) -> None:
    """Answer errors by `refusal`, even if NiceGUI has its own reply."""
    for kind in (HTTPException, HTTPStatus.NOT_FOUND.value, TunnelError, OSError):
        app.add_exception_handler(kind, refusal)


def refusal(request: Request, error: Exception) -> Response:
    """A page for a browser that asks for HTML, otherwise a line of text."""
    status, headers = status_of(error), None
    if isinstance(error, HTTPException):
        words, headers = _WORDS.get(status, f"{error.detail}"), error.headers
    elif status == HTTPStatus.INSUFFICIENT_STORAGE:
        words = "The disk is full: nothing was kept. Free some space, and try again."
    elif isinstance(error, OSError):  # the text may disclose the name of a file
        words = f"A file cannot be read or written ({(error.strerror or type(error).__name__).lower()})."
    else:
        words = page_words(str(error))
    words = one_line(words, 400)
    if request.method != "GET":
        return PlainTextResponse(f"{words}\n", status, headers)
    return HTMLResponse(_PAGE.format(title=status.phrase, words=escape(words)), status, headers)


def status_of(error: BaseException) -> HTTPStatus:
    """The HTTP status for an error; errors due to the present files are a conflict."""
    if isinstance(error, HTTPException):
        return HTTPStatus(error.status_code)
    if isinstance(error, UnknownCampaign):
        return HTTPStatus.NOT_FOUND
    for one in (error, error.__cause__):
        if isinstance(one, OSError) and one.errno in _FULL:
            return HTTPStatus.INSUFFICIENT_STORAGE
    return HTTPStatus.CONFLICT


def say_odd_messages() -> None:
    """Report in one line that a page's websocket has sent an invalid message."""
    for name in ("engineio.server", "socketio.server"):
        logging.getLogger(name).addFilter(_in_one_line)
    asyncio.get_running_loop().set_exception_handler(_say_odd_message)


def _in_one_line(record: logging.LogRecord) -> bool:
    if record.exc_info and record.exc_info[0] is not None:
        record.msg, record.args = _odd(record.exc_info[0]), ()
        record.exc_info = record.exc_text = None
    return True


def _say_odd_message(loop: asyncio.AbstractEventLoop, context: Mapping[str, Any]) -> None:
    """Report an error in a task of the websocket library in one line; any other error is a fault of the bench."""
    task, error = context.get("future"), context.get("exception")
    code = getattr(task.get_coro(), "cr_code", None) if isinstance(task, asyncio.Task) else None
    if (
        error is not None
        and code is not None
        and {"socketio", "engineio"} & set(Path(code.co_filename).parts)
    ):
        say(_odd(type(error)), stderr=True)
    else:
        loop.default_exception_handler(dict(context))


def _odd(kind: type[BaseException]) -> str:
    return f"A message to the bench is not one of its pages' and was not read ({kind.__name__})."
