"""The figure of repeatability: frequency and damping of every run against the model of all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.findings.repeatability import RunRepeat
from diagnosis.findings.whole import Findings
from diagnosis.words.scatter import percent_of, scatters
from identification.show.drawing import AFTER, BEFORE, INK, NARROW, NOISE, PAPER
from identification.show.style import INTERVAL, figure, figure_text, grid, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROW = 0.24  # inches for a run
_AROUND = 1.25  # inches: key, axis and its label
_BAND = 0.72  # of a row
_MARGIN = 0.08  # of the axis
_BESIDE = 7.0  # points between a mark and its text
_NUMBERS = {"frequency": "frequency", "damping": "damping ratio"}


@styled
def repeatability_figure(answer: Findings) -> Figure | None:
    """Every run's frequency and damping minus the model's, in per cent; None for a single run.

    The runs are in their order. The band of a run is the 95 % interval of the scatter between runs under its wind
    and spring. Error bars are the noise's 95 % intervals.
    """
    found = answer.repeatability
    if not found or len(found.runs) < 2:
        return None
    runs = found.runs
    fig = figure(NARROW, _AROUND + _ROW * max(len(runs), 4))
    panels = fig.subplots(1, 2, sharey=True)
    for axes, name in zip(panels, _NUMBERS, strict=True):
        _draw_runs(axes, runs, name, str(found.outlier))
    panels[0].set_yticks(np.arange(len(runs)), [figure_text(str(one.id)) for one in runs])
    panels[0].set_ylim(len(runs) - 0.4, -0.6)
    panels[1].tick_params(axis="y", length=0)
    handles, labels = panels[0].get_legend_handles_labels()
    if not scatters(answer):
        labels = ["noise (95 %)" if label.startswith("scatter") else label for label in labels]
    fig.legend(
        handles,
        labels,
        loc="outside upper left",
        ncols=min(len(labels), 3),
        handlelength=1.4,
        columnspacing=1.2,
    )
    return fig


def _draw_runs(axes: Axes, runs: Sequence[RunRepeat], name: str, outlier: str) -> None:
    """One quantity of every run against the model's, with its band and error bar."""
    rows = np.arange(len(runs))
    value, std, band = (
        100.0 * column for column in np.array([one.deviation(name) for one in runs], np.float64).T
    )
    reach = INTERVAL * np.hypot(band, std if not band.any() else 0.0)
    axes.barh(rows, 2.0 * reach, left=-reach, height=_BAND, color=NOISE, linewidth=0, label="scatter (95 %)")
    axes.axvline(0.0, color=INK, linewidth=0.8)
    windy = np.array([bool(one.windy) for one in runs])
    far = np.array([one.id == outlier for one in runs])
    kinds = ((windy & ~far, "wind on", AFTER, AFTER), (~windy & ~far, "wind off", AFTER, PAPER))
    for chosen, label, colour, face in (*kinds, (far, "deviates far beyond", BEFORE, BEFORE)):
        if chosen.any():
            axes.errorbar(
                value[chosen], rows[chosen], xerr=INTERVAL * std[chosen], fmt="D" if label[0] == "d" else "o",
                color=colour, mfc=face, ms=5, capsize=2, elinewidth=1.0, label=label,
            )  # fmt: skip
    ends = np.concatenate([value - INTERVAL * std, value + INTERVAL * std, reach, -reach])
    low, high = float(ends.min()), float(ends.max())
    margin = _MARGIN * (high - low) or 1.0
    axes.set_xlim(low - margin, high + margin)
    axes.set_xlabel(f"{_NUMBERS[name]} minus\nthe model's [%]")
    axes.locator_params(axis="x", nbins=4)
    grid(axes, "x")
    for row in np.flatnonzero(far & (np.abs(value) > reach)).tolist():
        # on the side that has room
        side = -1.0 if value[row] > float(np.mean(axes.get_xlim())) else 1.0
        axes.annotate(
            percent_of(runs[row].deviation(name)[0], sign=True), (value[row], row), (side * _BESIDE, 0),
            textcoords="offset points", ha="left" if side > 0.0 else "right", va="center", color=INK,
        )  # fmt: skip
