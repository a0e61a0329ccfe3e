"""The report of a diagnosis as one HTML page, and as a PDF of two printed pages."""

from __future__ import annotations

import base64
import hashlib
import io
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diagnosis.findings.fit_view import fit_figure, fit_pictures
from diagnosis.findings.sections import figures, sections
from diagnosis.findings.verdict import headline
from diagnosis.findings.whole import Findings
from identification.show.blocks import Paragraph, as_html
from identification.show.drawing import inline_svg, shown_text
from tunnel_lab.report.charts import Chart, charts, fit_charts
from tunnel_sim.files.writing import write_encoded, write_whole
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing


FAMILY = "DejaVu Sans"
"""The font, shipped with matplotlib, whose widths determine where it places the text of a figure."""
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_TIMEOUT = 120.0  # s


@dataclass(frozen=True)
class Byline:
    """Statements on the page that are not in the answer, because they would differ each time; empty: not shown.

    Args:
        date: date of the diagnosis, such as 2026-05-31.
        notes: notes for the head of the page.
        patch: file of the patched model.
    """

    date: str = ""
    author: str = ""
    notes: str = ""
    patch: str = ""


def write_report(answer: Findings, campaign: Campaign, path: Path, byline: Byline | None = None) -> Path:
    """Write the report of a diagnosis as an HTML file, completely or not at all.

    Raises:
        TunnelError: when the page cannot be drawn or the file cannot be written.
    """
    return write_encoded(path, lambda stream: stream.write(render_report(answer, campaign, byline).encode()))


def render_report(answer: Findings, campaign: Campaign, byline: Byline | None = None) -> str:
    """The page as HTML that needs no other file and no network; equal documents and bylines give equal pages.

    It begins with the answer in short. Printed, it is two pages, the first complete in itself; without a gap,
    one page.
    """
    from markupsafe import Markup

    byline, (words, kind) = byline or Byline(), headline(answer)
    page = _page(answer, diagnosis_figures(answer), fit_charts(answer.maps) | charts(answer.maps))
    drawn, parts = page.pop("drawn"), {}
    for section in sections(answer, campaign):
        blocks = section.blocks
        if section.key == "patch" and byline.patch and section.blocks:
            blocks = (*blocks, Paragraph(f"The model is written to {byline.patch}."))
        html = as_html(blocks, drawn, titled=section.key != "head")
        # narrow lines: no line ends within a value
        if section.key in ("head", "coefficients-section", "next"):
            html = re.sub(r"(?<=\d) (?=%|to |N\b|rad\b)|(?<=\bN) (?=m\b)", "\u00a0", html)
        if html:
            parts[section.key] = {"title": section.title, "html": Markup(html)}
    folded = [key for key in parts if key not in (*_OPEN, *_PRINTED)]
    context = {
        "document": answer,
        "campaign": campaign,
        "byline": byline,
        "answer": words,
        "kind": kind,
        "parts": parts,
        "details": {key: parts[key] for key in (*_PRINTED, *folded) if key in parts},
        "printed": _PRINTED,
    }
    return _rendered("page.html.j2", context | page | {"paper": Markup(_resource("paper.css"))})


_OPEN = ("head", "fit", "closes", "coefficients-section", "next")
"""Sections above the fold, which are the first printed page."""
_PRINTED = ("answer", "found", "place", "costs", "cautions")
"""Folded sections on the second printed page."""


def render_fit(answer: Findings) -> str:
    """The fit over the data as a separate HTML page; without a chart if the document has no ``maps``."""
    from markupsafe import Markup

    drawing = fit_figure(answer.maps)
    page = _page(answer, {} if drawing is None else {"fit": drawing}, fit_charts(answer.maps))
    fit = Markup(as_html(figures(fit_pictures(answer.maps)), page.pop("drawn")))
    return _rendered("fit.html.j2", {"campaign": answer.campaign, "fit": fit} | page)


def draw(answer: Findings, what: str, runs: Sequence[str] = ()) -> Drawing:
    """One figure of the report.

    Args:
        what: name of the figure, as in `Findings.pictures`.
        runs: ids of the runs for ``fit``; two of them are drawn. Empty: the runs with the largest gap.

    Raises:
        TunnelError: for a figure or a run that the diagnosis does not have.
    """
    if what == "fit":
        drawn = fit_figure(answer.maps, runs)
    else:
        drawn = answer.pictures[what].draw() if what in answer.pictures else None
    if drawn is None:
        known = ", ".join(diagnosis_figures(answer))
        raise TunnelError(f"the diagnosis has no figure {what!r}", remedy=f"choose of its figures: {known}")
    return drawn


def page_of(title: str, body: str) -> str:
    """A page in the style of the report.

    Args:
        body: HTML, included unchanged.
    """
    from markupsafe import Markup

    words = {"style": Markup(_resource("style.css")), "script": "", "charts": {}, "paper": ""}
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


def diagnosis_figures(answer: Findings) -> dict[str, Drawing]:
    """All figures of a diagnosis by name, in the order of the report; ``maps`` only where present."""
    return {name: drawn for name, one in answer.pictures.items() if (drawn := one.draw()) is not None}


def _page(answer: Findings, drawings: Mapping[str, Drawing], shown: dict[str, list[Chart]]) -> dict[str, Any]:
    """The figures as HTML, styles and scripts: text included in the page unchanged."""
    from markupsafe import Markup

    drawn, pictures = {}, answer.pictures
    for name, figure in drawings.items():
        text = pictures[name].description
        chart = '<div class="charts"></div>' if name in shown else ""
        drawn[name] = f'{chart}<div class="drawn" tabindex="0">{inline_svg(figure, name, text)}</div>'
    font = font_face(shown_text("".join(drawn.values())))
    return {
        "drawn": drawn,
        "style": Markup("\n".join([font, *map(_resource, ("vendor/uPlot.min.css", "style.css"))])),
        "library": Markup(_library()),
        "script": Markup(_resource("page.js")),
        "charts": answer.freedom.texts(shown, answer.names),
        "paper": "",
    }


def _library() -> str:
    return f"/*\n{_resource('vendor/uPlot-LICENSE.txt')}*/\n{_resource('vendor/uPlot.iife.min.js')}"


def security_policy() -> str:
    """The Content-Security-Policy with which a report is served: only the scripts of this version run.

    They run without the server's origin, so that nothing in the file can use the server or send anything.
    """
    hashes = (hashlib.sha256(text.encode()).digest() for text in (_library(), _resource("page.js")))
    scripts = " ".join(f"'sha256-{base64.b64encode(one).decode()}'" for one in hashes)
    return (
        f"sandbox allow-scripts; default-src 'none'; script-src {scripts}; style-src 'unsafe-inline'; "
        "img-src data:; font-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
    )


def font_face(characters: str) -> str:
    """A rule of a style sheet with the font in WOFF, reduced to the characters in the figures.

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
        TunnelError: when there is none.
    """
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise TunnelError(
            "there is no Chromium to print with",
            where="--pdf",
            remedy="install Chromium, or print the page of --report from a browser",
        )
    return found


def write_pdf(answer: Findings, campaign: Campaign, path: Path, byline: Byline | None = None) -> Path:
    """Write the report of a diagnosis as a PDF of two pages, completely or not at all.

    Raises:
        TunnelError: when there is no Chromium, it fails, or the file cannot be written.
    """
    browser = find_browser()
    with tempfile.TemporaryDirectory() as name:
        page, printed = Path(name) / "report.html", Path(name) / "report.pdf"
        page.write_text(render_report(answer, campaign, byline).replace(*_SIZED), encoding="utf-8")
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
            raise TunnelError(what, where="--pdf", remedy=remedy) from error
        return write_whole(path, content)


_SIZED = ("@page {", "@page { size: 210mm 279mm;")
"""The page of the PDF is as wide as A4 and as high as Letter, so that it is printed on either without scaling."""
