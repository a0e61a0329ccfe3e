"""The charts of a page, and the fit over the data: figures, and the charts that replace them on a screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from diagnosis.findings.misfit import run_labels
from diagnosis.findings.place_figures import (
    ANGLE,
    LEAST_POWER,
    RATE,
    TIME,
    plane_cells,
    run_cells,
    spectrum_axis,
)
from diagnosis.findings.whole import Findings
from identification.show.drawing import (
    AFTER,
    BEFORE,
    MARK,
    QUIET,
    SIGMAS,
)
from identification.show.numbers import unit_shown
from identification.show.style import WIDTH, figure, figure_text, grid, styled, with_breaks
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


Chart = dict[str, Any]


_COLUMNS = 2  # runs in a figure
_HEIGHT = 5.4  # inches
_LOW = 3.4  # inches: without the whole record
_MEASURED, _NOMINAL, _CAUSES = "measured", "model", "model with the causes"


def charts(answer: Findings) -> dict[str, list[Chart]]:
    """The charts of a diagnosis by the name of the figure that they replace on a screen; none without ``maps``."""
    maps = answer.maps
    if maps is None:
        return {}
    cells, low, high = run_cells(maps)
    labels = run_labels(maps.runs)
    ids = [run.id for run in maps.runs]
    runs = {
        "kind": "cells",
        "title": "Excess of every run over time",
        "x": {"label": TIME, "edges": maps.time.edges_s.tolist()},
        "y": {"label": "run", "edges": np.arange(len(ids) + 1).tolist(), "names": ids},
        "labels": labels,
        "values": [_rounded(row) for row in cells],
        "unit": "noise variances",
        "range": [low, high],
        "log": True,
    }
    given = maps.frequency
    centre = spectrum_axis(given)[1]
    none = np.full(centre.size, np.nan)
    std = SIGMAS * given.std
    after = none if given.after is None else given.after
    views = [_filled("all runs together", centre, -std, std, given.excess, after)]
    for run, label, by_bin in zip(maps.runs, labels, given.by_run, strict=True):
        views.append(_filled(label, centre, none, none, by_bin, none, run=run.id))
    spectrum = {
        "kind": "lines",
        "title": "Residual power over noise against frequency",
        "x": {"label": "frequency [Hz]", "log": True},
        "y": {"label": "residual power over noise", "log": True},
        "series": [
            {"label": "noise −3σ", "role": "quiet"},
            {"label": "noise +3σ", "role": "quiet"},
            {"label": _NOMINAL, "role": "before"},
            {"label": _CAUSES, "role": "after"},
        ],
        "band": [2, 1],
        "views": views,
    }
    by_figure: dict[str, list[Chart]] = {"where-runs": [runs], "where-spectrum": [spectrum]}
    plane = maps.phase_plane
    if plane is not None:
        cells, reach, unit, _ = plane_cells(plane)
        edges = np.degrees(plane.edges_rad).tolist()
        missing = {
            "kind": "cells",
            "title": "Missing moment",
            "x": {"label": ANGLE, "edges": edges},
            "y": {"label": RATE, "edges": edges},
            "values": [_rounded(row) for row in cells],
            "unit": unit,
            "range": [-reach, reach],
            "log": False,
        }
        by_figure["where-phase-plane"] = [missing]
    return by_figure


def _filled(label: str, centre: Array, *excesses: Array, run: str = "") -> Chart:
    """A view of the bins with a value; the others are left out, because a null would break the curves."""
    filled = np.any(np.isfinite(excesses), axis=0)
    power = (_rounded(np.maximum(1.0 + excess[filled], LEAST_POWER)) for excess in excesses)
    return {"label": label, "run": run, "data": [_rounded(centre[filled]), *power]}


def _rounded(values: Array, digits: int = 4) -> list[float | None]:
    """Numbers for JSON with the digits of a screen; null for unknown values."""
    return [float(f"{v:.{digits}g}") if np.isfinite(v) else None for v in np.ravel(values).tolist()]


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

    @property
    def residuals(self) -> tuple[Array, Array]:
        """Residuals of the nominal model and with the causes, in ``unit``, shape (n,) each."""
        return self.before, self.after


def fitted_runs(answer: Findings, ids: Sequence[str] = ()) -> list[Curves]:
    """The runs of a diagnosis against time, by ids or all, the largest gap first; none without ``maps``."""
    maps = answer.maps
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


def fit_figure(answer: Findings, ids: Sequence[str] = ()) -> Figure | None:
    """The fit over the data of the first two of `fitted_runs`; None without runs.

    A column for each run: the whole record, with the cycles marked in which the models differ most; the reading in
    these cycles with the predictions of both models; and their residuals.
    """
    runs = fitted_runs(answer, ids)[:_COLUMNS]
    return _drawn(runs) if runs else None


def fit_pages(answer: Findings, ids: Sequence[str] = ()) -> list[Figure]:
    """The fit over the data of all runs, two to a figure, as `fit_figure` draws them."""
    runs = fitted_runs(answer, ids)
    return [_drawn(runs[first : first + _COLUMNS]) for first in range(0, len(runs), _COLUMNS)]


def fit_near(answer: Findings) -> Figure | None:
    """As `fit_figure`, without the whole record; None without runs."""
    runs = fitted_runs(answer)[:_COLUMNS]
    return _drawn(runs, _LOW, whole=False) if runs else None


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
        axes.plot(*points, color=QUIET, linewidth=4.0, alpha=0.5, label=_MEASURED)
    for values, colour, label in ((before, BEFORE, _NOMINAL), (after, AFTER, _CAUSES)):
        if np.isfinite(values).any():
            points = with_breaks(run.time[shown], values[shown])
            axes.plot(*points, color=colour, linewidth=1.0, label=label)
    axes.set_xlim(*run.differ)


def fit_charts(answer: Findings) -> dict[str, list[Chart]]:
    """The readings of every run and, below them on the same axis, the residuals, under the name ``fit``.

    They first show the cycles in which the models differ most; there are none without ``maps``.
    """
    runs = fitted_runs(answer)
    if not runs:
        return {}
    named = any(np.isfinite(run.after).any() for run in runs)
    models = [{"label": _NOMINAL, "role": "before"}, *[{"label": _CAUSES, "role": "after"}] * named]
    measured = {"label": _MEASURED, "role": "quiet", "width": 6}
    fits = [
        _view(run, run.reading, *(run.reading - one for one in run.residuals[: 1 + named])) for run in runs
    ]
    residuals = [_view(run, *run.residuals[: 1 + named]) for run in runs]
    return {
        "fit": [
            {
                "kind": "lines",
                "title": title,
                "height": height,
                "x": {"label": TIME if title == "Residual" else "", "log": False},
                "y": {"label": f"{title.lower()} [{runs[0].unit}]", "log": False},
                "series": series,
                "views": views,
            }
            for title, height, series, views in (
                ("Reading", 260, [measured, *models], fits),
                ("Residual", 170, models, residuals),
            )
        ]
    }


def _view(run: Curves, *curves: Array) -> Chart:
    """Curves over time, broken where samples are missing, and the interval shown first."""
    time, *values = with_breaks(run.time, *curves)
    data = [_rounded(time, 6), *(_rounded(one, 5) for one in values)]
    return {"label": run.label, "run": run.id, "data": data, "range": list(run.differ)}
