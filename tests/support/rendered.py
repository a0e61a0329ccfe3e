"""Words, tables and figures of single findings, each from a whole answer, as the faces call them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from diagnosis.findings import candidates, closure, coefficients, place, remainder, symbols
from diagnosis.findings.sections import EFFECT_LISTED
from diagnosis.findings.whole import Findings
from identification.show.blocks import TextTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TESTS, SOURCES = closure.TESTS, coefficients.SOURCES


def candidates_table(answer: Findings) -> TextTable:
    return candidates.candidates_table(answer.candidates, answer.repeated, answer)


def parameters_table(answer: Findings) -> TextTable:
    return candidates.parameters_table(answer.candidates[0], answer.repeated, answer, answer.found.choices)


def inclusion_line(answer: Findings) -> str:
    return candidates.inclusion_line(answer.inclusion, EFFECT_LISTED)


def symbol_rows(answer: Findings) -> list[tuple[str, str]]:
    stated = {**answer.coefficients.before, **answer.coefficients.after}
    return symbols.symbol_rows(answer.causes, stated, answer.candidates[0].parameters)


def rest_words(answer: Findings) -> str:
    return "" if answer.rest is None else answer.rest.in_words(answer)


def closable_words(answer: Findings) -> str:
    return remainder.closable_words(answer.closable, answer)


def closable_line(answer: Findings) -> str:
    return remainder.closable_line(answer.closable, answer.rest, answer)


def closable_table(answer: Findings) -> TextTable:
    return remainder.closable_table(answer.closable, answer)


def scatter_words(answer: Findings) -> str:
    return answer.repeated.scatter_words(answer)


def repeatability_line(answer: Findings) -> str:
    return answer.repeated.line(answer)


def repeatability_table(answer: Findings) -> TextTable:
    return answer.repeated.table(answer)


def where_words(answer: Findings) -> str:
    return place.where_words(answer.where, answer.found.place or answer.found.nowhere, answer)


def lines_table(answer: Findings) -> TextTable:
    return place.lines_table(answer.maps, answer.misfit.unit)


def place_rows(answer: Findings) -> tuple[tuple[str, str], ...]:
    return place.place_rows(answer.where, answer)


def runs_table(answer: Findings, campaign: object = None) -> TextTable:
    return closure.runs_table(answer.gap, answer.where.runs, answer, campaign)  # type: ignore[arg-type]


def waterfall_table(answer: Findings) -> TextTable:
    return closure.waterfall_table(answer.waterfall, answer.misfit)


def tests_table(answer: Findings) -> TextTable:
    return closure.tests_table(answer.gap)


def noise_line(answer: Findings) -> str:
    return closure.noise_line(answer.noise, answer.misfit.unit)


def model_line(answer: Findings) -> str:
    return closure.model_line(answer.confirmation, answer.misfit.unit)


def coefficients_table(answer: Findings) -> TextTable:
    return coefficients.coefficients_table(answer.coefficients, answer)


def budget_table(answer: Findings) -> TextTable:
    return coefficients.budget_table(answer.coefficients)


def hidden_table(answer: Findings) -> TextTable:
    return coefficients.hidden_table(answer.hidden, answer.coefficients)


def hidden_line(answer: Findings) -> str:
    return coefficients.hidden_line(answer.hidden, answer.coefficients)


def coefficients_line(answer: Findings) -> str:
    return coefficients.coefficients_line(answer.coefficients)


def consequence(answer: Findings) -> str:
    return coefficients.consequence(answer.coefficients, answer)


def coefficient_note(answer: Findings) -> str:
    return coefficients.coefficient_note(answer.coefficients, answer)


def drawn(name: str) -> Callable[[Findings], Figure | None]:
    """What draws one figure of an answer; it gives None where the answer has none."""

    def draw(answer: Findings) -> Figure | None:
        picture = answer.pictures.get(name)
        return None if picture is None else picture.draw()

    return draw


candidates_figure = drawn("which")
waterfall_figure, closure_figure, law_figure = drawn("waterfall"), drawn("how-far"), drawn("law")
coefficients_figure, friction_figure = drawn("coefficients"), drawn("friction")
repeatability_figure, runs_figure, profiles_figure = (
    drawn("repeatability"),
    drawn("where-runs"),
    drawn("where-profiles"),
)
spectrum_figure, backbone_figure = drawn("where-spectrum"), drawn("where-backbones")
phase_plane_figure, moment_figure = drawn("where-phase-plane"), drawn("where-moment")
place_figure = drawn("place")
