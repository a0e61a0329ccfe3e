"""Messy files in a real browser, from the drop to the report, without a dead end. Skipped where there is none.

Truth: files written here, of known angles, conditions and releases.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

from tests.marks import slow
from tests.support.browser import IN_A_BROWSER, screenshot
from tests.support.import_files import decay
from tests.support.served import Bench, Tab, tab
from tunnel_lab.bench.workspace import Session
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.importing.choices import read_recipe

pytestmark = IN_A_BROWSER
PICTURES = os.environ.get("BENCH_PICTURES")


def dropped(one: Tab, *paths: Path) -> None:
    one.page.set_input_files("input[type=file]", [str(path) for path in paths])
    one.page.wait_for_url("**/records")


def look(one: Tab, name: str) -> None:
    """Screenshots of the page at two widths in light and dark, where they are wanted."""
    if not PICTURES:
        return
    for width in (390, 1280):
        one.page.set_viewport_size({"width": width, "height": 900})
        for scheme in ("dark", "light"):
            one.page.emulate_media(color_scheme=scheme)
            one.page.wait_for_timeout(1500)
            screenshot(one.page, path=f"{PICTURES}/{name}-{width}-{scheme}.png", full_page=True)


def comma_text(path: Path, time: np.ndarray, angle: np.ndarray) -> None:
    rows = "\n".join(f"{t:.3f},{y:.6f}" for t, y in zip(time, angle, strict=True))
    path.write_text(f"time_s,yaw_rad\n{rows}\n")


def visible_fields(one: Tab) -> list[str]:
    """Labels of the fields that can be seen, without the name of the campaign."""
    found = one.page.locator(".q-field__label:visible").all_inner_texts()
    return [label for label in found if not label.startswith(("Name of", "Unit of pot", "Unit of t"))]


@pytest.mark.slow
def test_volts_ask_for_a_calibration_and_for_nothing_else(
    browser: Any, served: Bench, tmp_path: Path
) -> None:
    time, angle = decay()
    scipy.io.savemat(tmp_path / "volts.mat", {"t": time, "pot_V": 2.5 + 4.0 * angle})
    with tab(browser, served) as one:
        dropped(one, tmp_path / "volts.mat")
        field = one.page.get_by_label("Angle of a voltage")
        field.wait_for()
        assert visible_fields(one) == ["Angle of a voltage"]
        look(one, "volts")
        field.fill("-0.625 + 0.25*V")
        field.press("Enter")
        one.page.wait_for_selector(".mark.start")
        assert field.input_value() == "-0.625 + 0.25*V"  # it can still be corrected
        one.click("Write the campaign")
        one.page.wait_for_url("**/conditions")
        one.page.wait_for_selector("text=Continue: Identify")
    (run,) = read_campaign(served.folder / "volts").runs
    assert run.record.yaw_rad == pytest.approx(angle, abs=1e-6)


def test_a_clipped_run_comes_first_until_its_release_is_moved(
    browser: Any, served: Bench, tmp_path: Path
) -> None:
    time, angle = decay(duration=16.0)
    comma_text(tmp_path / "day4_a.csv", time, angle)
    comma_text(tmp_path / "day4_b.csv", time, np.clip(angle, -0.2, 0.2))
    with tab(browser, served) as one:
        page = one.page
        dropped(one, tmp_path / "day4_a.csv", tmp_path / "day4_b.csv")
        page.wait_for_selector("text=To judge, below: day4_b")
        page.wait_for_selector(".uplot >> nth=1")
        assert page.locator("figure.chart figcaption").all_inner_texts() == ["day4_b", "day4_a"]
        assert page.locator(".doubt:has-text('peaks are cut off at')").count() == 1
        look(one, "clipped")
        mark = page.get_by_role("slider", name="release of day4_b")
        mark.focus()
        for _ in range(20):
            page.keyboard.press("PageUp")
        page.locator(".doubt:has-text('peaks are cut off at')").wait_for(state="detached")
        page.locator("text=To judge, below").wait_for(state="hidden")
        assert page.locator("figure.chart figcaption").all_inner_texts() == ["day4_b", "day4_a"]


@pytest.mark.parametrize("by", [slow("mouse"), "keyboard"])
def test_a_release_is_added_moved_and_removed(browser: Any, served: Bench, tmp_path: Path, by: str) -> None:
    time, angle = decay(duration=16.0)
    name = f"by{by}"
    comma_text(tmp_path / f"{name}.csv", time, angle)
    session = Session(served.folder, name)

    def press(label: str) -> None:
        place = one.page.get_by_role("button", name=label, exact=True)
        if by == "mouse":
            place.click()
        else:
            place.focus()
            one.page.keyboard.press("Enter")

    with tab(browser, served) as one:
        page = one.page
        dropped(one, tmp_path / f"{name}.csv")
        page.get_by_role("slider", name=f"release of {name}").wait_for()
        press(f"Add a release to {name}")
        added = page.get_by_role("slider", name=f"release of {name}-added-1")
        added.wait_for()
        assert float(added.get_attribute("aria-valuenow")) == pytest.approx(8.0, abs=0.2)
        page.wait_for_function("document.activeElement.classList.contains('mark')")
        if by == "mouse":
            box = added.bounding_box()
            page.mouse.move(box["x"] + 7, box["y"] + 60)
            page.mouse.down()
            page.mouse.move(box["x"] + 87, box["y"] + 60, steps=4)
            page.mouse.up()
        else:
            for _ in range(8):
                page.keyboard.press("PageUp")
        one.until(lambda: read_recipe(session.choices).stretches[0].start > 9.0)
        page.wait_for_selector("td:has-text('not stated') >> nth=1")
        look(one, f"added-{by}")
        press(f"Leave out: {name}")
        page.get_by_role("button", name=f"Use again: {name}", exact=True).wait_for()
        press(f"Use again: {name}")
        page.get_by_role("button", name=f"Leave out: {name}", exact=True).wait_for()
        one.click("Write the campaign")
        page.wait_for_url("**/conditions")
        one.open(f"/{name}/records")
        added.wait_for()
        first, second = read_campaign(session.campaign).runs
        assert (first.id, second.id) == (name, f"{name}-added-1")
        moved = read_recipe(session.choices).stretches[0].start
        assert first.record.time_s[-1] == pytest.approx(moved, abs=0.01)
        assert first.record.time_s.size + second.record.time_s.size == time.size
        if by == "mouse":
            press(f"Remove: {name}-added-1")
        else:
            added.focus()
            page.keyboard.press("Delete")
        added.wait_for(state="detached")
    assert read_recipe(session.choices).stretches == ()


def german(path: Path, seed: int, speed: float, stiffness: float) -> None:
    time, angle = decay(seed, duration=10.0)
    head = (
        "Datenlogger\r\nStirnfläche [cm2]: 360\r\nZeit [s];Gierwinkel [°];Windgeschwindigkeit [km/h];Kr\r\n"
    )
    rows = [f"{t:.3f};{np.degrees(y):.4f};{speed};{stiffness}" for t, y in zip(time, angle, strict=True)]
    path.write_bytes((head + "\r\n".join(rows).replace(".", ",")).encode("cp1252"))


def test_a_condition_that_is_missing_does_not_end_the_way(
    browser: Any, served: Bench, tmp_path: Path
) -> None:
    paths = [tmp_path / f"Messung_{number}.csv" for number in (1, 2)]
    for number, path in enumerate(paths, 1):
        german(path, number, 36.0 * (number - 1), 16.12)
    with tab(browser, served) as one:
        page = one.page
        dropped(one, *paths)
        page.wait_for_selector(".mark.start")
        one.click("Write the campaign")
        page.wait_for_url("**/conditions")
        page.wait_for_selector("text=Identify waits: correct the conditions that are marked first.")
        page.wait_for_selector("text=Messung_2: wind-on without air density: give it in kg/m³")
        assert page.get_by_label("frontal area A").input_value() == "0.036"
        look(one, "conditions")
        page.get_by_label("Value").fill("1.2")
        page.get_by_label("Value").press("Enter")
        page.wait_for_selector("text=Continue: Identify")
        assert page.locator(".waits").count() == 0
        one.click("Continue: Identify")
        page.wait_for_url("**/identify")
        page.wait_for_selector("text=Diagnose waits: identify the campaign with output_error first")
        look(one, "identify")


@pytest.mark.slow
def test_the_keyboard_alone_leads_from_german_files_to_the_report(
    browser: Any, served: Bench, tmp_path: Path
) -> None:
    runs = ((0.0, 16.12), (36.0, 16.12), (0.0, 20.62), (54.0, 20.62))
    paths = [tmp_path / f"Lauf_{number}.csv" for number in range(1, 5)]
    for number, (path, (speed, stiffness)) in enumerate(zip(paths, runs, strict=True), 1):
        german(path, number, speed, stiffness)

    with tab(browser, served) as one:
        page = one.page

        def enter(words: str) -> None:
            """Press the button or the link, which only the Tab key may reach."""
            place = page.locator(f":is(button, a.button):has-text('{words}')").first
            place.wait_for(timeout=600_000)
            page.wait_for_function("!document.querySelector('main .waiting')")
            for _ in range(80):
                if place.evaluate("(one) => one === document.activeElement"):
                    break
                page.keyboard.press("Tab")
            assert place.evaluate("(one) => one === document.activeElement"), words
            page.keyboard.press("Enter")

        dropped(one, *paths)
        page.wait_for_selector(".mark.start")
        enter("Write the campaign")
        page.wait_for_url("**/conditions")
        for label, text in (("Value", "1.2"), ("reference length l [m]", "0.3")):
            page.get_by_label(label).focus()
            page.keyboard.type(text)
            page.keyboard.press("Enter")
        enter("Continue: Identify")
        page.wait_for_url("**/identify")
        enter("Identify")
        enter("Continue: Diagnose")
        page.wait_for_url("**/diagnose")
        page.wait_for_selector("text=It compares sets of effects with the runs")
        enter("Diagnose")
        page.wait_for_selector(":text('so far'), a:has-text('Continue: Next run')")
        look(one, "diagnosing")
        enter("Continue: Next run")
        page.wait_for_url("**/next-run")
        enter("Continue: Report")
        page.wait_for_url("**/report")
        page.wait_for_selector("iframe")
        look(one, "report")
        with page.expect_download() as found:
            enter("Download the report")
        assert "Diagnosis of Lauf" in Path(found.value.path()).read_text("utf-8")
