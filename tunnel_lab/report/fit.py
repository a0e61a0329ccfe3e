"""The fit over the data: the reading and what both models predict, and their residuals on the same axis of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.closure import unit_shown
from tunnel_lab.plotting.style import WIDTH, figure, figure_text, grid, styled, with_breaks
from tunnel_lab.report.drawing import AFTER, BEFORE, MARK, QUIET, Document, array, run_label
from tunnel_lab.report.where import Chart, rounded, view
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLUMNS = 2  # runs in a figure
_HEIGHT = 5.4  # inches
_SHEETS = {
    "fit": _HEIGHT, "fit-whole-2": 4.9, "fit-whole-3": 4.4, "fit-whole-4": 4.0,
    "fit-near-1": 3.6, "fit-near-2": 3.2, "fit-near-3": 2.8, "fit-near-4": 2.5, "fit-near-5": 2.25,
}  # fmt: skip
"""Heights in inches; ``near`` leaves the whole record out."""
_TIME = "time since the start of the record [s]"
_MEASURED, _NOMINAL, _CAUSES = "measured", "nominal model", "with the causes"


@dataclass(frozen=True, eq=False)
class Curves:
    """One run, in degrees where the readings are angles.

    Args:
        unit: of the readings.
        time: s, shape (n,).
        reading: in ``unit``, shape (n,).
        before: residuals of the nominal model, in ``unit``, shape (n,).
        after: residuals with the causes, in ``unit``, shape (n,); NaN where nothing was added.
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


def fitted_runs(document: Document, ids: Sequence[str] = ()) -> list[Curves]:
    """The runs of a diagnosis against time, by ids or all, the largest gap first; none without ``maps``.

    Raises:
        TunnelError: for a run that the diagnosis does not have.
    """
    maps = document.get("maps") or {"runs": [], "traces": []}
    unit, factor = unit_shown(maps.get("unit", "rad"))
    labels = {run["id"]: run_label(run) for run in maps["runs"]}
    traces = {trace["id"]: trace for trace in maps["traces"] if "reading_rad" in trace}
    runs = []
    for name in ids or traces:
        if name not in traces:
            known = ", ".join(traces) or "none"
            raise TunnelError(f"the diagnosis has no run {name!r}", remedy=f"choose of its runs: {known}")
        trace = traces[name]
        time = array(trace["time_s"])
        reading, before = factor * array(trace["reading_rad"]), factor * array(trace["before_rad"])
        after = trace["after_rad"]
        after = np.full(time.size, np.nan) if after is None else factor * array(after)
        first, last = trace["differ_s"]
        runs.append(Curves(name, labels.get(name, name), unit, time, reading, before, after, (first, last)))
    return runs


def fit_figure(document: Document, ids: Sequence[str] = ()) -> Figure | None:
    """The fit over the data of the first two of `fitted_runs`; None without runs.

    A column for each run: the whole record, in which the cycles are marked where the models differ most; these
    cycles with the reading and what both models predict; and the residuals there.
    """
    runs = fitted_runs(document, ids)[:_COLUMNS]
    return _drawn(runs) if runs else None


def fit_pages(document: Document, ids: Sequence[str] = ()) -> list[Figure]:
    """The fit over the data of all runs, two to a figure, as `fit_figure` draws them."""
    runs = fitted_runs(document, ids)
    return [_drawn(runs[first : first + _COLUMNS]) for first in range(0, len(runs), _COLUMNS)]


def fit_sheets(document: Document) -> dict[str, Figure]:
    """The fit over the data of the two runs with the largest gap, in the heights that a printed page may have left.

    The highest comes first; the lower ones show the cycles where the models differ most and not the whole record.
    """
    runs = fitted_runs(document)[:_COLUMNS]
    sheets = _SHEETS.items() if runs else ()
    return {name: _drawn(runs, height, whole="near" not in name) for name, height in sheets}


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
        left.set_xlabel(_TIME)
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
        axes.plot(*points, color=QUIET, linewidth=4.0, alpha=0.5, label=_MEASURED)
    for values, colour, label in ((before, BEFORE, _NOMINAL), (after, AFTER, _CAUSES)):
        if np.isfinite(values).any():
            points = with_breaks(run.time[shown], values[shown])
            axes.plot(*points, color=colour, linewidth=1.0, label=label)
    axes.set_xlim(*run.differ)


def fit_charts(document: Document) -> dict[str, list[Chart]]:
    """The readings of every run and, below them on the same axis, the residuals, under the name ``fit``.

    They show the cycles first in which the models differ most; there are none without ``maps``.
    """
    runs = fitted_runs(document)
    if not runs:
        return {}
    models = [{"label": _NOMINAL, "role": "before"}, {"label": _CAUSES, "role": "after"}]
    measured = {"label": _MEASURED, "role": "quiet", "width": 6}
    fits = [_view(run, run.reading, run.reading - run.before, run.reading - run.after) for run in runs]
    residuals = [_view(run, run.before, run.after) for run in runs]
    return {
        "fit": [
            {
                "kind": "lines",
                "title": title,
                "height": height,
                "x": {"label": _TIME, "log": False},
                "y": {"label": f"{title.lower()} [{runs[0].unit}]", "log": False},
                "series": series,
                "views": views,
            }
            for title, height, series, views in (
                ("Reading", 300, [measured, *models], fits),
                ("Residual", 200, models, residuals),
            )
        ]
    }


def _view(run: Curves, *curves: Array) -> Chart:
    """Curves over time, which break where samples are missing, and the stretch that is shown first."""
    time, *values = with_breaks(run.time, *curves)
    shown = view(run.label, rounded(time, 6), *(rounded(one, 5) for one in values), run=run.id)
    return shown | {"range": list(run.differ)}
