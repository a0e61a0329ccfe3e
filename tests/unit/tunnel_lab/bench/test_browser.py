"""The bench in a real browser: what is dropped, marked, typed and refused. Skipped where there is none.

Truth: files written here, what the style sheet and WCAG 2 ask for, and the guard's rules.
"""

from __future__ import annotations

import http.client
import shutil
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests.support.browser import CONTRASTS, IN_A_BROWSER, LEAST_CONTRAST
from tests.support.diagnosis_document import campaign, document
from tests.support.import_files import decay
from tests.support.served import SETTLED, Bench, tab
from tunnel_lab.bench.workspace import Session
from tunnel_lab.terminal.arguments import file_hashes
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.importing.choices import read_recipe
from tunnel_sim.files.reading import read_json
from tunnel_sim.files.writing import write_json
from tunnel_sim.vocabulary.limits import UPLOAD_BYTES

pytestmark = IN_A_BROWSER
TWO_CHANNELS = Path(__file__).parents[4] / "docs" / "how-to" / "data" / "Measured_data2.mat"


def log_text(seed: int = 1) -> str:
    rows = [f"{t:.3f},{y:.6f}" for t, y in zip(*decay(seed), strict=True)]
    return "time_s,yaw_rad\n" + "\n".join(rows)


def test_dropped_files_are_read_marked_and_written(browser: Any, served: Bench, tmp_path: Path) -> None:
    hostile = tmp_path / "<img src=x onerror=alert(1)>.csv"
    hostile.write_text(log_text())
    with tab(browser, served) as one:
        page = one.page
        page.set_input_files("input[type=file]", [str(hostile)])
        page.wait_for_url("**/img_src_x_onerror_alert_1/records")
        page.wait_for_selector(".mark.start")
        assert page.locator("img").count() == 0
        session = Session(served.folder, "img_src_x_onerror_alert_1")
        assert [path.name for path in session.uploads.iterdir()] == ["img_src_x_onerror_alert_1_.csv"]
        page.set_viewport_size({"width": 390, "height": 900})
        page.get_by_text("Corrections", exact=True).click()
        page.get_by_label("Conditions in the file names").wait_for()
        page.wait_for_function(SETTLED)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        assert page.evaluate(CLIPPED_LABELS) == []
        page.set_viewport_size({"width": 1280, "height": 900})
        mark = page.get_by_role("slider", name="release of")
        mark.focus()
        page.keyboard.press("PageUp")
        page.keyboard.press("ArrowLeft")
        page.wait_for_selector("text=begins at")
        box = page.locator(".mark.end").bounding_box()
        page.mouse.move(box["x"] + 7, box["y"] + 30)
        page.mouse.down()
        page.mouse.move(box["x"] - 60, box["y"] + 30, steps=4)
        page.mouse.up()
        page.wait_for_selector("text=with the motion or before the next run")
        one.click("Write the campaign")
        page.wait_for_url("**/conditions")
    kept = read_campaign(session.campaign).runs[0].record
    assert 1000 < kept.time_s.size < 1560
    assert "stretches" in session.choices.read_text()


def test_a_resting_angle_is_dragged_and_typed(browser: Any, served: Bench, tmp_path: Path) -> None:
    (tmp_path / "hung.csv").write_text(log_text())
    session = Session(served.folder, "hung")
    with tab(browser, served) as one:
        page = one.page
        page.set_input_files("input[type=file]", [str(tmp_path / "hung.csv")])
        page.wait_for_url("**/hung/records")
        line = page.get_by_role("slider", name="rest of hung")
        assert line.inner_text().endswith("rad, found")
        before = float(line.get_attribute("aria-valuenow"))
        line.press("PageUp")
        assert float(line.get_attribute("aria-valuenow")) > before
        stated = line.filter(has_text="stated and subtracted")
        stated.wait_for()
        box = line.bounding_box()
        page.mouse.move(box["x"] + 300, box["y"] + 7)
        page.mouse.down()
        page.mouse.move(box["x"] + 300, box["y"] - 40, steps=4)
        page.mouse.up()
        stated.wait_for()
        assert read_recipe(session.choices).stretches[0].rest == pytest.approx(0.2, abs=0.1)
        page.get_by_text("Resting angles as numbers").click()
        field = page.get_by_label("Rest of hung, to be subtracted [rad]")
        for text, words in (("9", "do not include the stated rest of 9 rad"), ("0.05", "rest, 0.05 rad, is")):
            field.fill(text)
            field.press("Enter")
            page.wait_for_selector(f"text={words}")
        assert line.get_attribute("aria-valuenow") == "0.05"
        one.click("Write the campaign")
        page.wait_for_url("**/conditions")
    (run,) = read_campaign(session.campaign).runs
    assert run.record.yaw_rad == pytest.approx(decay()[1] - 0.05, abs=1e-6)


@pytest.mark.slow
def test_which_of_two_channels_is_the_angle_is_asked_for(browser: Any, served: Bench) -> None:
    with tab(browser, served) as one:
        page = one.page
        page.set_input_files("input[type=file]", [str(TWO_CHANNELS)])
        page.wait_for_url("**/Measured_data2/records")
        page.wait_for_selector("text=2 columns may be the angle: 'data[1]', 'data[2]'")
        page.get_by_label("Column of the angle").click()
        page.get_by_role("option", name="data[1]").click()
        page.keyboard.press("Escape")
        page.wait_for_selector(".mark.rest")
        assert page.locator(".fault").count() == 0
        one.click("Write the campaign")
        page.wait_for_url("**/conditions")
    (run,) = read_campaign(served.folder / "Measured_data2").runs
    assert run.record.sample_rate == pytest.approx(5000.0)


def test_the_unit_of_a_column_is_guessed_shown_and_changed(
    browser: Any, served: Bench, tmp_path: Path
) -> None:
    rows = [f"{1e3 * t:.1f},{y:.6f}" for t, y in zip(*decay(), strict=True)]
    (tmp_path / "bare.csv").write_text("clock,yaw\n" + "\n".join(rows))
    with tab(browser, served) as one:
        page = one.page
        page.set_input_files("input[type=file]", [str(tmp_path / "bare.csv")])
        page.wait_for_url("**/bare/records")
        page.wait_for_selector(".mark.rest")
        page.get_by_text("Columns of the files, and their units").click()
        field = page.get_by_label("Unit of yaw")
        field.wait_for()
        page.wait_for_selector("text=guessed from steps of 5; read as the times")
        page.wait_for_selector("text=guessed from a swing of ±0.3")
        field.click()
        page.get_by_role("option", name="mrad", exact=True).click()
        page.wait_for_selector("text=stated here; read as the angle")
        page.wait_for_selector(".mark.rest")
        one.click("Write the campaign")
        page.wait_for_url("**/conditions")
    (run,) = read_campaign(served.folder / "bare").runs
    assert run.record.sample_rate == pytest.approx(200.0)
    assert abs(run.record.yaw_rad).max() == pytest.approx(abs(decay()[1]).max() / 1000.0, rel=0.01)


@pytest.mark.slow
def test_a_unit_chooses_one_of_two_columns_also_where_it_was_guessed(
    browser: Any, served: Bench, tmp_path: Path
) -> None:
    shutil.copy(TWO_CHANNELS, tmp_path / "again.mat")
    with tab(browser, served) as one:
        page = one.page
        page.set_input_files("input[type=file]", [str(tmp_path / "again.mat")])
        page.wait_for_url("**/again/records")
        page.wait_for_selector("text=rad, guessed from a swing of ±0.1468; not read")
        page.get_by_label("Unit of data[1]").click()
        page.get_by_role("option", name="rad", exact=True).click()
        page.wait_for_selector("text=stated here; read as the angle")
        page.wait_for_selector(".mark.rest")
        assert page.locator(".fault").count() == 0
    choices = read_recipe(Session(served.folder, "again").choices)
    assert (choices.angle, choices.unit) == (("data[1]",), "rad")


def test_the_next_run_is_proposed_and_can_be_kept(browser: Any, served: Bench) -> None:
    shutil.copytree(served.folder / "two", served.folder / "next")
    session = Session(served.folder, "next")
    _diagnosed(session)
    with tab(browser, served, "/next/next-run") as one:
        one.page.wait_for_selector("text=81.5 N m/rad")
        with one.page.expect_download() as found:
            one.click("Download the plan")
        assert "spring_stiffness = 81.5" in Path(found.value.path()).read_text()
        write_json(session.diagnosis, read_json(session.diagnosis, remedy="") | {"next_run": NEAR})
        one.open("/next/next-run")
        one.page.wait_for_selector("text=distinguishes these answers")
        assert one.page.locator("button:has-text('Download the plan')").count() == 0


def test_a_wrong_file_is_refused_in_the_words_of_the_command(
    browser: Any, served: Bench, tmp_path: Path
) -> None:
    wrong = tmp_path / "notes.csv"
    wrong.write_text("nothing but words\n" * 40)
    with tab(browser, served) as one:
        one.page.set_input_files("input[type=file]", [str(wrong)])
        one.page.wait_for_url("**/notes/records")
        line = one.page.locator(".fault").first.inner_text()
        assert "notes.csv: no columns of numbers; give “Delimiter of a text file”" in line
        assert "--" not in line
        assert one.page.get_by_role("button", name="Write the campaign").is_disabled()
    assert not (served.folder / "notes").exists()


def test_a_large_upload_is_refused_before_it_is_stored(browser: Any, served: Bench, tmp_path: Path) -> None:
    large = tmp_path / "large.csv"
    with large.open("wb") as stream:
        stream.truncate(200_000_000)
    before = sorted(served.folder.iterdir())
    with tab(browser, served) as one:
        one.page.set_input_files("input[type=file]", [str(large)])
        one.page.wait_for_selector("text=200 MB are more than the 134 MB of an upload")
        cookies = "; ".join(f"{c['name']}={c['value']}" for c in one.context.cookies())
        uploads = [url for url in one.requests if url.endswith("/upload")]
    assert uploads == []
    # A browser that does not check: the server refuses by the length, and reads nothing.
    connection = http.client.HTTPConnection(served.base.removeprefix("http://"), timeout=30)
    connection.putrequest("POST", "/upload")
    connection.putheader("Cookie", cookies)
    connection.putheader("Content-Length", str(UPLOAD_BYTES + 1))
    connection.endheaders()
    answer = connection.getresponse()
    assert (answer.status, answer.read().count(b"\n")) == (413, 1)
    assert sorted(served.folder.iterdir()) == before


def test_a_refusal_can_be_read_at_every_width(browser: Any, served: Bench) -> None:
    papers = []
    with tab(browser, served) as one:
        for path in ("/nothing", f"/{'long' * 30}/report.html"):
            one.page.goto(served.base + path)
            for width in (390, 1280):
                one.page.set_viewport_size({"width": width, "height": 900})
                wide, seen = one.page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
                assert wide <= seen, (path, width)
            for scheme in ("dark", "light"):
                one.page.emulate_media(color_scheme=scheme)
                pairs = one.page.evaluate(CONTRASTS)
                assert [pair for pair in pairs if pair[1] < LEAST_CONTRAST] == [], (path, scheme)
                assert [words for words, _ in pairs if words in ("Not Found", "Bench", "All campaigns")]
                papers.append(one.page.evaluate("getComputedStyle(document.body).backgroundColor"))
        assert [paper == "rgb(255, 255, 255)" for paper in papers] == [False, True] * 2
        assert [words for words in one.complaints if "404" not in words] == []  # what the browser itself says
        one.complaints.clear()


def test_a_full_disk_is_said_beside_the_drop_zone(browser: Any, served: Bench, tmp_path: Path) -> None:
    (tmp_path / "full.csv").write_text("full")
    before = sorted(served.folder.iterdir())
    with tab(browser, served) as one:
        one.page.set_input_files("input[type=file]", [str(tmp_path / "full.csv")])
        one.page.wait_for_selector(".fault:has-text('The disk is full: nothing was kept.')")
        assert [words for words in one.complaints if "507" not in words] == []
        one.complaints.clear()
        assert sorted(served.folder.iterdir()) == before


@pytest.mark.parametrize("headers", [{}, {"Origin": "http://evil.example"}, {"Host": "evil.example"}])
def test_nobody_else_is_answered(served: Bench, headers: dict[str, str]) -> None:
    for path in (
        "/",
        "/two/records",
        "/two/report.html",
        "/static/bench/bench.css",
        "/_nicegui_ws/socket.io/",
    ):
        connection = http.client.HTTPConnection(served.base.removeprefix("http://"), timeout=30)
        connection.request("GET", path, headers=headers)
        assert connection.getresponse().status in (403, 421)
    assert served.address.startswith("http://127.0.0.1:")


def test_conditions_are_typed_pasted_checked_and_saved(browser: Any, served: Bench) -> None:
    shutil.copytree(served.folder / "two", served.folder / "typed")  # in which one record has two conditions
    session = Session(served.folder, "typed")
    with tab(browser, served, "/typed/conditions") as one:
        page = one.page
        for key, text in (("wind_speed", "12"), ("spring_stiffness", "16")):
            cell = f"[row-id=a] [col-id={key}]"
            page.dblclick(cell)
            page.wait_for_selector(f"{cell} input")  # a slow page would lose what is typed before
            page.keyboard.press("Control+a")
            page.keyboard.type(text)
            page.keyboard.press("Enter")
            page.wait_for_selector(f"{cell}:has-text('{text}'):not(:has(input))")
        page.wait_for_selector("[row-id=a] [col-id=air_density].wrong")
        page.wait_for_selector("text=a: wind-on without air density")
        assert page.get_by_text("3 Identify").get_attribute("aria-disabled") == "true"
        one.open("/typed/conditions")  # what is wrong is kept too
        page.wait_for_selector("[row-id=a] [col-id=air_density].wrong")
        page.evaluate("navigator.clipboard.writeText('16.12\\t1.2\\n44,84\\t1.3')")
        page.click("[row-id=a] [col-id=spring_stiffness]")
        page.keyboard.press("Control+v")
        page.wait_for_selector("text=Continue: Identify")
    found = read_campaign(session.campaign).runs
    assert [(run.spring_stiffness, run.wind_speed, run.air_density) for run in found] == [
        (16.12, 12.0, 1.2),
        (44.84, 0.0, 1.3),
    ]


def test_two_tabs_of_one_campaign_do_not_undo_each_other(browser: Any, served: Bench) -> None:
    shutil.copytree(served.folder / "two", served.folder / "both")
    sizes = (("width [m]", "width", 0.2), ("frontal area A [m²]", "frontal_area", 0.03))
    page = "/both/conditions"
    with tab(browser, served, page) as one, tab(browser, served, page) as two:
        for opened in (one, two):
            opened.page.wait_for_selector(".ag-row")
        for opened, (label, key, value) in zip((one, two), sizes, strict=True):
            field = opened.page.get_by_label(label)
            field.fill(str(value))
            field.press("Tab")
            opened.until(partial(_stated, served.folder / "both", key, value))
    assert all(_stated(served.folder / "both", key, value) for _, key, value in sizes)


def _stated(campaign: Path, key: str, value: float) -> bool:
    return bool(getattr(read_campaign(campaign).rig, key) == value)


def test_two_tabs_do_not_mix(browser: Any, served: Bench) -> None:
    shutil.copytree(served.folder / "two", served.folder / "other")
    with tab(browser, served, "/two/conditions") as one, tab(browser, served, "/other/conditions") as two:
        for opened, text in ((one, "0.5"), (two, "0.7")):
            field = opened.page.get_by_label("reference length l [m]")
            field.fill(text)
            field.press("Tab")
        for opened, text in ((one, "0.5"), (two, "0.7")):
            opened.page.wait_for_function("document.activeElement && true")
            opened.open(opened.page.url.removeprefix(served.base))
            assert opened.page.get_by_label("reference length l [m]").input_value() == text


def test_the_fit_over_the_data_is_beside_the_answer(browser: Any, served: Bench) -> None:
    shutil.copytree(served.folder / "two", served.folder / "fitted")
    session = Session(served.folder, "fitted")
    _diagnosed(session)
    with tab(browser, served, "/fitted/diagnose") as one:
        fit = one.page.frame_locator('iframe[title="The fit over the data"]')
        fit.locator(".uplot").nth(1).wait_for()
        shown = fit.locator("select option").all_inner_texts()
        reading, seen = fit.locator(".u-value").first, "(one) => getComputedStyle(one).visibility"
        assert reading.evaluate(seen) == "hidden"  # no dash where nothing is pointed at
        fit.locator(".u-over").first.hover()
        assert reading.evaluate(seen) == "visible"
        frame = one.page.locator('iframe[title="The fit over the data"]').bounding_box()
        assert frame["height"] > 600
        one.page.wait_for_selector(".figures svg")
        for figure in one.page.locator(".figures figure").all():
            assert figure.locator("svg ~ figcaption").inner_text()
        assert one.page.locator(".verdict dd").count() == 4
        assert one.page.locator(".verdict > :first-child dt").first.inner_text() == "What"
    assert [text.partition(" ")[0] for text in shown] == ["alpha", "gamma"]


@pytest.mark.slow
def test_wind_on_files_become_one_campaign_under_a_name_of_ones_own(
    browser: Any, served: Bench, tmp_path: Path
) -> None:
    paths = []
    for number, speed in enumerate((0.0, 8.0, 12.0), 1):
        rows = "\n".join(f"{t:.3f},{y:.6f},{speed},16.12" for t, y in zip(*decay(number), strict=True))
        paths.append(tmp_path / f"day3_{number}.csv")
        paths[-1].write_text(f"time_s,yaw_rad,V [m/s],Kr\n{rows}\n")
    notes = tmp_path / "day3_notes.csv"
    notes.write_text("who,what\nme,nothing\n")
    with tab(browser, served) as one:
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
        assert not write.is_disabled()
        one.click("Write the campaign")
        page.wait_for_url("**/conditions")
        page.wait_for_selector("text=wind-on without air density")
    runs = read_campaign(served.folder / "third-day").runs
    assert [(run.id, run.wind_speed) for run in runs] == [("day3_1", 0.0), ("day3_3", 12.0)]


PAGES = {
    "/": ".sessions",
    "/try": ".car svg",
    "/two/records": ".chart .uplot >> nth=1",
    "/two/conditions": ".ag-row",
    "/two/identify": "text=Continue: Diagnose",
    "/two/diagnose": ".by-hand:not(.waiting) .value >> nth=0",
    "/two/next-run": "text=Find the run",
    "/two/report": "iframe",
}
"""Every page with the last part of it."""


def test_every_page_can_be_read_at_every_width(browser: Any, served: Bench) -> None:
    session = Session(served.folder, "two")
    _diagnosed(session)
    with tab(browser, served) as one:
        for path, last in PAGES.items():
            one.open(path)
            one.settle(last)
            for width in (390, 1280):
                one.page.set_viewport_size({"width": width, "height": 900})
                one.page.evaluate(DRAWN_AGAIN)
                wide, seen = one.page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
                assert wide <= seen, (path, width)
                assert one.page.evaluate(SIDEWAYS) == [], (path, width)
                assert one.page.evaluate(BROKEN_WORDS) == [], (path, width)
            assert one.page.evaluate(NAMELESS) == [], path
            for scheme in ("dark", "light"):
                one.page.emulate_media(color_scheme=scheme)
                one.page.evaluate(DRAWN_AGAIN)  # colours begin to change; `CONTRASTS` takes them to their end
                pairs = one.page.evaluate(CONTRASTS)
                assert len(pairs) > 5, (path, scheme)
                assert [pair for pair in pairs if pair[1] < LEAST_CONTRAST] == [], (path, scheme)


# Charts follow the width of the page after it is laid out.
DRAWN_AGAIN = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
SIDEWAYS = """() => [...document.querySelectorAll(
  ".printed, .figures figure, .ag-center-cols-viewport")].filter((one) => one.checkVisibility()
  && one.scrollWidth > one.clientWidth + 1).map((one) => one.outerHTML.slice(0, 200))"""
CLIPPED_LABELS = """() => [...document.querySelectorAll(".q-field__label")].filter((one) => one.checkVisibility()
  && (one.scrollWidth > one.clientWidth + 1 || one.scrollHeight > one.clientHeight + 2))
  .map((one) => one.textContent)"""
BROKEN_WORDS = """() => [...document.querySelectorAll(".printed th")].filter((one) => one.checkVisibility())
  .flatMap((one) => {
    const walker = document.createTreeWalker(one, NodeFilter.SHOW_TEXT), found = [];
    for (let node = walker.nextNode(); node; node = walker.nextNode()) {
      for (const word of node.textContent.matchAll(/[A-Za-z]+/g)) {
        const range = document.createRange();
        range.setStart(node, word.index);
        range.setEnd(node, word.index + word[0].length);
        if (new Set([...range.getClientRects()].map((box) => box.top)).size > 1) found.push(word[0]);
      }
    }
    return found;
  })"""
"""Words of a table's heads that are broken over two lines."""
NAMELESS = """() => [...document.querySelectorAll(
  "button, a, input, textarea, select, [role=slider], [role=img], iframe, nav")].filter((one) => {
  if (!one.checkVisibility() || one.closest(".ag-root-wrapper, .u-legend")) return false;
  const label = one.id && document.querySelector(`label[for="${one.id}"]`);
  return !(one.getAttribute("aria-label") || one.title || one.textContent.trim() || label || one.closest("label")
    || one.closest("[aria-label]"));
}).map((one) => one.outerHTML.slice(0, 200))"""


def _diagnosed(session: Session) -> None:
    """A diagnosis written by hand, as if it were of this campaign."""
    write_json(session.estimate("output_error"), {**ESTIMATE, "campaign": session.name})
    given = document() | {"campaign": session.name}
    given["provenance"] = {"versions": {}, "sha256": file_hashes(session.campaign)}
    write_json(session.diagnosis, given)
    assert campaign().runs


NEAR = document()["next_run"] | {"separation": 0.4}
ESTIMATE = {
    "estimator": "output_error", "cn_beta": None, "cn_r": None, "yaw_inertia": None, "mechanical_damping": None,
    "statuses": ["ok"], "remarks": [], "runs": [], "trade_off": None,
}  # fmt: skip
