"""A score as a figure. matplotlib is imported inside the functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from identification.scoring.accuracy import INTERVAL, NOMINAL_COVERAGE, Score, score
from tunnel_lab.plotting.style import COLOURS, MARKERS, figure, grid, log_axis, styled
from tunnel_lab.scoring.grid import NO_EFFECT, Cell
from tunnel_lab.scoring.results import Results
from tunnel_lab.scoring.tables import NAMES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

_SHOWN = ("zeta", "omega_n", "cn_beta", "cn_r")
_TITLES = {"decay": "Single decays", "campaign": "Campaigns"}
_PANEL, _LABELS, _ROW, _HEAD = 0.95, 1.7, 0.2, 0.85  # inches


@styled
def score_figure(results: Results) -> Figure:
    """RMSE over the bound and coverage of 95 % intervals, with the sampling errors' 95 % intervals.

    Returns:
        For each kind of cell two rows of panels, one panel for each estimator. Cells are in rows, in the grid's
        order, so that reading across compares the estimators; quantities differ in colour and marker.
    """
    kinds = [cell.kind for cell in results.grid.cells]
    groups = {
        title: [index for index, kind in enumerate(kinds) if kind == wanted]
        for wanted, title in _TITLES.items()
        if wanted in kinds
    }
    heights = [_HEAD + _ROW * len(cells) for cells in groups.values() for _ in range(2)]
    fig = figure(_LABELS + _PANEL * len(results.estimators), sum(heights))
    parts = iter(fig.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0])
    for name, cells in groups.items():
        _block(next(parts), results, name, cells, covered=False)
        _block(next(parts), results, name, cells, covered=True)
    return fig


def _block(part: SubFigure, results: Results, group: str, cells: Sequence[int], *, covered: bool) -> None:
    """One row of panels."""
    labels, common = cell_labels([results.grid.cells[index] for index in cells])
    trials = results.trials()
    quantities = [name for name in _SHOWN if name in results.grid.cells[cells[0]].quantities]
    panels = part.subplots(1, len(results.estimators), sharex=True, sharey=True, squeeze=False)[0]
    for axes, name in zip(panels, results.estimators, strict=True):
        axes.axvline(100 * NOMINAL_COVERAGE if covered else 1.0, color="0.4", linewidth=0.8, zorder=1)
        for place, quantity in enumerate(quantities):
            scores = [score(trials[name, cell, quantity]) for cell in cells]
            shift = 0.36 * ((place + 0.5) / len(quantities) - 0.5)
            draw = _coverage if covered else _errors
            style = {"color": COLOURS[place], "marker": MARKERS[place], "label": NAMES[quantity]}
            draw(axes, scores, shift, style)
        axes.set_title(name.replace("_", " "), loc="center", fontsize=8)
        axes.tick_params(axis="y", length=0)
        grid(axes, "x")
    panels[0].set_yticks(range(len(cells)), labels)
    panels[0].set_ylim(len(cells) - 0.5, -0.5)
    if covered:
        panels[0].set_xlim(-4.0, 104.0)
        panels[0].set_xticks([0, 50, 100])
    else:
        log_axis(panels[0], "x")
    quantity = "95 % intervals that contain the truth [%]" if covered else "RMSE over the Cramér–Rao bound"
    part.supxlabel(quantity, fontsize=9)
    part.suptitle(f"{group}{', ' if common else ''}{common}", x=0.01, ha="left", fontsize=9)
    handles, names = panels[0].get_legend_handles_labels()
    part.legend(handles, names, loc="upper right", ncols=len(names), borderaxespad=0.0)


def _errors(axes: Axes, scores: Sequence[Score], shift: float, style: dict[str, Any]) -> None:
    points = [(row, s.rmse_over_bound) for row, s in enumerate(scores) if s.rmse_over_bound is not None]
    axes.errorbar(
        [found.value for _, found in points],
        [row + shift for row, _ in points],
        xerr=[min(INTERVAL * found.std, 0.9 * found.value) for _, found in points],
        linestyle="none", markersize=3.0, elinewidth=0.8, **style,
    )  # fmt: skip


def _coverage(axes: Axes, scores: Sequence[Score], shift: float, style: dict[str, Any]) -> None:
    points = [(row, s.coverage) for row, s in enumerate(scores) if s.coverage is not None]
    value = np.array([100 * share.value for _, share in points])
    ends = 100 * np.array([share.interval for _, share in points]).reshape(-1, 2)
    spans = np.maximum(np.stack((value - ends[:, 0], ends[:, 1] - value)), 0.0)
    axes.errorbar(
        value,
        [row + shift for row, _ in points],
        xerr=spans,
        linestyle="none", markersize=3.0, elinewidth=0.8, **style,
    )  # fmt: skip


def cell_labels(cells: Sequence[Cell]) -> tuple[list[str], str]:
    """The conditions of cells of one kind in a few words.

    Returns:
        What distinguishes each cell from the others; and what is common to all.
    """
    parts = [_parts(cell) for cell in cells]
    if len(parts) == 1:
        return [", ".join(filter(None, parts[0]))], ""
    varied = [len(set(column)) > 1 for column in zip(*parts, strict=True)]
    common = [text for text, varies in zip(parts[0], varied, strict=True) if text and not varies]
    labels = [
        ", ".join(text for text, varies in zip(own, varied, strict=True) if text and varies) for own in parts
    ]
    return labels, ", ".join(common)


def _parts(cell: Cell) -> tuple[str, ...]:
    noise, duration = f"noise {100 * cell.noise:g} %", f"{cell.duration:g} s"
    if cell.kind == "decay":
        return (f"ζ {cell.zeta:g}", f"{cell.frequency:g} Hz", noise, duration)
    effect = "" if cell.effect == NO_EFFECT else cell.effect.partition(":")[0].replace("_", " ")
    return (f"{cell.wind_speed:g} m/s", noise, duration, effect)
