"""A score as a figure. matplotlib is imported inside the functions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from identification.scoring import NOMINAL_COVERAGE, Score, score
from identification.show.quantity import INTERVAL
from identification.show.style import COLOURS, MARKERS, WIDTH, figure, grid, log_axis, styled, text_width
from tunnel_lab.experiments.score import Results
from tunnel_lab.experiments.score_columns import NAMES
from tunnel_lab.experiments.score_grid import Cell
from tunnel_lab.terminal.arguments import NO_EFFECT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

_SHOWN = ("zeta", "omega_n", "cn_beta", "cn_r")
_KINDS = {"decay": "Single decays", "campaign": "Campaigns"}
_PANEL, _BESIDE, _ROW, _HEAD = 0.95, 0.2, 0.2, 0.95  # inches
_LEGEND = 1.8  # inches, with the gap before it
_TITLE = 9  # points
_LONGEST = 36  # maximum number of characters in a line of a label


@dataclass(frozen=True)
class _Rows:
    """The cells of one kind, as the rows of its panels.

    Args:
        cells: indices of the cells in the grid.
        labels: labels of the rows, some in several lines.
        title: the conditions common to the rows.
        quantities: drawn quantities, given by at least one of the estimators.
        lines: number of lines of the longest label.
    """

    cells: Sequence[int]
    labels: Sequence[str]
    title: str
    quantities: Sequence[str]
    lines: int


def _rows(results: Results, kind: str, title: str) -> _Rows | None:
    """The rows of one kind of cell; None without such cells or estimates."""
    cells = [index for index, cell in enumerate(results.grid.cells) if cell.kind == kind]
    given = [name for name in _SHOWN if any(results.gives(one, name) for one in results.estimators)]
    quantities = [name for name in given if cells and name in results.grid.cells[cells[0]].quantities]
    if not quantities:
        return None
    labels, common = cell_labels([results.grid.cells[index] for index in cells])
    wrapped = [wrap(label, _LONGEST) for label in labels]
    title = f"{title}{', ' if common else ''}{common}"
    return _Rows(cells, ["\n".join(one) for one in wrapped], title, quantities, max(map(len, wrapped)))


@styled
def score_figure(results: Results) -> Figure:
    """RMSE over the bound and coverage of 95 % intervals, with the sampling errors' 95 % intervals.

    Each kind of cell has two rows of panels, one panel for each estimator. Cells are in rows, in the order of
    the grid, to compare the estimators side by side; quantities differ in colour and marker. A kind without
    estimates is left out.
    """
    every = (_rows(results, kind, title) for kind, title in _KINDS.items())
    kinds = [one for one in every if one is not None]
    heights = [_HEAD + _ROW * one.lines * len(one.cells) for one in kinds for _ in range(2)]
    beside = _BESIDE + max((text_width(label, _TITLE) for one in kinds for label in one.labels), default=0.0)
    titles = max((text_width(one.title, _TITLE) for one in kinds), default=0.0)
    width = max(WIDTH, titles + _LEGEND, beside + _PANEL * len(results.estimators))
    room = (width - beside) / len(results.estimators) - _BESIDE
    fig = figure(width, sum(heights) or _HEAD)
    if not kinds:
        return fig
    parts = iter(fig.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0])
    for one in kinds:
        _block(next(parts), results, one, room, covered=False)
        _block(next(parts), results, one, room, covered=True)
    return fig


def _block(part: SubFigure, results: Results, rows: _Rows, room: float, *, covered: bool) -> None:
    """One row of panels, each ``room`` inches wide."""
    trials = results.trials
    panels = part.subplots(1, len(results.estimators), sharex=True, sharey=True, squeeze=False)[0]
    handles: dict[str, Any] = {}
    for axes, name in zip(panels, results.estimators, strict=True):
        axes.axvline(100 * NOMINAL_COVERAGE if covered else 1.0, color="0.4", linewidth=0.8, zorder=1)
        given = [quantity for quantity in rows.quantities if results.gives(name, quantity)]
        for quantity in given:
            scores = [score(trials[name, cell, quantity]) for cell in rows.cells]
            handles[quantity] = _draw(
                axes, scores, rows.quantities.index(quantity), len(rows.quantities), covered
            )
        if not given:
            axes.text(0.5, 0.5, "not given", ha="center", va="center", fontsize=8, transform=axes.transAxes)
        axes.set_title(name.replace("_", " "), loc="center", fontsize=8)
        axes.tick_params(axis="y", length=0)
        grid(axes, "x")
    panels[0].set_yticks(range(len(rows.cells)), rows.labels)
    panels[0].set_ylim(len(rows.cells) - 0.5, -0.5)
    if covered:
        panels[0].set_xlim(-4.0, 104.0)
        panels[0].set_xticks([0, 50, 100])
    else:  # the panels share the axis; its labels depend on a panel with values
        known = [axes for axes in panels if np.isfinite(axes.dataLim.minposx)]
        log_axis((known or panels)[0], "x", room)
    part.supxlabel(
        "95 % intervals that contain the truth [%]" if covered else "RMSE over the Cramér–Rao bound",
        fontsize=_TITLE,
    )
    part.suptitle(rows.title, x=0.01, ha="left", fontsize=_TITLE)
    names = [quantity for quantity in rows.quantities if quantity in handles]
    shown = [NAMES[quantity] for quantity in names]
    part.legend(
        [handles[one] for one in names], shown, loc="upper right", ncols=max(len(names), 1), borderaxespad=0.0
    )


def _draw(axes: Axes, scores: Sequence[Score], place: int, count: int, covered: bool) -> Any:
    """Draw one quantity in a panel, the ``place``-th of ``count``; returns the handle for the legend."""
    shift = 0.36 * ((place + 0.5) / count - 0.5)
    spans: Any
    if covered:
        shares = [(row + shift, s.coverage) for row, s in enumerate(scores) if s.coverage is not None]
        rows, values = [row for row, _ in shares], np.array([100 * share.value for _, share in shares])
        ends = 100 * np.array([share.interval for _, share in shares]).reshape(-1, 2)
        spans = np.maximum(np.stack((values - ends[:, 0], ends[:, 1] - values)), 0.0)
    else:
        errors = [(row + shift, s.rmse_over_bound) for row, s in enumerate(scores) if s.rmse_over_bound]
        rows, values = [row for row, _ in errors], np.array([error.value for _, error in errors])
        spans = [min(INTERVAL * error.known_std, 0.9 * error.value) for _, error in errors]
    return axes.errorbar(
        values, rows, xerr=spans, color=COLOURS[place], marker=MARKERS[place], linestyle="none",
        markersize=3.0, elinewidth=0.8,
    )  # fmt: skip


def cell_labels(cells: Sequence[Cell]) -> tuple[list[str], str]:
    """The conditions that distinguish each cell of one kind, in a few words, and the common conditions."""
    parts = []
    for cell in cells:
        noise, duration = f"noise {100 * cell.noise:g} %", f"{cell.duration:g} s"
        names = () if cell.effect == NO_EFFECT else cell.effect.split(" + ")
        effect = " + ".join(name.partition(":")[0].replace("_", " ") for name in names)
        if cell.kind == "decay":
            parts.append((f"ζ {cell.zeta:g}", f"{cell.frequency:g} Hz", noise, duration))
        else:
            parts.append((f"{cell.wind_speed:g} m/s", noise, duration, effect))
    if len(parts) == 1:
        return [", ".join(filter(None, parts[0]))], ""
    varied = [len(set(column)) > 1 for column in zip(*parts, strict=True)]
    common = [text for text, varies in zip(parts[0], varied, strict=True) if text and not varies]
    labels = [
        ", ".join(text for text, varies in zip(texts, varied, strict=True) if text and varies) or "no effect"
        for texts in parts
    ]
    return labels, ", ".join(common)
