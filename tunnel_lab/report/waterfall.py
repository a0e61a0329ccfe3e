"""What is left of the gap as the causes are added one after another, as a figure."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.printing import excess_std, plain
from identification.printing import significant
from tunnel_lab.plotting.style import figure, grid, styled
from tunnel_lab.report.drawing import (
    ACCENT,
    AFTER,
    BEFORE,
    INK,
    NARROW,
    NOISE,
    PAPER,
    QUIET,
    SIGMAS,
    Document,
    misfit_scale,
)
from tunnel_lab.report.view import WITHIN_THE_NOISE
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LABEL = 20  # characters in a line of a label
_LEAST_NOISE = 1e-3  # noise powers: where the document has no maps, and so no noise of an excess
_VISIBLE = 0.01  # of the axis: a band narrower than this is not seen, and has no key
_BESIDE = 7.0  # points between a mark and its text
_MARK = 5.0  # points: the size of the mark of what is left without a cause alone
_BEFORE_ZERO = 0.03  # of the axis: a mark at zero is clear of the labels


@styled
def waterfall_figure(document: Document) -> Figure | None:
    """What is left of the gap as the causes are added one after another.

    Returns:
        A dot for the nominal gap, a bar for each cause from what was left before it to what it leaves, and a dot
        for the rest, on a linear scale of the root mean square misfit. None where no cause is named.
    """
    steps = document.get("waterfall", [])
    if len(steps) < 2:
        return None
    unit, size = misfit_scale(document)
    left = np.array([size(step["excess"]) for step in steps], np.float64)
    without = {name: size(value) for name, value in document.get("without", {}).items()}
    alone = [without.get(step["effect"], np.nan) if len(without) > 1 else np.nan for step in steps]
    fig = figure(NARROW, 1.2 + 0.36 * (left.size + 1))
    axes = fig.add_subplot()
    _steps(axes, left)
    if np.isfinite(alone).any():
        axes.plot(
            alone, range(left.size), "o", color=INK, mfc=PAPER, ms=_MARK, label="without this cause alone"
        )
    names = [textwrap.fill(f"+ {plain(str(step['effect']))}", _LABEL) for step in steps[1:]]
    axes.set_yticks(range(left.size + 1), ["nominal model", *names, "the rest"])
    axes.set_ylim(left.size + 0.5, -0.5)
    axes.set_xlabel(f"root mean square misfit [{unit}]")
    axes.locator_params(axis="x", nbins=6)
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)
    axes.axvline(0.0, color=QUIET, linewidth=0.8, zorder=0.8)
    grid(axes, "x")
    ends = [left[0], *np.maximum(left[:-1], left[1:]), left[-1]]
    _texts(axes, _words(document, left, unit), ends, [*alone, np.nan])
    noise = size(SIGMAS * (excess_std(document) or _LEAST_NOISE))
    seen = noise > _VISIBLE * axes.get_xlim()[1]
    axes.axvspan(0.0, noise, color=NOISE, linewidth=0, zorder=0.3, label="noise (3σ)" if seen else None)
    if seen or np.isfinite(alone).any():
        _key(axes)
    return fig


def _steps(axes: Axes, left: Array) -> None:
    """What each cause closes (or opens) as a bar between two values; the first and the last value as dots."""
    starts, ends = np.minimum(left[:-1], left[1:]), np.maximum(left[:-1], left[1:])
    colours = [AFTER if after <= before else BEFORE for before, after in pairwise(left)]
    rows = np.arange(left.size + 1)
    axes.vlines(left, rows[:-1], rows[1:], color=QUIET, linewidth=0.8, zorder=0.9)
    axes.barh(rows[1:-1], ends - starts, left=starts, color=colours, height=0.55)
    for row, value, colour in ((0, left[0], BEFORE), (rows[-1], left[-1], ACCENT)):
        axes.plot(value, row, "o", color=colour, ms=8, clip_on=False)


def _words(document: Document, left: Array, unit: str) -> list[str]:
    """The texts of the rows: the last cause leaves the rest, which is said in the row of the rest."""
    mark = unit if unit == "°" else ""
    shown = [f"{significant(value, 3) if value else '0'}{mark}" for value in left.tolist()]
    rest = document.get("rest") or {}
    if rest.get("significant") is False:
        shown[-1] = WITHIN_THE_NOISE
    elif rest:
        shown[-1] += ", material" if rest.get("material") else ", immaterial"
    return [shown[0], *(f"leaves {text}" for text in shown[1:-1]), "", shown[-1]]


def _texts(axes: Axes, words: Sequence[str], ends: Sequence[float], marks: Sequence[float]) -> None:
    """Texts to the right of what they belong to, clear of the marks, on an axis that holds them all.

    Args:
        words: the text of each row.
        ends: right end of each row's bar or dot, in data units.
        marks: another mark in the row, in data units; NaN: none.
    """
    axes.figure.draw_without_rendering()  # type: ignore[union-attr]  # sizes are known after the layout only
    points = 72.0 / axes.figure.dpi
    whole = points * axes.get_window_extent().width
    texts = [
        axes.annotate(text, (end, row), (_BESIDE, 0), textcoords="offset points", va="center")
        for row, (text, end) in enumerate(zip(words, ends, strict=True))
    ]
    widths = [_BESIDE + points * text.get_window_extent().width for text in texts]
    beside = np.fmax(ends, marks)  # where a text stands that has to clear the mark
    free = (1.0 + _BEFORE_ZERO) * (1.0 - np.array(widths) / whole) - _BEFORE_ZERO
    reach = float(max(np.max(beside / free), 1.05 * np.max(beside))) or 1.0
    axes.set_xlim(-_BEFORE_ZERO * reach, reach)
    point = (1.0 + _BEFORE_ZERO) * reach / whole
    for row, (text, end, mark) in enumerate(zip(texts, ends, marks, strict=True)):
        if end + (_BESIDE - _MARK) * point < mark < end + (widths[row] + _MARK) * point:
            text.xy = (mark, row)


def _key(axes: Axes) -> None:
    """The key, in line with the axis above it."""
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderpad=0.0, borderaxespad=0.3,
        handlelength=1.2, columnspacing=1.4,
    )  # fmt: skip
