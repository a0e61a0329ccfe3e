"""A score as a figure. matplotlib is imported inside the functions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from identification.scoring.accuracy import INTERVAL, NOMINAL_COVERAGE, Score, score
from tunnel_lab.plotting.common import figure, grid, styled
from tunnel_lab.plotting.plots import COLOURS, MARKERS
from tunnel_lab.scoring.grid import NO_EFFECT
from tunnel_lab.scoring.results import Results
from tunnel_lab.scoring.tables import NAMES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLES = tuple((colour, marker) for marker in MARKERS for colour in COLOURS)
_SHOWN = ("zeta", "omega_n", "cn_beta", "cn_r")


@styled
def score_figure(results: Results) -> Figure:
    """RMSE over the bound above, coverage of 95 % intervals below, cell by cell, with 95 % intervals.

    Returns:
        A column of two panels for each of ζ, ωn, Cnβ and Cnr that was scored; cells in the grid's order, one
        colour and marker for each estimator.
    """
    trials = results.trials()
    shown = [name for name in _SHOWN if any(name in cell.quantities for cell in results.grid.cells)]
    fig = figure(1.0 + 4.2 * len(shown), 8.4)
    panels = fig.subplots(2, len(shown), squeeze=False)
    for column, quantity in enumerate(shown):
        cells = [i for i, cell in enumerate(results.grid.cells) if quantity in cell.quantities]
        for place, name in enumerate(results.estimators):
            scores = [score(trials[name, cell, quantity]) for cell in cells]
            shift = 0.6 * ((place + 0.5) / len(results.estimators) - 0.5)
            _errors(panels[0, column], scores, shift, place, name)
            _coverage(panels[1, column], scores, shift, place)
        panels[0, column].set_yscale("log")
        panels[0, column].axhline(1.0, color="black", linewidth=1.0)
        panels[1, column].axhline(100 * NOMINAL_COVERAGE, color="black", linewidth=1.0)
        panels[1, column].set_ylim(-3.0, 103.0)
        panels[0, column].set_title(NAMES[quantity])
        for axes in panels[:, column]:
            _cells(axes, [""] * len(cells))
        _cells(panels[1, column], [_short(results, cell) for cell in cells])
    panels[0, 0].set_ylabel("RMSE over the Cramér–Rao bound")
    panels[1, 0].set_ylabel("95 % intervals that contain the truth [%]")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 8))
    return fig


def _errors(axes: Axes, scores: list[Score], shift: float, place: int, name: str) -> None:
    colour, marker = STYLES[place]
    points = [(i + shift, s.rmse_over_bound) for i, s in enumerate(scores) if s.rmse_over_bound is not None]
    axes.errorbar(
        [x for x, _ in points],
        [figure.value for _, figure in points],
        yerr=[min(INTERVAL * figure.std, 0.9 * figure.value) for _, figure in points],
        color=colour, marker=marker, linestyle="none", markersize=4.5, elinewidth=1.0, label=name,
    )  # fmt: skip


def _coverage(axes: Axes, scores: list[Score], shift: float, place: int) -> None:
    colour, marker = STYLES[place]
    points = [(i + shift, s.coverage) for i, s in enumerate(scores) if s.coverage is not None]
    value = np.array([100 * share.value for _, share in points])
    ends = 100 * np.array([share.interval for _, share in points]).reshape(-1, 2)
    spans = np.maximum(np.stack((value - ends[:, 0], ends[:, 1] - value)), 0.0)
    axes.errorbar(
        [x for x, _ in points],
        value,
        yerr=spans,
        color=colour, marker=marker, linestyle="none", markersize=4.5, elinewidth=1.0,
    )  # fmt: skip


def _cells(axes: Axes, labels: list[str]) -> None:
    axes.set_xticks(range(len(labels)), labels, rotation=90, fontsize=8)
    axes.set_xlim(-0.6, len(labels) - 0.4)
    for edge in range(len(labels) - 1):
        axes.axvline(edge + 0.5, color="0.92", linewidth=0.8)
    grid(axes, "y")


def _short(results: Results, index: int) -> str:
    cell = results.grid.cells[index]
    if cell.kind == "decay":
        return f"ζ {cell.zeta:g}, {cell.frequency:g} Hz\nS/A {100 * cell.noise:g} %, {cell.duration:g} s"
    effect = "" if cell.effect == NO_EFFECT else f"\n{cell.effect.partition(':')[0].replace('_', ' ')}"
    return f"{cell.wind_speed:g} m/s\nS/A {100 * cell.noise:g} %, {cell.duration:g} s{effect}"
