"""Draw the picture at the head of the README: the head of the report on the README's first campaign.

    python -m docs.studies.report_picture

simulates the campaign, diagnoses it, and writes docs/images/report.png with the Chromium of this machine.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from tunnel_lab.report.page import find_browser

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "docs" / "images" / "report.png"
WIDTH, HEIGHT = 1180, 940  # pixels


def plan(readme: str) -> str:
    """The plan of the README, its first TOML block."""
    (first, *_) = re.findall(r"```toml\n(.*?)```", readme, re.DOTALL)
    return str(first)


def report(folder: Path) -> Path:
    """The report of the README's diagnosis."""
    (folder / "plan.toml").write_text(
        plan((ROOT / "README.md").read_text(encoding="utf-8")), encoding="utf-8"
    )
    friction = "coulomb_friction:friction_moment=0.004"
    for command in (
        ["simulate", "plan.toml", "--out", "dry", "--effect", friction],
        ["diagnose", "dry", "--report", "report.html"],
    ):
        subprocess.run([sys.executable, "-m", "tunnel_lab", *command], cwd=folder, check=True)
    return folder / "report.html"


def draw(page_file: Path, picture: Path) -> None:
    """Take the picture of the head of a page, in the light colour scheme."""
    from playwright.sync_api import sync_playwright  # imported here because it is an extra of the developers

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=find_browser())
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT}, color_scheme="light")
        page.goto(page_file.as_uri())
        page.screenshot(path=picture)
        browser.close()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        draw(report(Path(made)), PICTURE)
