"""The report in a real browser: charts, themes and widths. Skipped where there is no Chromium.

Truth: a document written by hand, and what the style sheet and WCAG 2 ask for.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.marks import slow
from tests.support.browser import CONTRASTS, IN_A_BROWSER, LEAST_CONTRAST
from tests.support.diagnosis_document import campaign, document, findings_of
from tunnel_lab.report import Byline, render_report, security_policy, write_pdf, write_report

pytestmark = IN_A_BROWSER


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    given = document()
    given["where"]["words"] = "Everywhere."
    given["provenance"] = {"versions": {"numpy": "2"}, "sha256": {"runs/alpha.csv": "ab" * 32}}
    path = tmp_path_factory.mktemp("report") / "report.html"
    return write_report(findings_of(given), campaign(), path, Byline("2026-05-31", "A. Smith"))


class Opened:
    """The report in a tab, and what it has complained about or asked for."""

    def __init__(self, browser: Any, report: Path, width: int, script: str = "", **given: Any) -> None:
        self.context = browser.new_context(viewport={"width": width, "height": 900}, **given)
        self.page = self.context.new_page()
        self.page.add_init_script(script)
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


def test_with_the_policy_of_the_bench_its_own_scripts_run_and_no_other(browser: Any, report: Path) -> None:
    page = browser.new_page()
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    foreign = report.read_text().replace("</body>", "<script>document.title = 'foreign'</script></body>")
    headers = {"content-security-policy": security_policy()}
    page.route("**", lambda route: route.fulfill(body=foreign, content_type="text/html", headers=headers))
    page.goto("http://127.0.0.1/report.html")
    page.click("#fold")
    page.wait_for_function("document.querySelectorAll('.uplot').length === 5")
    assert page.title() != "foreign"
    assert page.evaluate("origin") == "null"
    assert len(complaints) == 1, complaints  # on the foreign script
    page.close()


WIDTHS = [{"width": width, "color_scheme": "light"} for width in (390, 1200)]


SIDEWAYS = """() => [...document.querySelectorAll(".scroll, .drawn, .charts")].filter((one) =>
  one.checkVisibility() && one.scrollWidth > one.clientWidth + 1).map((one) => one.outerHTML.slice(0, 200))"""


@pytest.mark.parametrize("opened", WIDTHS, indirect=True)
def test_nothing_is_wider_than_the_page_and_every_text_can_be_read(opened: Opened) -> None:
    opened.open_all()
    wide, seen = opened.page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
    assert wide <= seen
    assert opened.page.evaluate(SIDEWAYS) == []
    for scheme in ("light", "dark"):
        opened.page.emulate_media(color_scheme=scheme)
        pairs = opened.page.evaluate(CONTRASTS)
        assert len(pairs) > 50
        assert [pair for pair in pairs if pair[1] < LEAST_CONTRAST] == [], scheme


LONG = """() => {
  const table = document.querySelector("#coefficients-section table");
  for (const row of table.rows) {
    const added = row.insertCell();
    added.className = "n";
    added.textContent = "added";
    for (const cell of row.querySelectorAll("td")) cell.innerHTML = "<span>−0.1112943 ± 0.0000071</span>";
  }
}"""
OVER = """() => {
  const [section, table] = ["", " table"].map((end) =>
    document.querySelector("#coefficients-section" + end).getBoundingClientRect().right);
  return table - section;
}"""


@pytest.mark.parametrize(
    ("opened", "media"), [(WIDTHS[0], "screen"), (WIDTHS[1], "print")], indirect=["opened"]
)
def test_long_coefficients_stay_beside_the_waterfall(opened: Opened, media: Any) -> None:
    opened.page.evaluate(LONG)
    opened.page.emulate_media(media=media)
    assert opened.page.evaluate(OVER) <= 1.0


@pytest.mark.parametrize("opened", WIDTHS[:1], indirect=True)
def test_the_first_sheet_stands_open_and_the_detail_is_folded(opened: Opened) -> None:
    assert opened.page.is_visible("text=What to do next")
    assert opened.page.is_visible('figure[data-figure="waterfall"] svg')
    assert not opened.page.is_visible("text=Everywhere.")
    opened.page.click("text=Where the model departs from the runs")
    assert opened.page.is_visible("text=Everywhere.")


def test_a_chart_begins_at_the_largest_difference_and_zooms_by_dragging_and_by_button(opened: Opened) -> None:
    opened.open_all()
    figure = opened.page.locator('figure[data-figure="fit"]')
    over = figure.locator(".u-over").first
    over.scroll_into_view_if_needed()

    def ends() -> list[float]:
        """Times of the samples nearest the left and right edge of the residuals, which follow the reading."""
        found = []
        figure.locator(".u-over").nth(1).scroll_into_view_if_needed()
        box = figure.locator(".u-over").nth(1).bounding_box()
        for share in (0.002, 0.998):
            opened.page.mouse.move(box["x"] + share * box["width"], box["y"] + 20)
            found.append(float(figure.locator(".u-value").nth(4).inner_text()))
        return found

    assert ends() == [1.0, 2.0]  # of the times 0, 1, 2 from 0.5 to 2 s
    figure.get_by_label("Show the whole chart").click()
    assert ends() == [0.0, 2.0]
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    opened.page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 60)
    opened.page.mouse.down()
    opened.page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 60, steps=5)
    opened.page.mouse.up()
    assert ends() == [1.0, 1.0]  # the only sample left
    figure.get_by_label("Show the whole chart").click()
    figure.get_by_label("Zoom in").click()
    figure.get_by_label("Move right").click()
    assert ends() == [1.0, 2.0]
    figure.locator("select").select_option(index=1)
    assert ends() == [0.0, 1.5]  # of the times 0, 1.5, 3 from 0 to 1.5 s


def test_runs_are_chosen_by_name_and_by_a_click_on_the_map(opened: Opened) -> None:
    opened.open_all()
    choice = opened.page.locator('figure[data-figure="fit"] select')
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
    assert re.fullmatch(r"gamma · 21\.5 m/s, time since .* 0 to 2: 2 noise variances", hint.inner_text())
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
    figure = opened.page.locator('figure[data-figure="fit"]')
    assert figure.locator("svg").is_visible()
    assert not figure.locator(".uplot").first.is_visible()


def test_without_scripts_the_drawn_figures_are_shown(browser: Any, report: Path) -> None:
    tab = Opened(browser, report, 1200, java_script_enabled=False)
    tab.page.click("text=How much of the gap is explained, run by run")
    assert tab.page.is_visible('figure[data-figure="fit"] svg')
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


GAP = (3.0, 4.2)  # s, without samples, of the first run
# Keeps the charts that a page makes, to ask where they draw a value.
KEEP_CHARTS = """let kept; window.charts = [];
const construct = (kind, given) => { charts.push(new kind(...given)); return charts.at(-1); };
Object.defineProperty(window, "uPlot", { configurable: true, get: () => kept,
  set: (made) => { kept = new Proxy(made, { construct }); } });
window.live = (figure) => charts.filter((one) => one.root.isConnected
  && one.root.closest(`[data-figure="${figure}"]`));"""
# Of one curve alone: how many values it holds, and whether it is drawn at each of the places in its axes' units.
DRAWN = """async ([figure, place, series, points]) => {
  const chart = live(figure)[place];
  const picture = async (shown) => {
    chart.series.forEach((_, i) => { if (i) chart.setSeries(i, { show: i === shown }); });
    await new Promise((done) => setTimeout(done));
    return chart.ctx.getImageData(0, 0, chart.ctx.canvas.width, chart.ctx.canvas.height);
  };
  const [without, given] = [await picture(-1), await picture(series)];
  const stroke = chart.series[series].stroke().match(/[\\d.]+/g).map(Number);
  const far = (image, at) => stroke.slice(0, 3).reduce((sum, v, i) => sum + Math.abs(v - image.data[at + i]), 0);
  const drawn = ([x, y]) => {
    const [column, row] = [chart.valToPos(x, "x", true), chart.valToPos(y, "y", true)].map(Math.round);
    const near = [-2, -1, 0, 1, 2];
    return near.some((i) => near.some((j) => {
      const at = 4 * ((row + j) * given.width + column + i);
      return far(given, at) < 0.5 * far(without, at);
    }));
  };
  return [chart.data[series].filter((v) => v != null).length, points.map(drawn)];
}"""
CELLS = """(figure) => {
  const [chart] = live(figure);
  const spec = JSON.parse(document.getElementById("chart-data").textContent)[figure][0];
  const middles = (edges) => edges.slice(1).map((edge, i) => 0.5 * (edge + edges[i]));
  return middles(spec.y.edges).map((y) => middles(spec.x.edges).map((x) => chart.ctx.getImageData(
    Math.round(chart.valToPos(x, "x", true)), Math.round(chart.valToPos(y, "y", true)), 1, 1).data[3] > 0));
}"""


Line = list[tuple[float, float]]


def line(x: Any, y: Any) -> Line:
    """The points of a curve that hold a value."""
    return [(at, value) for at, value in zip(x, y, strict=True) if value is not None]


def middles(points: Line, logarithmic: bool) -> Line:
    """The middle of each part of a line on its axes."""
    there, back = (np.log, np.exp) if logarithmic else (np.asarray, np.asarray)
    given = there(np.array(points))
    return [tuple(middle) for middle in back(0.5 * (given[1:] + given[:-1])).tolist()]


def holed() -> dict[str, Any]:
    """A document whose spectrum has empty bins, other ones for every run; and a gap in the first run."""
    given = document()
    excess = [8.0, 7.0, 15.0, None, 5.0, 3.0, 50.0, 2.0, 6.0, 0.2, -0.6, 0.4]
    given["maps"]["frequency"] |= {
        "edges_hz": [0.0, *np.geomspace(0.05, 20.0, 12).tolist()],
        "excess": excess,
        "after": [None if v is None else 0.1 * (i % 3) for i, v in enumerate(excess)],
        "std": [None if v is None else 0.1 for v in excess],
        "by_run": [[8.0, None, 20.0, None, None, 3.0, 60.0, 1.0, 2.0, None, -0.5, 0.2],
                   [None, None, 9.0, None, 5.0, None, 70.0, 2.0, 9.0, 0.1, None, None],
                   [None, 7.0, None, None, None, None, 20.0, 3.0, 6.0, 0.3, -0.9, 0.7]],
    }  # fmt: skip
    when = [t for t in np.arange(0.0, 7.3, 0.1).round(1).tolist() if not GAP[0] <= t <= GAP[1]]
    before, after = ([size * np.sin(speed * t) for t in when] for size, speed in ((4e-3, 5.0), (1e-3, 3.0)))
    reading = [0.3 * np.cos(5.0 * t) for t in when]
    given["maps"]["traces"][0] |= {
        "time_s": when,
        "reading_rad": reading,
        "before_rad": before,
        "after_rad": after,
        "differ_s": [0.0, 7.3],
    }
    given["maps"]["traces"][1]["differ_s"] = [0.0, 3.0]
    return given


def expected_curves(given: dict[str, Any]) -> Iterator[tuple[str, int, int, int, Line]]:
    """Figure, chart, view, series and points of every curve, from the document."""
    spectrum = given["maps"]["frequency"]
    edges = np.array(spectrum["edges_hz"])
    centres = np.sqrt(np.array([0.5 * edges[1], *edges[1:-1]]) * edges[1:]).tolist()

    def power(excess: Sequence[float | None]) -> Line:
        return [(x, max(1.0 + value, 0.3)) for x, value in line(centres, excess)]

    noise = [[None if v is None else factor * v for v in spectrum["std"]] for factor in (-3.0, 3.0)]
    for series, values in enumerate((*noise, spectrum["excess"], spectrum["after"]), 1):
        yield "where-spectrum", 0, 0, series, power(values)
    for view, values in enumerate(spectrum["by_run"], 1):
        yield "where-spectrum", 0, view, 3, power(values)
    for view, trace in enumerate(given["maps"]["traces"]):
        reading = np.degrees(trace["reading_rad"])
        yield "fit", 0, view, 1, line(trace["time_s"], reading.tolist())
        for series, name in enumerate(("before_rad", "after_rad"), 1):
            if trace[name] is not None:
                residual = np.degrees(trace[name])
                yield "fit", 0, view, series + 1, line(trace["time_s"], (reading - residual).tolist())
                yield "fit", 1, view, series, line(trace["time_s"], residual.tolist())


def test_every_curve_and_cell_is_drawn_as_in_the_document(browser: Any, tmp_path: Path) -> None:
    given = holed()
    report = write_report(
        findings_of(given), campaign(), tmp_path / "report.html", Byline("2026-05-31", "A. Smith")
    )
    tab = Opened(browser, report, 1200, KEEP_CHARTS)
    tab.open_all()
    gaps = 0
    for figure, place, view, series, points in expected_curves(given):
        about = (figure, place, view, series)
        tab.page.locator(f'figure[data-figure="{figure}"] select').select_option(index=view)
        between = middles(points, logarithmic=figure == "where-spectrum")
        broken = figure == "fit" and view == 0
        crosses = [broken and x <= GAP[0] and to >= GAP[1] for (x, _), (to, _) in pairwise(points)]
        count, drawn = tab.page.evaluate(DRAWN, [figure, place, series, points + between])
        assert count == len(points), about
        assert drawn == [True] * len(points) + [not across for across in crosses], about
        gaps += sum(crosses)
    assert gaps == 5  # of the reading, two models and two residuals
    painted = [[True, True, False], [True, False, True], [True, True, False]]
    assert tab.page.evaluate(CELLS, "where-runs") == painted
    assert tab.page.evaluate(CELLS, "where-phase-plane") == [[True, True], [False, False]]
    assert [
        said for said in tab.complaints if "willReadFrequently" not in said
    ] == []  # the test's own readings
    tab.context.close()


def pages(printed: bytes) -> int:
    """Number of pages of a PDF by Chromium."""
    return len(re.findall(rb"/Type\s*/Page\b", printed))


def size_of(printed: bytes) -> tuple[int, int]:
    """Width and height of the pages of a PDF by Chromium, pt."""
    (found,) = set(re.findall(rb"/MediaBox\s*\[0 0 ([\d.]+) ([\d.]+)\]", printed))
    return round(float(found[0])), round(float(found[1]))


BOTH = (595, 791)  # pt: as wide as A4 and as high as Letter
MARGINS = dict.fromkeys(("top", "bottom", "left", "right"), "12mm")


def crowded(given: Any) -> None:
    """Many causes, long words and many caveats."""
    given["verdict"] = "The gap is explained by quadratic damping. " * 12
    given["waterfall"] += [{"effect": name, "excess": 0.1} for name in ("free_play", "mains_hum")]
    given["cautions"] = [f"Caveat {number}: the runs differ in their springs. " * 3 for number in range(12)]
    given["disturbed"] = [
        {"run": f"r{n}", "at_s": 1.0, "kept_until_s": None, "p_value": 1e-9, "used": False} for n in range(6)
    ]


def without_causes(given: Any) -> None:
    given["causes"], given["waterfall"], given["without"] = [], given["waterfall"][:1], {}
    given["candidates"][0]["effect"] = "none"


def exact(given: Any) -> None:
    """No gap, and coefficients of many digits."""
    without_causes(given)
    for name in ("cn_beta", "cn_r"):
        for part in ("before", "after"):
            given["coefficients"][part][name] |= {"std": 1.2e-5}


def unknown(given: Any) -> None:
    given["causes"], given["waterfall"], given["without"] = ["unknown"], given["waterfall"][:1], {}


def undecided(given: Any) -> None:
    given["decided"] = False


@cache
def changed(change: Callable[[Any], None]) -> str:
    """The report of the document with a change, which takes some seconds to draw."""
    change(given := document())
    return render_report(findings_of(given), campaign())


KINDS = [slow(lambda _: None), crowded, slow(unknown), slow(undecided)]
FIRST_PAGE = """() => {
  const [first, second] = document.querySelectorAll(".sheet");
  return [first.innerText, second.innerText, getComputedStyle(second).breakBefore];
}"""


def test_a_report_without_a_gap_is_printed_on_one_page(browser: Any, tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text(changed(without_causes), encoding="utf-8")
    page = browser.new_page()
    page.goto((tmp_path / "report.html").as_uri())
    for paper in ("Letter", "A4"):
        assert pages(page.pdf(format=paper, margin=MARGINS)) == 1
    page.close()


@pytest.mark.parametrize("change", KINDS)
def test_the_report_is_printed_on_two_pages_of_either_paper(
    browser: Any, tmp_path: Path, change: Any
) -> None:
    (tmp_path / "report.html").write_text(changed(change), encoding="utf-8")
    page = browser.new_page()
    page.goto((tmp_path / "report.html").as_uri())
    for paper in (
        "Letter",
        "A4",
    ):  # the less high paper, and the narrower one, on which text takes more lines
        assert pages(page.pdf(format=paper, margin=MARGINS)) == 2
    page.emulate_media(media="print")
    first, second, breaks = page.evaluate(FIRST_PAGE)
    assert breaks == "page"
    for words in ("How sure", "Coefficients", "What to do next"):
        assert words in first
    assert ("Caveat 11" in second) == (change is crowded)
    assert "Tests, noise and provenance" not in first + second
    page.close()


def test_what_is_opened_is_printed_too(opened: Opened) -> None:
    assert pages(opened.page.pdf(format="A4", margin=MARGINS)) == 2
    opened.open_all()
    assert pages(opened.page.pdf(format="A4", margin=MARGINS)) > 2


@pytest.mark.usefixtures("browser")
def test_the_pdf_is_a_file_of_two_pages_for_both_papers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tunnel_lab.report.page.render_report", lambda *_: changed(crowded))
    path = write_pdf(findings_of(document()), campaign(), tmp_path / "report.pdf")
    assert path.read_bytes().startswith(b"%PDF")
    assert pages(path.read_bytes()) == 2
    assert size_of(path.read_bytes()) == BOTH


PHONE = """() => {
  const top = (what) => document.querySelector(what).getBoundingClientRect().top + scrollY;
  const letters = [...document.querySelectorAll("#head dd")].map((one) => getComputedStyle(one).fontSize);
  return [...["#fit", "#coefficients-section", "#next", "#closes"].map(top), Math.min(...letters.map(parseFloat))];
}"""


@pytest.mark.parametrize("opened", WIDTHS[:1], indirect=True)
def test_on_a_phone_the_answer_fills_the_first_screen_in_large_letters_and_the_second_has_the_steps(
    opened: Opened,
) -> None:
    fit, coefficients, steps, closes, least = opened.page.evaluate(PHONE)
    assert fit < 844.0  # px: the height of a common phone
    assert fit < coefficients < steps < min(closes, 2.0 * 844.0)
    assert least >= 19.0


BROKEN = """() => {
  const found = [];
  for (const cell of document.querySelectorAll("#coefficients-section td.n, #head dd")) {
    const walker = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT), range = document.createRange();
    for (let node = walker.nextNode(); node; node = walker.nextNode()) {
      for (const word of node.textContent.matchAll(/[\\d.]+( N m| %)?/g)) {
        range.setStart(node, word.index);
        range.setEnd(node, word.index + word[0].length);
        if (new Set([...range.getClientRects()].map((one) => Math.round(one.top))).size > 1) found.push(word[0]);
      }
    }
  }
  return found;
}"""


@pytest.mark.usefixtures("undrawn")
def test_no_number_of_the_head_and_the_coefficients_is_broken_on_a_phone(
    browser: Any, tmp_path: Path
) -> None:
    exact(given := document())
    (tmp_path / "report.html").write_text(render_report(findings_of(given), campaign()), encoding="utf-8")
    page = browser.new_page(viewport={"width": 390, "height": 844})
    page.goto((tmp_path / "report.html").as_uri())
    for scale in (1.0, 1.3):
        page.evaluate(f"document.documentElement.style.fontSize = '{16.0 * scale}px'")
        assert page.evaluate(BROKEN) == []
    page.close()


BREAKS = """(what) => {
  const one = document.querySelector(what);
  const style = getComputedStyle(one);
  return [style.breakBefore, style.breakAfter];
}"""


def test_no_printed_page_ends_with_a_heading_or_holds_the_footer_alone(opened: Opened) -> None:
    opened.page.emulate_media(media="print")
    for heading in ("h2", "h3", "summary", "caption"):
        assert opened.page.evaluate(BREAKS, heading)[1] == "avoid", heading
    assert opened.page.evaluate(BREAKS, "summary + *")[0] == "avoid"
    assert opened.page.evaluate(BREAKS, "footer")[0] == "avoid"


SIDE_BY_SIDE = """() => {
  const figures = [...document.querySelectorAll("#where figure")];
  const tops = figures.map((one) => Math.round(one.getBoundingClientRect().top));
  return [tops.length, new Set(tops).size];
}"""


def test_figures_of_where_the_gap_is_are_printed_two_to_a_row(opened: Opened) -> None:
    opened.page.evaluate("document.querySelectorAll('details').forEach((part) => { part.open = true; })")
    opened.page.emulate_media(media="print")
    opened.page.set_viewport_size({"width": 703, "height": 1032})  # A4 within its margins
    figures, rows = opened.page.evaluate(SIDE_BY_SIDE)
    assert figures >= 4
    assert rows == -(-figures // 2)
