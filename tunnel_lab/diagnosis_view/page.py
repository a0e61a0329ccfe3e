"""Putting the page together."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from diagnosis.closable import closable_table, closable_words
from diagnosis.printing import inclusion_line
from identification.printing.numbers import p_text, significant
from tunnel_lab.diagnosis_view import view
from tunnel_lab.diagnosis_view.figures import diagnosis_figures
from tunnel_lab.diagnosis_view.figures_common import plain
from tunnel_lab.diagnosis_view.svg import inline_svg
from tunnel_sim.files.writing import write_encoded
from tunnel_sim.vocabulary.campaign import Campaign

Document = Mapping[str, Any]

#: Text alternatives of the figures.
DESCRIPTIONS = {
    "waterfall": "Bars: what is left of the gap as the causes are added one after another.",
    "where-runs": "Heat map of the excess of every run over time, with a bar for the excess of the whole run.",
    "where-profiles": "Excess against time, against amplitude, and residual power against frequency.",
    "where-backbones": "Frequency and damping ratio of each run against amplitude, relative to the nominal model.",
    "where-phase-plane": "Map of the missing moment over angle and rate, and its means over each.",
    "which": "Bars: probability of each answer.",
    "how-far": "Excess of every run with the nominal model and with the causes added.",
    "residuals": "Reading and residuals of the runs with the largest gap against time.",
    "law": "The missing moment, or error of the reading, as a curve with its band or as a map.",
    "coefficients": "Coefficients before and after the causes are added, with 95 % intervals.",
}


def write_report(document: Document, campaign: Campaign, path: Path) -> Path:
    """Write the report of a diagnosis.

    Args:
        document: the diagnosis as JSON's types (``Diagnosis.to_json_dict``), with its ``maps`` where there are any.
        path: the HTML file; replaced when it exists, written completely or not at all.

    Raises:
        TunnelError: when the page cannot be drawn or the file cannot be written.
    """
    return write_encoded(path, lambda stream: stream.write(render_report(document, campaign).encode()))


def render_report(document: Document, campaign: Campaign) -> str:
    """The page as text.

    Args:
        document: as for `write_report`.

    Returns:
        HTML that needs no other file and no network; the same for the same document.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = environment.from_string(_resource("page.html.j2"))
    return template.render(**_context(document, campaign), style=_resource("style.css"))


def _resource(name: str) -> str:
    return (resources.files("tunnel_lab.diagnosis_view") / name).read_text("utf-8")


def _context(document: Document, campaign: Campaign) -> dict[str, Any]:
    from markupsafe import Markup

    answer, kind = view.headline(document)
    candidates, more = view.candidate_rows(document)
    figures = {
        name: Markup(inline_svg(figure, name, DESCRIPTIONS[name]))  # drawn here: the SVG is already escaped
        for name, figure in diagnosis_figures(document, campaign).items()
    }
    return {
        "document": document,
        "campaign": campaign,
        "answer": answer,
        "kind": kind,
        "facts": view.facts(document),
        "place": view.place_rows(document),
        "lines": view.line_rows(document),
        "candidates": candidates,
        "more": more,
        "causes": view.cause_paragraphs(document),
        "inclusion": plain(inclusion_line(document)),
        "steps": view.step_rows(document),
        "closable": closable_table(document).rows,
        "closable_words": closable_words(document),
        "rivals": [plain(name) for name in document["ambiguous_with"]],
        "next_run": view.next_run_rows(document),
        "runs": view.run_rows(document, campaign),
        "coefficients": view.coefficient_rows(document),
        "tests": [
            (name, p_text(value).removeprefix("= ")) for name, value in document["gap"]["tests"].items()
        ],
        "seconds": [(name, f"{value:.1f} s") for name, value in document["seconds"].items()],
        "noise": _noise_rows(document) + _confirmation_rows(document),
        "provenance": _flat(document.get("provenance") or {}),
        "figures": figures,
        "significant": significant,
    }


def _noise_rows(document: Document) -> list[tuple[str, str]]:
    noise = document["noise"]
    stated = noise["stated_std"]
    return [
        ("Noise of one sample", f"{1e3 * noise['std']:.4g} × 10⁻³ rad ({noise['source']})"),
        ("Stated", "–" if stated is None else f"{1e3 * stated:.4g} × 10⁻³ rad"),
        ("Why this one", str(noise["reason"])),
    ]


def _confirmation_rows(document: Document) -> list[tuple[str, str]]:
    """The model behind the excesses, and the difference of the integrator used for fitting."""
    found = document["confirmation"]
    if found["failure"]:
        return [
            ("Excesses computed by", f"the integrator used for fitting; MuJoCo failed: {found['failure']}")
        ]
    apart = f"{found['largest_difference_rad']:.1e} rad at most"
    rms = f"{found['rms_difference_rad']:.1e} rad root mean square in {found['run']}"
    return [
        ("Excesses computed by", "the MuJoCo model"),
        (
            "Difference of the integrator used for fitting",
            f"{apart}; {rms}, {'within' if found['agrees'] else 'beyond'} {found['tolerance_rad']:.1e} rad",
        ),
    ]


def _flat(values: Document) -> list[tuple[str, str]]:
    """Provenance as rows: nested tables become one row each."""
    return [
        (
            plain(str(key)).capitalize(),
            ", ".join(f"{k} {v}" for k, v in value.items()) if isinstance(value, Mapping) else str(value),
        )
        for key, value in values.items()
    ]
