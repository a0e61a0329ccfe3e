"""``tunnel view --web`` in a real browser: the car and the trace are in the picture. Skipped without a Chromium."""

from __future__ import annotations

import base64
import io
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator

import numpy as np
import pytest
from matplotlib import image

from tests.unit.browser import IN_A_BROWSER, chromium
from tunnel_lab.show.live import _free_port

pytestmark = IN_A_BROWSER
WIDTH, HEIGHT = 900, 600
# Without this, what WebGL has drawn can be read in the same frame only.
KEEP = """const plain = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, options) {
  return plain.call(this, kind, { ...options, preserveDrawingBuffer: true }); };"""
PICTURE = """() => document.querySelector("canvas").toDataURL("image/png")"""


def test_the_first_free_port_is_taken() -> None:
    first = _free_port()
    with socket.socket(socket.AF_INET6 if socket.has_ipv6 else socket.AF_INET) as taken:
        taken.bind(("", first))
        assert _free_port() > first >= 8080


@pytest.fixture
def served() -> Iterator[str]:
    """The address of a running view."""
    port = _free_port()
    words = ["view", "--web", "--port", str(port), "--wind", "20"]
    child = subprocess.Popen(
        [sys.executable, "-m", "tunnel_lab.cli", *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    address = f"http://localhost:{port}/"
    assert child.stderr is not None
    assert f"Serving {address}".encode() in child.stderr.readline()
    until = time.monotonic() + 60.0
    while time.monotonic() < until:
        try:
            urllib.request.urlopen(address, timeout=5).close()
            break
        except OSError:
            time.sleep(0.2)
    yield address
    child.send_signal(signal.SIGINT)
    child.communicate(timeout=30)


@pytest.mark.slow
def test_the_page_shows_the_car_and_its_trace(served: str) -> None:
    graphics = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
    complaints: list[str] = []
    with chromium(*graphics) as browser:
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.set_default_timeout(180_000)
        page.on("console", lambda said: complaints.extend([said.text] if said.type == "error" else []))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.add_init_script(KEEP)
        page.goto(served)
        for _ in range(40):  # a software renderer takes seconds for a frame
            page.wait_for_timeout(3000)
            red, green, blue = np.moveaxis(pixels(page.evaluate(PICTURE)), -1, 0)
            trace = ((blue > 0.5) & (blue > 1.5 * red))[30:300, WIDTH - 400 :]
            if trace.sum() > 50:
                break
    assert red.shape == (HEIGHT, WIDTH)
    assert trace.sum() > 50  # pixels
    car = (red > 0.3) & (red > 1.8 * green) & (red > 1.8 * blue)
    assert car.sum() > 400
    assert 300 < np.median(np.nonzero(car)[1]) < 600
    assert complaints == []


def pixels(url: str) -> np.ndarray:
    """The picture of a data URL, shape (height, width, 3), 0 to 1."""
    found = image.imread(io.BytesIO(base64.b64decode(url.partition(",")[2])))
    return np.asarray(found)[..., :3]
