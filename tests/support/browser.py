"""A real browser: the system's Chromium by Playwright. Tests in it are skipped where there is no Chromium."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tunnel_lab.report.page import find_browser
from tunnel_sim.vocabulary.errors import TunnelError


def _chromium() -> str | None:
    try:
        return find_browser()
    except TunnelError:
        return None


CHROMIUM = _chromium()
IN_A_BROWSER = [
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),  # of Playwright's own pipes
]
LEAST_CONTRAST = 4.5
"""Of a text with what is behind it: WCAG 2, level AA."""


@contextmanager
def chromium(*switches: str) -> Iterator[Any]:
    """The browser; it ends with the context. One runs at a time: on a loaded machine two disturb each other."""
    import fcntl

    from playwright import sync_api

    with (Path(tempfile.gettempdir()) / f"tunnel-browser-{os.getuid()}.lock").open("w") as turn:
        fcntl.flock(turn, fcntl.LOCK_EX)
        with sync_api.sync_playwright() as playwright:
            # Chromium's own sandbox does not start for root.
            arguments = [*switches, *(["--no-sandbox"] if os.getuid() == 0 else [])]
            found = playwright.chromium.launch(executable_path=CHROMIUM, args=arguments)
            yield found
            found.close()


def screenshot(page: Any, **given: Any) -> bytes:
    """A picture of a page; a loaded machine may refuse the first attempt."""
    from playwright import sync_api

    try:
        return bytes(page.screenshot(**given))
    except sync_api.Error as error:
        if "Protocol error (Page.captureScreenshot)" not in str(error):
            raise
        return bytes(page.screenshot(**given))


CONTRASTS = """() => {
  const light = (text) => {
    const most = text.startsWith("color(") ? 1 : 255;
    const [r, g, b] = text.match(/[\\d.]+/g).map((v) => Number(v) / most).map(
      (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = (element) => {
    for (let one = element; one; one = one.parentElement) {
      const found = getComputedStyle(one).backgroundColor;
      if (!found.endsWith(", 0)")) return found;
    }
    return getComputedStyle(document.body).backgroundColor;
  };
  // colours in mid-transition, from one scheme to the other, are nobody's to read; the end of one may begin another
  const moving = () => document.getAnimations().filter((one) => one.effect.getComputedTiming().endTime < Infinity);
  for (let i = 0, left = moving(); i < 9 && left.length; i++, left = moving()) left.forEach((one) => one.finish());
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), found = [];
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const parent = node.parentElement;
    const shown = parent.checkVisibility({ visibilityProperty: true, opacityProperty: true });
    if (!node.textContent.trim() || !shown || parent.closest("script, option")) continue;
    const style = getComputedStyle(parent);
    const levels = [light(parent.closest("svg") ? style.fill : style.color), light(behind(parent))].sort();
    found.push([node.textContent, (Math.max(...levels) + 0.05) / (Math.min(...levels) + 0.05)]);
  }
  return found;
}"""
"""Every text that is shown, with its contrast."""
