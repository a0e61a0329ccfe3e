"""The report of a diagnosis as one HTML page, its provenance, and its summary on one printed page."""

from __future__ import annotations

import base64
import io
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diagnosis.words.answers import set_out
from diagnosis.words.numbers import Document, plain, reading_shown, unit_of
from diagnosis.words.remainder import closable_line
from diagnosis.words.scatter import repeatability_line, repeatability_table, repeats
from diagnosis.words.tables import (
    SOURCES,
    closable_table,
    coefficients_line,
    hidden_table,
    inclusion_line,
    other_answers,
    patch_lines,
    patch_table,
)
from diagnosis.words.verdict import headline, next_steps
from identification.printing import COEFFICIENTS, p_text, significant, trade_off_line, unit_mark
from tunnel_lab.report import view
from tunnel_lab.report.drawing import inline_svg, shown_text
from tunnel_lab.report.figures import diagnosis_figures, summary_figures
from tunnel_lab.report.symbols import symbol_rows
from tunnel_lab.report.where import Chart, charts, fit_charts, fit_figure
from tunnel_sim.files.writing import write_encoded, write_whole
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


DESCRIPTIONS = {
    "place": "Map of the misfit of the nominal model by amplitude and wind speed, or by amplitude and time.",
    "waterfall": "What is left of the gap as the causes are added one after another.",
    "fit": "What was measured and what both models predict against time, and below it their residuals.",
    "where-runs": "Heat map of the excess of every run over time.",
    "where-profiles": "Excess against time and against amplitude, and the missing moment against time.",
    "where-spectrum": "Residual power against frequency, with the nominal model and with the causes added.",
    "where-backbones": "Frequency and damping ratio of each run against amplitude, relative to the nominal model.",
    "where-phase-plane": "Map of the missing moment over angle and rate.",
    "where-moment": "Mean of the missing moment against the angle and against the rate.",
    "which": "Bars: probability of each answer.",
    "friction": "Friction against rate: the fitted law with its band, and points by the energy lost.",
    "repeatability": "Frequency and damping ratio of every run minus the model's, with the scatter as a band.",
    "how-far": "Misfit of every run with the nominal model and with the causes added.",
    "law": "The missing moment, or error of the reading, as a curve with its band or as a map.",
    "coefficients": "Coefficients before and after the causes are added, with 95 % intervals.",
}
"""Text alternatives of the figures."""
TESTS = {
    "below": "residual power below half the frequency f₀ of the oscillation",
    "f0": "residual power at f₀, from 0.5 to 1.5 f₀: the oscillation itself",
    "2f0": "residual power at its second harmonic, from 1.5 to 2.5 f₀",
    "3f0": "residual power at its third harmonic, from 2.5 to 3.5 f₀",
    "above": "residual power above 3.5 f₀",
    "offset": "whether the runs have a common zero",
    "noise against amplitude": "whether the noise grows or shrinks with the amplitude of the motion",
    "noise against rate": "whether the noise grows or shrinks with the rate of the motion",
    "noise in bursts": "whether the noise comes in bursts",
    "noise level": "whether the noise is above the level that the campaign states",
}
"""What each test of a gap looks at."""
FAMILY = "DejaVu Sans"
"""matplotlib places the text of a figure by the widths of this font, which it ships."""
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_TIMEOUT = 120.0  # s


@dataclass(frozen=True)
class Byline:
    """Statements on the page that are not in the document, because they would differ each time; empty: not shown.

    Args:
        date: of the diagnosis, such as 2026-05-31.
        notes: for the head of the page.
        patch: file of the patched model.
    """

    date: str = ""
    author: str = ""
    notes: str = ""
    patch: str = ""


def write_report(document: Document, campaign: Campaign, path: Path, byline: Byline | None = None) -> Path:
    """Write the report of a diagnosis as an HTML file, completely or not at all.

    Args:
        document: the diagnosis as JSON's types (``Diagnosis.to_json_dict``), with its ``maps`` where there are any.

    Raises:
        TunnelError: when the page cannot be drawn or the file cannot be written.
    """
    return write_encoded(
        path, lambda stream: stream.write(render_report(document, campaign, byline).encode())
    )


def render_report(
    document: Document, campaign: Campaign, byline: Byline | None = None, *, summary: bool = False
) -> str:
    """The page as HTML that needs no other file and no network; the same for the same document and byline.

    With ``summary`` the page is limited to one printed page.
    """
    (answer, kind), hidden = headline(document), hidden_table(document)
    provenance = document.get("provenance") or {}
    alarms = significant(document["gap"]["false_alarm_rate"], 2)
    schema = ("schema of the document", document["schema_version"])
    context = {
        "document": document,
        "campaign": campaign,
        "byline": byline or Byline(),
        "answer": answer,
        "kind": kind,
        "verdict": view.typeset(str(document["verdict"])),
        "summary": summary,
        "named": kind in ("open", "found"),
        "facts": view.facts(document),
        "found": view.causes_found(document),
        "set_out": set_out(document),
        "coefficients": view.coefficient_rows(document),
        "coefficients_line": coefficients_line(document),
        "symbols": symbol_rows(document),
        "trade_off": trade_off_line(document, COEFFICIENTS),
        "next_steps": next_steps(document),
        "place": view.place_rows(document),
        "lines": view.line_rows(document),
        "candidates": view.candidate_rows(document),
        "more": other_answers(document),
        "causes": view.cause_paragraphs(document),
        "inclusion": plain(inclusion_line(document)),
        "repeats": repeats(document),
        "repeatability": repeatability_line(document),
        "repeatability_table": repeatability_table(document),
        "steps": view.step_rows(document),
        "closable": closable_table(document).rows,
        "closable_words": closable_line(document),
        "patch": patch_table(document),
        "patch_lines": [line.removeprefix("- ") for line in patch_lines(document)],
        "rivals": [plain(name) for name in document["ambiguous_with"]],
        "next_run": view.next_run_rows(document),
        "runs": view.run_rows(document, campaign),
        "windy": any(run.wind_on for run in campaign.runs),
        "budget": budget(document),
        "hidden": hidden,
        "hidden_heads": [
            head[:1].upper() + head[1:] + "#" * (head in hidden.right) for head in hidden.columns
        ],
        "tests": test_rows(document),
        "false_alarms": f"{alarms} of the campaigns without a gap",
        "seconds": [(name, f"{value:.1f} s") for name, value in document["seconds"].items()],
        "noise": noise_rows(document),
        "versions": [*provenance.get("versions", {}).items(), schema],
        "hashes": list(provenance.get("sha256", {}).items()),
    }
    if summary:
        parts = _parts(summary_figures(document), {}, ["style.css", "summary.css"], "summary.js")
    else:
        parts = _parts(diagnosis_figures(document), fit_charts(document) | charts(document))
    return _rendered("page.html.j2", context | parts)


def render_fit(document: Document) -> str:
    """The fit over the data as a separate HTML page; without a chart where the document has no ``maps``."""
    drawn = fit_figure(document)
    parts = _parts({} if drawn is None else {"fit": drawn}, fit_charts(document))
    return _rendered("fit.html.j2", {"campaign": document["campaign"], "summary": False} | parts)


def draw(document: Document, what: str, runs: Sequence[str] = ()) -> Figure:
    """One figure of the report.

    Args:
        what: name of the figure, as in `DESCRIPTIONS`.
        runs: ids of the runs for ``fit``; two of them are drawn. Empty: those with the largest gap.

    Raises:
        TunnelError: for a figure or a run that the diagnosis does not have.
    """
    if what == "fit" and (drawn := fit_figure(document, runs)) is not None:
        return drawn
    figures = diagnosis_figures(document)
    if what not in figures:
        known = ", ".join(figures)
        raise TunnelError(f"the diagnosis has no figure {what!r}", remedy=f"choose of its figures: {known}")
    return figures[what]


def page_of(title: str, body: str) -> str:
    """A page in the style of the report.

    Args:
        body: HTML, included unchanged.
    """
    from markupsafe import Markup

    words = {"style": Markup(_resource("style.css")), "script": "", "charts": {}}
    return _rendered("plain.html.j2", {"title": title, "body": Markup(body), **words})


def _rendered(name: str, context: dict[str, Any]) -> str:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        loader=FunctionLoader(_resource),
    )  # fmt: skip
    return environment.get_template(name).render(context)


def _resource(name: str) -> str:
    return resources.files("tunnel_lab.report").joinpath(*name.split("/")).read_text("utf-8")


def _parts(
    drawn: Mapping[str, Figure],
    shown: dict[str, list[Chart]],
    sheets: Sequence[str] = ("vendor/uPlot.min.css", "style.css"),
    script: str = "page.js",
) -> dict[str, Any]:
    """Figures, styles and scripts: text included in the page unchanged."""
    from markupsafe import Markup

    figures = {}
    for name, figure in drawn.items():
        # A figure in another height, such as ``fit-near-1``, has the text of the first. The SVG is already escaped.
        text = DESCRIPTIONS.get(name) or DESCRIPTIONS[name.partition("-")[0]]
        figures[name] = Markup(inline_svg(figure, name, text))
    font = font_face(shown_text("".join(figures.values())))
    return {
        "figures": figures,
        "style": Markup("\n".join([font, *map(_resource, sheets)])),
        "licence": Markup(_resource("vendor/uPlot-LICENSE.txt")),
        "library": Markup(_resource("vendor/uPlot.iife.min.js")),
        "script": Markup(_resource(script)),
        "charts": shown,
    }


def test_rows(document: Document) -> list[tuple[str, str, str]]:
    """The tests of the gap: name, tested property, and p-value."""
    tests = document["gap"]["tests"].items()
    return [(name, TESTS.get(name, "–"), p_text(value).removeprefix("= ")) for name, value in tests]


def budget(document: Document) -> tuple[list[str], list[tuple[str, ...]]]:
    """The uncertainty budget of the coefficients of the answer; no rows where the document has no shares.

    Returns:
        Headings, and a row for each source: its standard deviation and its share of the variance, by coefficient.
    """
    heads: list[str] = []
    columns = [[*SOURCES.values(), "combined standard deviation"]]
    for name, given in document["coefficients"]["after"].items():
        std, shares = given["std"], given.get("shares")
        if std is None or not shares:
            continue
        heads.append(f"{COEFFICIENTS.get(name, name)} [{unit_mark(given['unit'])}]")
        cells = []
        for share in (shares.get(source, 0.0) for source in SOURCES):
            shown = f"{significant(std * math.sqrt(share), 2)} ({100.0 * share:.1f} %)"
            cells.append("–" if share < 5e-4 else shown)
        columns.append([*cells, significant(std, 2)])
    return heads, list(zip(*columns, strict=True)) if heads else []


def noise_rows(document: Document) -> list[tuple[str, str]]:
    """The reference noise of the gap, and the model behind the excesses."""
    noise, confirmation = document["noise"], document["confirmation"]
    stated, unit = noise["stated_std"], unit_of(document)
    rows = [
        ("Noise of one sample", f"{reading_shown(noise['std'], 4, unit)} ({noise['source']})"),
        ("Stated", "–" if stated is None else reading_shown(stated, 4, unit)),
        ("Why this one", str(noise["reason"])),
    ]
    if confirmation["failure"]:
        model = f"the integrator used for fitting; MuJoCo failed: {confirmation['failure']}"
        return [*rows, ("Excesses computed by", model)]
    apart, rms, allowed = (
        view.typeset(reading_shown(confirmation[name], 2, unit))
        for name in ("largest_difference_rad", "rms_difference_rad", "tolerance_rad")
    )
    apart, rms = f"{apart} at most", f"{rms} root mean square in {confirmation['run']}"
    beside = f"{'within' if confirmation['agrees'] else 'beyond'} {allowed}"
    return [
        *rows,
        ("Excesses computed by", "the MuJoCo model"),
        ("Difference of the integrator used for fitting", f"{apart}; {rms}, {beside}"),
    ]


def font_face(characters: str) -> str:
    """A rule of a style sheet with the font in WOFF, reduced to the characters that the figures show.

    The rule is deterministic. Characters that the font lacks are left to the browser's fonts.
    """
    import matplotlib
    from fontTools.subset import Options, Subsetter, load_font

    file = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    options = Options(
        flavor="woff", layout_features=[], hinting=False, drop_tables=["FFTM", "GPOS", "GSUB", "GDEF", "kern"]
    )
    subsetter = Subsetter(options)
    subsetter.populate(text=characters)
    buffer = io.BytesIO()
    with load_font(str(file), options) as font:
        subsetter.subset(font)
        font.flavor = "woff"
        font.save(buffer)
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    return f'@font-face {{ font-family: "{FAMILY}"; src: url(data:font/woff;base64,{data}) format("woff"); }}'


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
    """Write the summary of a diagnosis as a PDF of one page, completely or not at all.

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
            subprocess.run([browser, *arguments], capture_output=True, timeout=_TIMEOUT, check=True)
            content = printed.read_bytes()
        except (OSError, subprocess.SubprocessError) as error:
            what, remedy = "Chromium could not print", "print the report"
            raise TunnelError(what, where="--summary", remedy=remedy) from error
        return write_whole(path, content)
