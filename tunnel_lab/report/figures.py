"""All figures of a diagnosis, by name: its answer, the explained part of the gap, and the coefficients."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from diagnosis.findings.answers import candidates_figure
from diagnosis.findings.finding import Picture
from diagnosis.findings.whole import Findings
from tunnel_lab.report import charts

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
    makers: dict[str, Callable[[Findings], Figure | None]] = {"fit": charts.fit_near} if answer.maps else {}
    makers["which"] = lambda whole: candidates_figure(whole.candidates)
    makers |= {name: partial(_drawn, drawn) for name, drawn in answer.pictures.items()}
    return dict(sorted(makers.items(), key=lambda one: _place_of(one[0])))


def _place_of(name: str) -> int:
    """The place of a figure in the order of the report; last for a figure that has none of its own."""
    return next((i for i, first in enumerate(_ORDER) if name.startswith(first)), len(_ORDER))


_ORDER = (
    "fit", "waterfall", "coefficients", "place", "where", "which", "friction", "repeatability", "how-far", "law",
)  # fmt: skip


def _drawn(picture: Picture, _: Findings) -> Figure | None:
    return picture.draw()
