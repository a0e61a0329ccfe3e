"""The fit over the data: runs against time with both models, and their residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.findings.finding import Picture
from diagnosis.findings.misfit import run_labels
from diagnosis.findings.place_figures import TIME
from diagnosis.where.maps import Maps
from identification.show.drawing import AFTER, BEFORE, MARK, QUIET
from identification.show.numbers import unit_shown
from identification.show.style import WIDTH, figure, figure_text, grid, styled, with_breaks
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLUMNS = 2  # runs in a figure
_HEIGHT = 5.4  # inches
_LOW = 3.4  # inches: without the whole record
MEASURED, NOMINAL, CAUSES = "measured", "model", "model with the causes"


@dataclass(frozen=True, eq=False)
class Curves:
    """One run, in degrees where the readings are angles.

    Args:
        unit: of the readings.
        time: s, shape (n,).
        reading: in ``unit``, shape (n,).
        before: residuals of the nominal model, in ``unit``, shape (n,).
        after: residuals with the causes, in ``unit``, shape (n,); NaN where no cause was added.
        differ: the cycles in which the models differ most, s.
    """

    id: str
    label: str
    unit: str
    time: Array
    reading: Array
    before: Array
    after: Array
    differ: tuple[float, float]

    @property
    def residuals(self) -> tuple[Array, Array]:
        """Residuals of the nominal model and with the causes, in ``unit``, shape (n,) each."""
        return self.before, self.after


def fitted_runs(maps: Maps | None, ids: Sequence[str] = ()) -> list[Curves]:
    """The runs of a diagnosis against time, by ids or all, the largest gap first; none without ``maps``."""
    known = () if maps is None else maps.runs
    labels = dict(zip((run.id for run in known), run_labels(known), strict=True))
    traces = {} if maps is None else {trace.id: trace for trace in maps.traces}
    unit, factor = unit_shown("rad" if maps is None else maps.unit)
    runs = []
    for name in ids or traces:
        if name not in traces:
            all_runs = ", ".join(traces) or "none"
            raise TunnelError(f"the diagnosis has no run {name!r}", remedy=f"choose of its runs: {all_runs}")
        one = traces[name]
        reading, before = factor * one.reading_rad, factor * one.before_rad
        after = np.full(one.time_s.size, np.nan) if one.after_rad is None else factor * one.after_rad
        runs.append(
            Curves(name, labels.get(name, name), unit, one.time_s, reading, before, after, one.differ_s)
        )
    return runs


def fit_figure(maps: Maps | None, ids: Sequence[str] = ()) -> Figure | None:
    """The fit over the data of the first two of `fitted_runs`; None without runs.

    A column for each run: the whole record, with a mark at the cycles in which the models differ most; the
    reading in these cycles with the predictions of both models; and their residuals.
    """
    runs = fitted_runs(maps, ids)[:_COLUMNS]
    return _drawn(runs) if runs else None


def fit_pages(maps: Maps | None, ids: Sequence[str] = ()) -> list[Figure]:
    """The fit over the data of all runs, two to a figure, as `fit_figure` draws them."""
    runs = fitted_runs(maps, ids)
    return [_drawn(runs[first : first + _COLUMNS]) for first in range(0, len(runs), _COLUMNS)]


def fit_pictures(maps: Maps | None) -> tuple[Picture, ...]:
    """The fit over the data, without the whole records; none without ``maps``."""

    def draw() -> Figure | None:
        runs = fitted_runs(maps)[:_COLUMNS]
        return _drawn(runs, _LOW, whole=False) if runs else None

    drawn = Picture(
        "fit",
        "The cycles in which the models, fitted to all runs, differ most. Below: measured minus model.",
        "The measured and predicted readings of both models against time, and below them the residuals.",
        draw,
    )
    return (drawn,) if maps else ()


@styled
def _drawn(runs: Sequence[Curves], height: float = _HEIGHT, *, whole: bool = True) -> Figure:
    fig = figure(WIDTH, height)
    ratios = (0.7, 1.3, 0.9) if whole else (1.3, 0.9)
    panels = fig.subplots(len(ratios), len(runs), squeeze=False, height_ratios=ratios)
    for (*above, near, left), run in zip(panels.T, runs, strict=True):
        for axes in above:
            axes.plot(*with_breaks(run.time, run.reading), color=QUIET, linewidth=0.7)
            axes.axvspan(*run.differ, color=MARK, alpha=0.4, linewidth=0)
        (*above, near)[0].set_title(figure_text(run.label))
        _curves(near, run, run.reading, run.reading - run.before, run.reading - run.after)
        near.tick_params(labelbottom=False)
        _curves(left, run, None, run.before, run.after)
        left.axhline(0.0, color=QUIET, linewidth=0.8, zorder=0)
        left.set_xlabel(TIME)
        for axes in (*above, near, left):
            grid(axes)
    for axes, name in zip(panels[::-1, 0], ("residual", "reading", "whole reading"), strict=False):
        axes.set_ylabel(f"{name} [{runs[0].unit}]")
    handles, labels = panels[-2, 0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside lower center", ncols=3)
    return fig


def _curves(axes: Axes, run: Curves, measured: Array | None, before: Array, after: Array) -> None:
    """Curves of the cycles in which the models differ most."""
    shown = (run.time >= run.differ[0]) & (run.time <= run.differ[1])
    if measured is not None:
        points = with_breaks(run.time[shown], measured[shown])
        axes.plot(*points, color=QUIET, linewidth=4.0, alpha=0.5, label=MEASURED)
    for values, colour, label in ((before, BEFORE, NOMINAL), (after, AFTER, CAUSES)):
        if np.isfinite(values).any():
            points = with_breaks(run.time[shown], values[shown])
            axes.plot(*points, color=colour, linewidth=1.0, label=label)
    axes.set_xlim(*run.differ)
