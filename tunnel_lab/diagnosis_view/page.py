"""Putting the page together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from diagnosis.closable import closable_table, closable_words
from diagnosis.names import plain
from diagnosis.printing import inclusion_line
from tunnel_lab.diagnosis_view import provenance, view, view_detail
from tunnel_lab.diagnosis_view.charts import charts
from tunnel_lab.diagnosis_view.figures import diagnosis_figures
from tunnel_lab.diagnosis_view.fonts import font_face
from tunnel_lab.diagnosis_view.svg import inline_svg, shown_text
from tunnel_sim.files.writing import write_encoded
from tunnel_sim.vocabulary.campaign import Campaign

Document = Mapping[str, Any]

DESCRIPTIONS = {
    "waterfall": "What is left of the gap as the causes are added one after another.",
    "where-runs": "Heat map of the excess of every run over time.",
    "where-profiles": "Excess against time and against amplitude, and the missing moment against time.",
    "where-spectrum": "Residual power against frequency, with the nominal model and with the causes added.",
    "where-backbones": "Frequency and damping ratio of each run against amplitude, relative to the nominal model.",
    "where-phase-plane": "Map of the missing moment over angle and rate.",
    "where-moment": "Mean of the missing moment against the angle and against the rate.",
    "which": "Bars: probability of each answer.",
    "how-far": "Excess of every run with the nominal model and with the causes added.",
    "residuals": "Reading and residuals of the runs with the largest gap against time.",
    "law": "The missing moment, or error of the reading, as a curve with its band or as a map.",
    "coefficients": "Coefficients before and after the causes are added, with 95 % intervals.",
}
"""Text alternatives of the figures."""


@dataclass(frozen=True)
class Byline:
    """What the page states and the document leaves out, because it would differ each time.

    Args:
        date: of the diagnosis, such as 2026-05-31; empty: none is shown.
        author: who made it; empty: nobody is named.
        notes: for the head of the page; empty: none.
    """

    date: str = ""
    author: str = ""
    notes: str = ""


def write_report(document: Document, campaign: Campaign, path: Path, byline: Byline | None = None) -> Path:
    """Write the report of a diagnosis.

    Args:
        document: the diagnosis as JSON's types (``Diagnosis.to_json_dict``), with its ``maps`` where there are any.
        path: the HTML file; replaced when it exists, written completely or not at all.

    Raises:
        TunnelError: when the page cannot be drawn or the file cannot be written.
    """
    return write_encoded(
        path, lambda stream: stream.write(render_report(document, campaign, byline).encode())
    )


def render_report(document: Document, campaign: Campaign, byline: Byline | None = None) -> str:
    """The page as text.

    Args:
        document: as for `write_report`.

    Returns:
        HTML that needs no other file and no network; the same for the same document and byline.
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        loader=FunctionLoader(_resource),
    )
    context = _summary(document, byline or Byline()) | _detail(document, campaign)
    return environment.get_template("page.html.j2").render(context | _parts(document, campaign))


def _resource(name: str) -> str:
    return resources.files("tunnel_lab.diagnosis_view").joinpath(*name.split("/")).read_text("utf-8")


def _parts(document: Document, campaign: Campaign) -> dict[str, Any]:
    """Figures, styles and scripts: text that is part of the page as it is."""
    from markupsafe import Markup

    figures = {
        name: inline_svg(figure, name, DESCRIPTIONS[name])  # the SVG is already escaped
        for name, figure in diagnosis_figures(document, campaign).items()
    }
    font = font_face(shown_text("".join(figures.values())))
    return {
        "figures": {name: Markup(svg) for name, svg in figures.items()},
        "style": Markup("\n".join([font, _resource("vendor/uPlot.min.css"), _resource("style.css")])),
        "licence": Markup(_resource("vendor/uPlot-LICENSE.txt")),
        "library": Markup(_resource("vendor/uPlot.iife.min.js")),
        "script": Markup(_resource("page.js")),
        "charts": charts(document, campaign),
    }


def _summary(document: Document, byline: Byline) -> dict[str, Any]:
    answer, kind = view.headline(document)
    return {
        "document": document,
        "byline": byline,
        "answer": answer,
        "kind": kind,
        "named": kind in ("open", "found"),
        "facts": view.facts(document),
        "coefficients": view.coefficient_rows(document),
        "next_steps": view.next_steps(document),
    }


def _detail(document: Document, campaign: Campaign) -> dict[str, Any]:
    return {
        "campaign": campaign,
        "place": view_detail.place_rows(document),
        "lines": view_detail.line_rows(document),
        "candidates": view.candidate_rows(document),
        "more": view.others(document),
        "causes": view.cause_paragraphs(document),
        "inclusion": plain(inclusion_line(document)),
        "steps": view_detail.step_rows(document),
        "closable": closable_table(document).rows,
        "closable_words": closable_words(document),
        "rivals": [plain(name) for name in document["ambiguous_with"]],
        "next_run": view.next_run_rows(document),
        "runs": view_detail.run_rows(document, campaign),
        "budget": provenance.budget(document),
        "tests": provenance.test_rows(document),
        "false_alarms": provenance.false_alarms(document),
        "seconds": [(name, f"{value:.1f} s") for name, value in document["seconds"].items()],
        "noise": provenance.noise_rows(document),
        "versions": provenance.version_rows(document),
        "hashes": provenance.hash_rows(document),
    }
