"""The symbols of a report are explained where they stand, and its colour bars follow the theme of the page."""

from __future__ import annotations

import re

import pytest

from identification.show.drawing import inline_svg
from tests.support.diagnosis_document import campaign, document, findings_of
from tests.support.rendered import law_figure, place_figure, symbol_rows
from tunnel_lab.report import render_report


@pytest.mark.usefixtures("undrawn")
def test_symbols_of_coefficients_and_causes_are_explained() -> None:
    rows = dict(symbol_rows(findings_of(document())))
    assert {"Cnβ", "Cnr", "β", "β̇", "V", "l", "C2"} <= set(rows)
    assert "ωn" not in rows  # nothing in this document has it
    assert all(re.search(r"\[[^]]+\]", meaning) for meaning in rows.values())  # each has its unit
    page = render_report(findings_of(document()), campaign())
    folded = page.partition('<details class="fold">')[2].partition("</details>")[0]
    for symbol, meaning in rows.items():
        assert f"<dt>{symbol}</dt>" in folded
        assert meaning.partition(" [")[0].split("'")[0] in folded


def test_of_runs_without_a_stated_spring_frequency_and_damping_are_explained() -> None:
    given = document()
    for when in ("before", "after"):
        values = given["coefficients"][when]
        given["coefficients"][when] = {"omega_n": values["cn_beta"], "zeta": values["cn_r"]}
    rows = dict(symbol_rows(findings_of(given)))
    assert {"ωn", "ζ"} <= set(rows)
    assert "Cnβ" not in rows


@pytest.mark.parametrize("of_two", [False, True])
def test_a_colour_bar_has_the_colours_of_the_theme(of_two: bool) -> None:
    given = document()
    if of_two:
        given["closable"] = {
            "ceilings": [],
            "kind": "angle and rate",
            "curve": {
                "over": ["angle", "rate"],
                "places": [[-0.1, 0.1], [-1.0, 0.0, 1.0]],
                "values": [-1.0, -0.5, -0.2, 0.2, 0.5, 1.0],
                "std": [0.01] * 6,
                "unit": "N m",
            },
        }
    drawn = law_figure(findings_of(given)) if of_two else place_figure(findings_of(given))
    assert drawn is not None
    svg = inline_svg(drawn, "map", "A map.")
    assert "<image" not in svg  # an image keeps the colours of the light page
    assert "var(--before)" in svg
    assert 'shape-rendering="crispEdges"' in svg  # no seams between the areas
