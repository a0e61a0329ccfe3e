"""The summary of a report on one printed page, by Chromium."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from tunnel_lab.report.page import Byline, render_report
from tunnel_lab.report.view import Document
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_TIMEOUT = 120.0  # s


def find_browser() -> str:
    """The Chromium of this machine.

    Raises:
        TunnelError: where there is none.
    """
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise TunnelError(
            "there is no Chromium to print with",
            where="--summary",
            remedy="install Chromium, or print the page of --report from a browser",
        )
    return found


def write_summary(document: Document, campaign: Campaign, path: Path, byline: Byline | None = None) -> Path:
    """Write the summary of a diagnosis as a PDF of one page.

    Args:
        document: as for `tunnel_lab.report.write_report`.
        path: the PDF; replaced when it exists, written completely or not at all.

    Raises:
        TunnelError: where there is no Chromium, it fails, or the file cannot be written.
    """
    browser = find_browser()
    with tempfile.TemporaryDirectory() as name:
        page, printed = Path(name) / "summary.html", Path(name) / "summary.pdf"
        page.write_text(render_report(document, campaign, byline, summary=True), encoding="utf-8")
        arguments = [
            "--headless", "--disable-gpu", "--no-pdf-header-footer", f"--user-data-dir={name}/profile",
            f"--print-to-pdf={printed}", page.as_uri(),
        ]  # fmt: skip
        # Chromium's own sandbox does not start for root.
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            arguments.insert(0, "--no-sandbox")
        try:
            done = subprocess.run([browser, *arguments], capture_output=True, timeout=_TIMEOUT, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise TunnelError(
                "Chromium could not print", where="--summary", remedy="print the report"
            ) from error
        if done.returncode or not printed.is_file():
            raise TunnelError("Chromium could not print", where="--summary", remedy="print the report")
        return write_whole(path, printed.read_bytes())
