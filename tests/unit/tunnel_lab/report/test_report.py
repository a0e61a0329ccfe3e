"""The report says what the document says, needs no other file, and is the same every time."""

import re
from html.parser import HTMLParser

import pytest

from identification.show.drawing import THEMED, inline_svg
from tests.support.diagnosis_document import campaign, document, findings_of, scattering_document
from tests.support.rendered import waterfall_figure
from tunnel_lab.report import Byline, render_report, write_pdf, write_report
from tunnel_lab.report.page import diagnosis_figures
from tunnel_sim.vocabulary.errors import TunnelError

CLOSABLE = {
    "excess": 0.37,
    "ceilings": [
        {"kind": "angle", "closed": 0.417, "std": 0.023, "held_out": "runs"},
        {"kind": "time", "closed": -3.0, "std": 7.0, "held_out": "runs"},
    ],
    "kind": "angle",
    "words": "A moment.",
    "curve": {
        "over": ["angle"], "places": [[-0.1, 0.0, 0.1]], "values": [-0.002, 0.0, 0.003], "std": [0.001] * 3,
        "unit": "N m",
    },
}  # fmt: skip
FRICTION = {
    "effect": "coulomb_friction", "unit": "N m",
    "rate_rad_s": [0.1, 1.0, 10.0], "moment": [0.004, 0.005, 0.006], "std": [1e-4, 2e-4, 3e-4],
    "points": [{"rate_rad_s": 0.3, "moment": 0.0041, "std": 2e-4, "strokes": 5}],
}  # fmt: skip


@pytest.fixture(scope="module")
def data():
    return campaign()


@pytest.fixture(scope="module", name="document")
def whole_document():
    given = document()
    return given | {
        "campaign": "<script>alert(1)</script>",
        "verdict": "The gap is explained by quadratic damping & nothing else.",
        "where": given["where"] | {"words": "The damping of all runs shows it."},
        "cautions": ["There is one run only."],
        "closable": CLOSABLE,
        "maps": given["maps"] | {"friction": FRICTION},
        "repeatability": scattering_document()["repeatability"],
    }


@pytest.fixture(scope="module")
def page(document, data):
    return render_report(findings_of(document), data)


@pytest.fixture
def written(monkeypatch, data):
    """Renders a page with empty figures: they take nearly all of the time, and are in ``page``."""
    monkeypatch.setattr("tunnel_lab.report.page.diagnosis_figures", lambda one: dict.fromkeys(one.pictures))
    monkeypatch.setattr("tunnel_lab.report.page.inline_svg", lambda *_: "")
    return lambda document, *byline: render_report(findings_of(document), data, *byline)


class Page(HTMLParser):
    """Collects ids, outside references and text."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.references, self.words, self.tags = [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            if name in ("src", "href", "xlink:href", "srcset", "data", "action"):
                self.references.append(value)

    def handle_data(self, data):
        self.words.append(data)

    @property
    def text(self):
        return re.sub(r"\s+", " ", " ".join(self.words))


ORDER = (
    "What ", "How sure ", "What it costs ", "Do this first ", "The fit over the data",
    "Coefficients before and after", "What to do next", "How much of the gap is explained", "Detail",
)  # fmt: skip


def test_the_answer_in_four_lines_comes_first_then_the_fit_coefficients_and_steps(page, document):
    text = Page(page.split("</style>", 2)[2]).text
    places = [text.index(words) for words in (*ORDER, document["verdict"], document["where"]["words"])]
    assert places == sorted(places)


OF_ENGINEERS = (
    "nominal model", "held-out", "held out", "l/V", "noise variance", "times the noise", "tunnel compare",
)  # fmt: skip


def test_before_the_fold_are_the_words_of_customers(page):
    before = page.split("</style>", 2)[2].split('class="sheet detail"')[0]
    shown = Page(re.sub(r'<details class="fold">.*?</details>', "", before)).text
    assert not [words for words in OF_ENGINEERS if words in shown]
    assert not [words for words in OF_ENGINEERS[:2] if words in page.partition('id="chart-data"')[2]]


def test_all_else_is_folded(page):
    tags = Page(page.partition('class="sheet detail"')[2]).tags
    assert not [attrs for tag, attrs in tags if tag == "details" and "open" in attrs]
    found = Page(page)
    inside = page.partition('class="sheet detail"')[2]
    assert {one for one in found.ids if f'id="{one}"' in inside} >= {
        "answer",
        "cautions",
        "where",
        "provenance",
    }


def test_nothing_is_loaded_from_elsewhere(page):
    found = Page(page)
    assert all(value.startswith(("#", "data:image/png;base64,")) for value in found.references)
    assert "@import" not in page
    assert not re.search(r"url\((?!#|data:font/woff;base64,)", page)
    assert not [tag for tag, _ in found.tags if tag in ("link", "iframe", "img", "object")]
    assert not re.search(r"\b(fetch|XMLHttpRequest|WebSocket|import)\s*\(", page)
    policy = next(attrs["content"] for _, attrs in found.tags if "http-equiv" in attrs)
    assert policy.startswith("default-src 'none'")


def test_ids_are_unique_and_references_lead_somewhere(page):
    found = Page(page)
    assert len(found.ids) == len(set(found.ids))
    inside = {value[1:] for value in found.references if value.startswith("#")}
    inside |= set(re.findall(r"url\(#([^)]+)\)", page))
    assert inside <= set(found.ids)


def test_text_of_the_campaign_cannot_become_markup(page, document, written):
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert(1)" in page
    runs = [run | {"id": "</script><b>"} for run in document["maps"]["runs"]]
    maps = document["maps"] | {"runs": runs, "backbones": []}
    assert "</script><b>" not in written(document | {"maps": maps})


def test_figures_have_words_for_those_who_cannot_see_them(document, page):
    pictures = [attrs for tag, attrs in Page(page).tags if tag == "svg"]
    words = {name: one.description for name, one in findings_of(document).pictures.items()}
    assert sorted(attrs["aria-label"] for attrs in pictures) == sorted(words.values())
    assert all(attrs["role"] == "img" for attrs in pictures)
    assert page.count("<figcaption>") == len(pictures)


def test_what_could_be_closed_is_on_the_page_only_where_something_remains(page, document, written):
    text = Page(page).text
    assert "What could explain the residual gap: A moment." in text
    assert "a moment of the angle alone 41.7 ± 2.3 %" in text
    assert "not determined" in text  # worse than nothing, and beyond any meaning
    explained = document | {"closable": None, "maps": None}
    assert "What could explain the residual gap:" not in written(explained)
    page = written(explained | {"rest": {"significant": False, "p_value": 0.4321, "material": False}})
    assert "What could explain the residual gap: nothing beyond chance (p = 0.43)." in Page(page).text
    assert "kind of law" not in page


MODEL = {
    "file": "rig.xml", "joint": "yaw", "free": ["inertia", "damping"], "rest_rad": 0.0, "zero_rad": 0.0123,
    "written": [{"name": "joint frictionloss", "before": [0.0], "after": [0.00456], "unit": "N m"}],
    "notes": ["frictionloss is a soft constraint."],
    "closed": 0.947, "closed_by_fit": 0.968, "closed_on": "on held-out runs",
}  # fmt: skip


def test_the_patched_model_and_its_closure_are_on_the_page(document, written):
    given = document | {"model": MODEL, "maps": None}
    text = Page(written(given, Byline(patch="out.xml"))).text
    assert "explains 94.7 % of the gap on held-out runs; the fit itself explains 96.8 %." in text
    assert "The model is written to out.xml." in text
    assert "The reading is the position of yaw + 0.705°." in text
    assert "Changes to rig.xml" in text
    assert "joint frictionloss 0 0.004560 N m" in text
    assert "frictionloss is a soft constraint." in text
    assert "is written to" not in written(given)
    unnamed = written(given | {"causes": ["unknown"]})
    assert (
        "No cause is written into the patched model, only the fitted parameters: inertia, damping." in unnamed
    )
    assert "94.7 %" not in unnamed


def test_cautions_and_the_model_behind_the_figures_are_on_the_page(page, document, written):
    assert "There is one run only." in page
    assert "the MuJoCo model" in page
    assert "by 0.00074° at most" in page
    assert "0.0027° is allowed" in page
    changed = {"maps": None, "cautions": [], "confirmation": document["confirmation"] | {"agrees": False}}
    other = written(document | changed)
    assert "MuJoCo model" not in other  # a caveat says more
    assert 'id="cautions"' not in other


def test_the_same_document_gives_the_same_text_and_the_same_figure_the_same_drawing(document, written):
    assert written(document) == written(document)
    drawings = [inline_svg(waterfall_figure(findings_of(document)), "steps", "The steps.") for _ in range(2)]
    assert drawings[0] == drawings[1]


def test_a_document_without_maps_is_rendered_too(document, data, tmp_path):
    bare = {key: value for key, value in document.items() if key != "maps"}
    path = write_report(findings_of(bare), data, tmp_path / "report.html")
    text = path.read_text("utf-8")
    assert document["where"]["words"] in Page(text).text
    assert text.count("<svg") == 6


def test_no_gap_is_said_so(document, written):
    calm = document | {
        "causes": [], "verdict": "No gap: all is noise.", "ambiguous_with": [], "next_run": None, "maps": None,
        "where": document["where"] | {"channel": None, "condition": None, "runs": [], "time_s": None},
    }  # fmt: skip
    text = Page(written(calm)).text
    assert "No gap: all is noise." in text
    assert list(diagnosis_figures(findings_of(calm))) == [
        "waterfall",
        "coefficients",
        "which",
        "repeatability",
        "how-far",
        "law",
    ]
    assert "Share closed" not in text


def test_every_figure_is_described(document):
    without_maps = diagnosis_figures(findings_of(document | {"maps": None, "repeatability": None}))
    assert list(without_maps) == ["waterfall", "coefficients", "which", "how-far", "law"]
    answer = findings_of(document)
    assert set(diagnosis_figures(answer)) == set(answer.pictures)


def test_how_the_runs_repeat_is_a_section_or_one_line(document, written):
    page = written(document)
    assert "<summary><h2>How the runs repeat</h2></summary>" in page
    assert 'data-figure="repeatability"' in page
    assert "deviates far beyond the others" in page
    found = document["repeatability"]
    limits = {"frequency": 1e-4, "damping": 0.01}
    repeats = found | {"spreads": [], "outlier": "", "limits": limits}
    page = written(document | {"repeatability": repeats, "rest": None})
    assert "<p>Repeatability: no run-to-run scatter detected: frequency less than" in page
    assert 'data-figure="repeatability"' not in page
    assert "How the runs repeat" not in written(document | {"repeatability": None})


def test_figures_take_the_colours_of_the_theme(page):
    used = set(re.findall(r"var\(--([a-z]+)\)", page))
    assert set(THEMED.values()) <= used
    assert used <= set(re.findall(r"--([a-z]+): light-dark", page))
    assert 'font-family: "DejaVu Sans"; src: url(data:font/woff' in page


def test_date_and_author_are_of_the_page_and_not_of_the_document(document, written, page):
    text = Page(written(document | {"maps": None}, Byline("2026-05-31", "A. Smith <b>"))).text
    assert "2026-05-31 · A. Smith <b>" in text
    assert "A. Smith" not in page


def test_without_a_browser_the_pdf_is_refused(document, data, tmp_path, monkeypatch):
    monkeypatch.setattr("tunnel_lab.report.page.shutil.which", lambda _: None)
    with pytest.raises(TunnelError, match=r"no Chromium to print with.*--report"):
        write_pdf(findings_of(document), data, tmp_path / "report.pdf")
    assert not (tmp_path / "report.pdf").exists()


@pytest.mark.usefixtures("undrawn")
def test_a_browser_that_fails_leaves_no_file(document, data, tmp_path, monkeypatch):
    monkeypatch.setattr("tunnel_lab.report.page.find_browser", lambda: "false")
    with pytest.raises(TunnelError, match="Chromium could not print"):
        write_pdf(findings_of(document | {"maps": None}), data, tmp_path / "report.pdf")
    assert not (tmp_path / "report.pdf").exists()
