"""The whole way in a real browser, from dropped files to the report. Slow; skipped where there is no browser.

Truth: the command's own JSON, the friction that was simulated, and a count of the clicks. With ``BENCH_PICTURES``
set to a folder, the screenshots and the film of the how-to page are written into it.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from tests.support.browser import IN_A_BROWSER, screenshot
from tests.support.served import Tab, bench, tab
from tunnel_lab.bench import work

pytestmark = [*IN_A_BROWSER, pytest.mark.slow]

ROOT = Path(__file__).parents[4]
RAW = ROOT / "docs" / "how-to" / "data" / "Measured_data2.mat"
PICTURES = os.environ.get("BENCH_PICTURES")
PLAN = """
name = "dry"
seed = 1
springs = [5, 8]
wind_speeds = [0.0, 10.0]
release_angles_deg = [20.0]
duration = 10.0
truth.cn_beta = 0.495
truth.cn_r = -0.114
"""
LONG_MS = 600_000


def picture(one: Tab, name: str) -> None:
    """A screenshot in light and dark, where they are wanted."""
    if PICTURES:
        before = one.page.viewport_size
        one.page.set_viewport_size({"width": 1200, "height": 900})
        for scheme in ("light", "dark"):
            one.page.emulate_media(color_scheme=scheme)
            one.page.wait_for_timeout(2000)  # colours change slowly
            screenshot(one.page, path=f"{PICTURES}/bench-{name}-{scheme}.png")
        one.page.emulate_media(color_scheme="light")
        one.page.set_viewport_size(before)


def film(pictures: list[bytes], path: str) -> None:
    """The film as MP4, a second for each picture."""
    import imageio.v2 as imageio

    writer: Any = imageio.get_writer(path, format="FFMPEG", mode="I", fps=1, codec="libx264", quality=6)
    with writer:
        for one in pictures:
            writer.append_data(imageio.imread(one, format="jpg"))


def to_the_report(one: Tab, of: str = "") -> Path:
    """From the page Conditions to the downloaded report; ``of`` ends the names of the pictures."""
    page = one.page
    one.wait(".ag-row")
    picture(one, f"conditions{of}")
    one.click("Continue: Identify")
    page.wait_for_url("**/identify")
    one.click("Identify")
    one.wait("a:has-text('Continue: Diagnose')")
    one.click("Continue: Diagnose")
    page.wait_for_url("**/diagnose")
    one.click("Diagnose")
    one.wait("a:has-text('Continue: Next run')")
    one.wait(".figures svg")
    one.wait(".by-hand .value")
    picture(one, f"diagnose{of}")
    page.mouse.wheel(0, 3000)
    one.click("To the report")
    page.wait_for_url("**/report")
    one.wait("iframe")
    page.wait_for_timeout(2000)
    with page.expect_download() as found:
        one.click("Download the report")
    return Path(found.value.path())


def test_a_real_file_becomes_a_report_in_seven_clicks(browser: Any, tmp_path: Path) -> None:
    with bench(tmp_path / "work") as served, tab(browser, served, width=1024, height=768) as one:
        one.shoot()
        one.page.set_input_files("input[type=file]", [str(RAW)])
        one.page.get_by_label("Column of the angle").click()  # of two channels
        one.page.get_by_role("option", name="data[1]").click()
        one.page.keyboard.press("Escape")
        one.wait(".mark.start")
        one.page.locator(".mark.start").first.evaluate("mark => mark.scrollIntoView({block: 'center'})")
        picture(one, "records")
        one.click("Write the campaign")
        report = to_the_report(one).read_text("utf-8")
        assert "Diagnosis of Measured_data2" in report
        assert one.clicks <= 7  # the download among them
        one.shoot()
        pictures = one.film
    document = json.loads((tmp_path / "work" / "Measured_data2.diagnosis.json").read_text())
    assert document["gap"]["detected"]
    if PICTURES:
        film(pictures, f"{PICTURES}/bench.mp4")


def test_a_simulated_campaign_is_diagnosed_as_by_the_command(browser: Any, tmp_path: Path) -> None:
    folder = tmp_path / "work"
    folder.mkdir()
    (tmp_path / "plan.toml").write_text(PLAN)
    effect = ("--effect", "coulomb_friction:friction_moment=0.004")
    tunnel("simulate", str(tmp_path / "plan.toml"), "--out", str(folder / "dry"), *effect)
    with bench(folder) as served, tab(browser, served) as one:
        one.open("/dry/conditions")
        to_the_report(one, "-dry")
        one.open("/dry/diagnose")
        one.page.wait_for_selector(".by-hand .value", timeout=LONG_MS)
        assert one.page.locator(".by-hand .value").first.inner_text().startswith(("100", "> 99.9", "99"))
        begun = time.monotonic()
        one.page.get_by_role("checkbox", name="coulomb friction", exact=True).click()
        one.page.wait_for_selector(".by-hand .value:text-is('0 %')", timeout=LONG_MS)
        print(f"closure by hand after {time.monotonic() - begun:.1f} s")
    found = (folder / "dry.diagnosis.json").read_text()
    assert json.loads(found)["causes"] == ["coulomb_friction"]
    tunnel("diagnose", str(folder / "dry"), "--json", str(tmp_path / "own.json"))
    assert without_times(found) == without_times((tmp_path / "own.json").read_text())


def without_times(text: str) -> str:
    """The bytes of a document without the values of ``seconds``."""
    found, count = re.subn(r'("seconds": \{)[^}]*\}', r"\1}", text)
    assert count == 1
    return found


def tunnel(*words: str) -> None:
    subprocess.run([sys.executable, "-m", "tunnel_lab.cli", *words], check=True, capture_output=True)


def test_a_diagnosis_survives_a_crash_is_paused_goes_on_and_is_stopped(browser: Any, tmp_path: Path) -> None:
    folder = tmp_path / "work"
    folder.mkdir()
    (tmp_path / "plan.toml").write_text(PLAN)
    tunnel("simulate", str(tmp_path / "plan.toml"), "--out", str(folder / "dry"))
    tunnel("identify", str(folder / "dry"), "--json", str(folder / "dry.output_error.json"))
    log = folder / "dry.diagnosis.log"
    with bench(folder, crash=True) as served, tab(browser, served) as one:
        one.open("/dry/diagnose")
        one.click("Diagnose")
        one.page.wait_for_selector("button:has-text('Pause')", timeout=LONG_MS)
        one.click("Pause")
        one.page.wait_for_selector("button:has-text('Continue')")
    assert work.work_of(log).paused
    with bench(folder) as served, tab(browser, served) as one:
        one.open("/dry/diagnose")
        one.click("Continue")
        one.page.wait_for_selector("button:has-text('Pause')")
        one.click("Stop")
        one.page.wait_for_selector("text=a paused one continues where it was")
        assert not work.work_of(log).running
        one.click("Diagnose")
        one.page.wait_for_selector("a:has-text('Continue: Next run')", timeout=LONG_MS)
    assert json.loads((folder / "dry.diagnosis.json").read_text())["causes"] == []
