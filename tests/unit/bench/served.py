"""The bench in a process of its own, and tabs of a browser in it."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Bench:
    """A server.

    Args:
        address: with its token.
        folder: the workspace.
        process: of the server.
    """

    address: str
    folder: Path
    process: subprocess.Popen[str]

    @property
    def base(self) -> str:
        return self.address.split("/?")[0]


@contextmanager
def bench(folder: Path) -> Iterator[Bench]:
    """Serve a workspace; Ctrl-C must end it with status 0."""
    words = [sys.executable, "-m", "tunnel_lab.cli", "bench", str(folder), "--no-browser"]
    # NiceGUI takes a server under pytest for one of its own tests.
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST")}
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(words, env=environment, **pipes) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:\d+/\S*", line)
        assert found is not None, line
        try:
            yield Bench(found[0], folder, process)
        finally:
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (0, "")


class Tab:
    """A tab, and what it has complained about or asked for."""

    def __init__(self, browser: Any, served: Bench, **given: Any) -> None:
        self.context = browser.new_context(**({"viewport": {"width": 1280, "height": 900}} | given))
        self.context.grant_permissions(["clipboard-read", "clipboard-write"], origin=served.base)
        self.page = self.context.new_page()
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.clicks = 0
        self.page.set_default_timeout(60_000)
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self._base = served.base
        self.page.goto(served.address)
        self.page.wait_for_selector("h1")

    def open(self, path: str) -> None:
        self.page.goto(self._base + path)
        self.page.wait_for_selector("h1")

    def click(self, words: str) -> None:
        """Click on a button or a link, and count it."""
        self.clicks += 1
        self.page.click(f":is(button, a.button):has-text('{words}')")

    def close(self) -> None:
        self.context.close()
        assert self.complaints == []
        foreign = [url for url in self.requests if not url.startswith((self._base, "data:", "blob:"))]
        assert foreign == []


@contextmanager
def tab(browser: Any, served: Bench, **given: Any) -> Iterator[Tab]:
    found = Tab(browser, served, **given)
    yield found
    found.close()
