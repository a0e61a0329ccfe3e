"""The page Records in a real browser: what files leave open, what is left out, and the campaign's name.

Truth: the files. Skipped where there is no browser. With ``BENCH_PICTURES`` set to a folder, a picture goes there.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.unit.bench.served import bench, tab
from tests.unit.browser import IN_A_BROWSER, chromium, screenshot
from tests.unit.importing.import_files import decay
from tunnel_sim.files.campaign_folder import read_campaign

pytestmark = IN_A_BROWSER
PICTURES = os.environ.get("BENCH_PICTURES")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


def test_wind_on_files_become_one_campaign_under_a_name_of_ones_own(browser: Any, tmp_path: Path) -> None:
    paths = []
    for number, speed in enumerate((0.0, 8.0, 12.0), 1):
        rows = "\n".join(f"{t:.3f},{y:.6f},{speed},16.12" for t, y in zip(*decay(number), strict=True))
        paths.append(tmp_path / f"day3_{number}.csv")
        paths[-1].write_text(f"time_s,yaw_rad,V [m/s],Kr\n{rows}\n")
    notes = tmp_path / "day3_notes.csv"
    notes.write_text("who,what\nme,nothing\n")
    folder = tmp_path / "work"
    with bench(folder) as served, tab(browser, served) as one:
        page = one.page
        page.set_input_files("input[type=file]", [str(path) for path in (*paths, notes)])
        page.wait_for_url("**/day3/records")
        page.wait_for_selector("text=or leave out the file")
        write = page.get_by_role("button", name="Write the campaign")
        assert write.is_disabled()
        page.get_by_label("Leave out files or runs").click()
        for name in ("day3_notes.csv", "day3_2"):
            page.get_by_role("option", name=name, exact=True).click()
            page.get_by_role("option", name=name, exact=True).wait_for(state="hidden")
            page.wait_for_selector(f".q-chip:has-text('{name}')")
            if name == "day3_notes.csv":
                page.get_by_label("Leave out files or runs").click()
        page.wait_for_selector("text=left out as stated")
        name = page.get_by_label("Name of the campaign")
        assert name.input_value() == "day3"
        name.fill("third-day")
        name.press("Enter")
        page.wait_for_url("**/third-day/records")
        page.wait_for_selector(".mark.start")
        page.wait_for_selector("text=left out as stated")
        if PICTURES:
            screenshot(page, path=f"{PICTURES}/records-page.png", full_page=True)
        assert not write.is_disabled()
        one.click("Write the campaign")
        page.wait_for_url("**/conditions")
        page.wait_for_selector("text=wind-on without air_density")
    runs = read_campaign(folder / "third-day").runs
    assert [(run.id, run.wind_speed) for run in runs] == [("day3_1", 0.0), ("day3_3", 12.0)]
