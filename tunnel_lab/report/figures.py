"""All figures of a diagnosis, by name: its answer, the explained part of the gap, and the coefficients."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.findings.finding import Picture
from diagnosis.findings.place import place_figure
from diagnosis.findings.terms import answer_name
from diagnosis.findings.whole import Findings
from diagnosis.words.answers import ranked
from identification.show.drawing import (
    ACCENT,
    NARROW,
    QUIET,
)
from identification.show.numbers import plain, probability
from identification.show.style import (
    figure,
    grid,
    styled,
)
from tunnel_lab.report import charts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 8
"""Most answers drawn."""
_LOW = 2.1  # inches: a map on the printed summary
_LABEL = 24  # characters in a line of a label


#: By independent variable of a law: the label of its axis, and the factor on radians or seconds.


def diagnosis_figures(answer: Findings) -> dict[str, Figure]:
    """All figures of a diagnosis by name, in the order of the report; those of ``maps`` only where present."""
    figures = {name: make(answer) for name, make in _makers(answer).items()}
    return {name: figure for name, figure in figures.items() if figure is not None}


def diagnosis_figure(answer: Findings, name: str) -> Figure | None:
    """One of `diagnosis_figures`; None where there is no such figure."""
    make = _makers(answer).get(name)
    return None if make is None else make(answer)


def _makers(answer: Findings) -> dict[str, Callable[[Findings], Figure | None]]:
    """By name, in the order of the report, what draws each figure, or finds that there is none."""
    makers: dict[str, Callable[[Findings], Figure | None]] = {"fit": charts.fit_figure} if answer.maps else {}
    makers |= {name: partial(_drawn, drawn) for name, drawn in answer.pictures.items()}
    return makers | {
        "which": candidates_figure,
    }


def _drawn(picture: Picture, _: Findings) -> Figure | None:
    return picture.draw()


def summary_figures(answer: Findings) -> dict[str, Figure]:
    """The figures of the printed summary; the fit over the data in several heights, one of which is shown."""
    located = answer.maps and answer.causes
    place = place_figure(answer, _LOW) if located else None
    figures = {"place": place, "waterfall": diagnosis_figure(answer, "waterfall")}
    return {name: figure for name, figure in figures.items() if figure is not None} | charts.fit_sheets(
        answer
    )


@styled
def candidates_figure(answer: Findings) -> Figure | None:
    """The answers that are not improbable; None for fewer than two, where words suffice."""
    least = answer.settings.words.answer_drawn
    shown = [c for c in ranked(answer)[:SHOWN] if c.probability >= least]
    if len(shown) < 2:
        return None
    names = [textwrap.fill(plain(answer_name(candidate.effect)), _LABEL) for candidate in shown]
    fig = figure(NARROW, 0.7 + 0.3 * len(shown) + 0.15 * sum(name.count("\n") for name in names))
    axes = fig.add_subplot()
    values = [candidate.probability for candidate in shown]
    colours = [ACCENT if candidate is answer.candidates[0] else QUIET for candidate in shown]
    axes.barh(range(len(shown)), values, color=colours, height=0.6)
    for index, value in enumerate(values):
        axes.text(value + 0.01, index, probability(value), va="center")
    axes.set_yticks(range(len(shown)), names)
    axes.invert_yaxis()
    axes.set(xlim=(0.0, 1.12), xticks=np.linspace(0.0, 1.0, 6), xlabel="probability")
    grid(axes, "x")
    return fig
