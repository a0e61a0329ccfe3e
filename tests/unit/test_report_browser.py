"""The report in a real browser: charts, themes and widths. Skipped where Playwright or a Chromium is missing.

Truth: a document written by hand, and what the style sheet and WCAG 2 ask for.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.unit.browser import CONTRASTS, IN_A_BROWSER, LEAST_CONTRAST, chromium
from tests.unit.diagnosis_document import campaign, document
from tunnel_lab.diagnosis_view import Byline, write_report

pytestmark = IN_A_BROWSER


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    given = document()
    given["where"]["words"] = "Everywhere."
    given["maps"]["traces"][0]["time_s"] = [0.0, 3.6, 7.3]  # of a record of 7.31 s
    given["provenance"] = {"versions": {"numpy": "2"}, "sha256": {"runs/alpha.csv": "ab" * 32}}
    path = tmp_path_factory.mktemp("report") / "report.html"
    return write_report(given, campaign(), path, Byline("2026-05-31", "A. Smith"))


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


class Opened:
    """The report in a tab, and what it has complained about or asked for."""

    def __init__(self, browser: Any, report: Path, width: int, **given: Any) -> None:
        self.context = browser.new_context(viewport={"width": width, "height": 900}, **given)
        self.page = self.context.new_page()
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(report.as_uri())

    def open_all(self) -> None:
        self.page.click("#fold")
        self.page.wait_for_function("document.querySelectorAll('.uplot').length === 5")


@pytest.fixture
def opened(browser: Any, report: Path, request: pytest.FixtureRequest) -> Iterator[Opened]:
    tab = Opened(browser, report, **getattr(request, "param", {"width": 1200}))
    yield tab
    tab.context.close()
    assert tab.complaints == []
    assert {url.partition(":")[0] for url in tab.requests} <= {"file", "data"}


WIDTHS = [{"width": width, "color_scheme": scheme} for width in (390, 1200) for scheme in ("light", "dark")]


@pytest.mark.parametrize("opened", WIDTHS, indirect=True)
def test_nothing_is_wider_than_the_page_and_every_text_can_be_read(opened: Opened) -> None:
    opened.open_all()
    wide, seen = opened.page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
    assert wide <= seen
    pairs = opened.page.evaluate(CONTRASTS)
    assert len(pairs) > 50
    assert [pair for pair in pairs if pair[1] < LEAST_CONTRAST] == []


@pytest.mark.parametrize("opened", WIDTHS[:1], indirect=True)
def test_the_summary_stands_open_and_the_detail_is_folded(opened: Opened) -> None:
    assert opened.page.is_visible("text=What to do next")
    assert opened.page.is_visible('figure[data-figure="waterfall"] svg')
    assert not opened.page.is_visible("text=Everywhere.")
    opened.page.click("text=Where the model departs from the runs")
    assert opened.page.is_visible("text=Everywhere.")


def test_a_chart_zooms_by_dragging_and_by_button(opened: Opened) -> None:
    opened.open_all()
    figure = opened.page.locator('figure[data-figure="residuals"]')
    over = figure.locator(".u-over").first
    over.scroll_into_view_if_needed()

    def ends() -> list[float]:
        """Times under the left and right edge of the residuals, which follow the reading."""
        found = []
        box = figure.locator(".u-over").nth(1).bounding_box()
        for share in (0.002, 0.998):
            opened.page.mouse.move(box["x"] + share * box["width"], box["y"] + 20)
            found.append(float(figure.locator(".u-value").nth(2).inner_text()))
        return found

    first, last = ends()
    assert (first, last) == (0.0, 7.3)
    box = over.bounding_box()
    opened.page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 60)
    opened.page.mouse.down()
    opened.page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 60, steps=5)
    opened.page.mouse.up()
    assert ends() == [3.6, 3.6]  # the only sample left of the residual
    figure.get_by_label("Show the whole chart").click()
    assert ends() == [0.0, 7.3]
    figure.get_by_label("Zoom in").click()
    figure.get_by_label("Move right").click()
    assert ends() == [3.6, 7.3]


def test_runs_are_chosen_by_name_and_by_a_click_on_the_map(opened: Opened) -> None:
    opened.open_all()
    choice = opened.page.locator('figure[data-figure="residuals"] select')
    assert [text.partition(" ")[0] for text in choice.locator("option").all_inner_texts()] == [
        "alpha",
        "gamma",
    ]
    cells = opened.page.locator('figure[data-figure="where-runs"] .u-over')
    cells.scroll_into_view_if_needed()
    box = cells.bounding_box()
    place = {"x": 0.1 * box["width"], "y": box["height"] * 2.5 / 3.0}  # the last of three runs
    cells.hover(position=place)
    hint = opened.page.locator('figure[data-figure="where-runs"] p.small')
    assert re.fullmatch(r"gamma, .* 0 to 2: 2 noise variances", hint.inner_text())
    cells.click(position=place)
    assert choice.locator("option:checked").inner_text().startswith("gamma")


@pytest.mark.parametrize("opened", [{"width": 1200, "color_scheme": "dark"}], indirect=True)
def test_the_theme_follows_the_system_until_it_is_chosen(opened: Opened) -> None:
    opened.open_all()

    def paper() -> str:
        found: str = opened.page.evaluate("getComputedStyle(document.body).backgroundColor")
        return found

    dark = paper()
    opened.page.click("#theme")
    assert "light" in opened.page.inner_text("#theme")
    assert paper() == "rgb(255, 255, 255)" != dark
    opened.page.click("#theme")
    assert paper() == dark
    opened.page.emulate_media(media="print")
    assert paper() == "rgb(255, 255, 255)"
    figure = opened.page.locator('figure[data-figure="residuals"]')
    assert figure.locator("svg").is_visible()
    assert not figure.locator(".uplot").first.is_visible()


def test_without_scripts_the_drawn_figures_are_shown(browser: Any, report: Path) -> None:
    tab = Opened(browser, report, 1200, java_script_enabled=False)
    tab.page.click("text=How far the gap closes, run by run")
    assert tab.page.is_visible('figure[data-figure="residuals"] svg')
    assert not tab.page.is_visible("#theme")
    tab.context.close()


def test_tables_and_pictures_are_named_for_a_screen_reader(opened: Opened) -> None:
    opened.open_all()
    nameless = """() => [...document.querySelectorAll(
      "table, .u-wrap, svg, button, select, figure")].filter((one) => {
      if (one.closest(".u-legend") || one.classList.contains("u-legend") || !one.checkVisibility()) return false;
      if (one.tagName === "TABLE") return !one.caption || !one.querySelector("th[scope=col]");
      if (one.tagName === "FIGURE") return !one.querySelector("figcaption");
      return !(one.getAttribute("aria-label") || one.ariaLabel || one.textContent.trim());
    }).map((one) => one.outerHTML.slice(0, 200))"""
    assert opened.page.evaluate(nameless) == []
