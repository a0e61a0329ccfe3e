"""The charts of a page, which replace figures on a screen."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from diagnosis.findings.fit_view import CAUSES, MEASURED, NOMINAL, Curves, fitted_runs
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
from diagnosis.where.maps import Maps
from identification.show.drawing import (
    SIGMAS,
)
from identification.show.numbers import motion_shown
from identification.show.style import with_breaks
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    pass


Chart = dict[str, Any]


def charts(maps: Maps | None) -> dict[str, list[Chart]]:
    """The charts of a diagnosis by the name of the figure that they replace on a screen; none without ``maps``."""
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
            {"label": NOMINAL, "role": "before"},
            {"label": CAUSES, "role": "after"},
        ],
        "band": [2, 1],
        "views": views,
    }
    by_figure: dict[str, list[Chart]] = {"where-runs": [runs], "where-spectrum": [spectrum]}
    plane = maps.phase_plane
    if plane is not None:
        cells, reach, unit, _ = plane_cells(plane)
        mark, per_si = motion_shown(maps.unit)
        edges = (per_si * plane.edges_rad).tolist()
        missing = {
            "kind": "cells",
            "title": "Missing moment",
            "x": {"label": ANGLE.format(mark), "edges": edges},
            "y": {"label": RATE.format(mark), "edges": edges},
            "values": [_rounded(row) for row in cells],
            "unit": unit,
            "range": [-reach, reach],
            "log": False,
        }
        by_figure["where-phase-plane"] = [missing]
    return by_figure


def _filled(label: str, centre: Array, *excesses: Array, run: str = "") -> Chart:
    """A view of the bins with a value; empty bins are left out, because a null would break the curves."""
    filled = np.any(np.isfinite(excesses), axis=0)
    power = (_rounded(np.maximum(1.0 + excess[filled], LEAST_POWER)) for excess in excesses)
    return {"label": label, "run": run, "data": [_rounded(centre[filled]), *power]}


def _rounded(values: Array, digits: int = 4) -> list[float | None]:
    """Numbers for JSON with the digits of a screen; null for unknown values."""
    return [float(f"{v:.{digits}g}") if np.isfinite(v) else None for v in np.ravel(values).tolist()]


def fit_charts(maps: Maps | None) -> dict[str, list[Chart]]:
    """The readings of every run and, below them on the same axis, the residuals, under the name ``fit``.

    They first show the cycles in which the models differ most. Without ``maps`` there are no charts.
    """
    runs = fitted_runs(maps)
    if not runs:
        return {}
    named = any(np.isfinite(run.after).any() for run in runs)
    models = [{"label": NOMINAL, "role": "before"}, *[{"label": CAUSES, "role": "after"}] * named]
    measured = {"label": MEASURED, "role": "quiet", "width": 6}
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
