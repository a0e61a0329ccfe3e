"""The bench in a process of its own, and tabs of a browser in it."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.support.browser import screenshot

ROOT = Path(__file__).parents[2]
FILMED = "BENCH_PICTURES" in os.environ
_MOST_PICTURES = 60  # of a film
CONNECTED = "() => window.socket?.connected"
"""Whether the page has its websocket: leaving earlier is a message on the console."""
SETTLED = """() => {
  const count = document.querySelectorAll("*").length, now = performance.now();
  if (count !== window.countBefore) [window.countBefore, window.countedAt] = [count, now];
  const moving = document.getAnimations().filter((one) => one.playState === "running"
    && one.effect.getComputedTiming().iterations !== Infinity);
  return now - window.countedAt > 300 && moving.length === 0 && document.fonts.status === "loaded";
}"""
"""Whether nothing has been added to the page for 0.3 s, and no colour is on its way to another."""

FULL_DISK = """
import errno, os, tempfile
from tunnel_sim.files import writing

def fail(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "/tmp/secret-name")

write = writing._write_to

def write_until_full(descriptor, content):
    write(descriptor, content[:3] if content.startswith(b"full") else content)
    if content.startswith(b"full"):
        fail()

writing._write_to = write_until_full
tempfile.SpooledTemporaryFile.rollover = fail
"""
"""A disk that is full as soon as a file begins with ``full``, or is too large for the memory."""


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
def bench(folder: Path, *, crash: bool = False, prelude: str = "") -> Iterator[Bench]:
    """Serve a workspace; Ctrl-C must end it with status 0, without a word on standard error.

    With ``crash`` it is killed in the end. The server runs the Python code of ``prelude`` first.
    """
    folder.mkdir(exist_ok=True)
    start = f"{prelude}\nfrom tunnel_lab.cli import main\nraise SystemExit(main())"
    words = [sys.executable, "-c", start, "bench", folder.name, "--no-browser"]
    # NiceGUI takes a server under pytest for one of its own tests.
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST")}
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT), environment.get("PYTHONPATH")]))
    pipes: dict[str, Any] = {
        "cwd": folder.parent,
        "stdout": subprocess.PIPE,
        "stderr": subprocess.PIPE,
        "text": True,
    }
    with subprocess.Popen(words, env=environment, **pipes) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:\d+/\S*", line)
        assert found is not None, line
        try:
            yield Bench(found[0], folder, process)
        finally:
            process.send_signal(signal.SIGKILL if crash else signal.SIGINT)
            _, errors = process.communicate(timeout=60)
    expected = -signal.SIGKILL if crash else 0
    assert process.returncode == expected, (process.returncode, errors)
    assert not errors, errors


class Tab:
    """A tab, and what it has complained about or asked for.

    All tabs of a browser are in one context, whose cache holds the scripts of the pages.
    """

    def __init__(
        self, browser: Any, served: Bench, path: str = "", *, width: int = 1280, height: int = 900
    ) -> None:
        self.context = browser.contexts[0] if browser.contexts else browser.new_context()
        self.context.grant_permissions(["clipboard-read", "clipboard-write"], origin=served.base)
        self.page = self.context.new_page()
        self.page.set_viewport_size({"width": width, "height": height})
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.clicks = 0
        self.film: list[bytes] = []
        self.page.set_default_timeout(60_000)
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self._base = served.base
        if not (path and self.context.cookies(served.base)):  # the first page gives the cookie
            self._go(served.address)
        if path:
            self.open(path)

    def open(self, path: str) -> None:
        self._go(self._base + path)

    def _go(self, address: str) -> None:
        self.page.goto(address)
        self.page.wait_for_selector("h1")
        self.page.wait_for_function(CONNECTED)

    def settle(self, selector: str) -> None:
        """Wait until the last part of the page is there, and nothing of it changes any more."""
        self.page.wait_for_selector(selector)
        self.page.wait_for_function(SETTLED)

    def click(self, words: str) -> None:
        """Click on a button or a link, count it, and keep a picture of it."""
        self.clicks += 1
        place = self.page.locator(f":is(button, a.button):has-text('{words}')").first
        place.scroll_into_view_if_needed()
        place.evaluate("(one) => { one.style.outline = '4px solid #d55e00'; }")
        self.shoot()
        place.click()

    def shoot(self) -> None:
        """Keep a picture for the film, where one is wanted."""
        if FILMED:
            self.film.append(screenshot(self.page, type="jpeg", quality=90))

    def wait(self, selector: str, seconds: float = 900.0) -> None:
        """Wait for an element, and keep a picture now and then."""
        end = time.monotonic() + seconds
        while not self.page.locator(selector).first.is_visible():
            assert time.monotonic() < end, selector
            if len(self.film) < _MOST_PICTURES:
                self.shoot()
            self.page.wait_for_timeout(3000)

    def until(self, holds: Callable[[], bool], seconds: float = 60.0) -> None:
        """Wait until something holds outside the page."""
        end = time.monotonic() + seconds
        while not holds():
            assert time.monotonic() < end
            self.page.wait_for_timeout(50)

    def close(self) -> None:
        self.page.close()
        assert self.complaints == []
        foreign = [url for url in self.requests if not url.startswith((self._base, "data:", "blob:"))]
        assert foreign == []


@contextmanager
def tab(browser: Any, served: Bench, path: str = "", **given: int) -> Iterator[Tab]:
    found = Tab(browser, served, path, **given)
    yield found
    found.close()
