"""Data of the charts that the page draws itself, with zoom, hover and a choice of runs; nothing is computed here.

A chart is ``lines`` (curves against a common axis, in several views) or ``cells`` (a map of coloured cells).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tunnel_lab.diagnosis_view.figures_common import SIGMAS, array, run_label
from tunnel_lab.diagnosis_view.figures_where import plane_cells, run_cells, spectrum_axis
from tunnel_lab.plotting.common import with_breaks
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array

Document = Mapping[str, Any]
Chart = dict[str, Any]
_POINTS = 1000  # of a reading: more than a screen shows
_LEAST_POWER = 0.3  # of the noise: what is below is drawn at the edge of the axis
_ALL = "all runs together"


def charts(document: Document, campaign: Campaign) -> dict[str, list[Chart]]:
    """The charts of a diagnosis.

    Args:
        document: the diagnosis as JSON's types; without ``maps`` there are none.

    Returns:
        Charts by the name of the figure that they replace on a screen.
    """
    maps = document.get("maps")
    if not maps:
        return {}
    found = {"where-runs": [_runs(maps)], "where-spectrum": [_spectrum(maps)]}
    if maps["phase_plane"] is not None:
        found["where-phase-plane"] = [_plane(maps["phase_plane"])]
    if traces := _traces(maps, campaign):
        found["residuals"] = traces
    return found


def _runs(maps: Document) -> Chart:
    cells, low, high = run_cells(maps)
    ids = [str(run["id"]) for run in maps["runs"]]
    return {
        "kind": "cells",
        "title": "Excess of every run over time",
        "x": {"label": "time since the start of the record [s]", "edges": maps["time"]["edges_s"]},
        "y": {"label": "run", "edges": np.arange(len(ids) + 1).tolist(), "names": ids},
        "labels": [run_label(run) for run in maps["runs"]],
        "values": [_rounded(row) for row in cells],
        "unit": "noise variances",
        "range": [low, high],
        "log": True,
    }


def _plane(plane: Document) -> Chart:
    cells, reach, unit, _ = plane_cells(plane)
    edges = plane["edges_rad"]
    return {
        "kind": "cells",
        "title": "Missing moment",
        "x": {"label": "angle β [rad]", "edges": edges},
        "y": {"label": "rate β̇/ω [rad]", "edges": edges},
        "values": [_rounded(row) for row in cells],
        "unit": unit,
        "range": [-reach, reach],
        "log": False,
    }


def _spectrum(maps: Document) -> Chart:
    given = maps["frequency"]
    centre = spectrum_axis(given)[1]
    nothing = np.full(centre.size, np.nan)
    excess, std = array(given["excess"]), SIGMAS * array(given["std"])
    after = nothing if given["after"] is None else array(given["after"])
    views = [_filled(_ALL, centre, -std, std, excess, after)]
    for run, own in zip(maps["runs"], given.get("by_run", []), strict=False):
        views.append(_filled(run_label(run), centre, nothing, nothing, array(own), nothing, run=run["id"]))
    return {
        "kind": "lines",
        "title": "Residual power over noise against frequency",
        "x": {"label": "frequency [Hz]", "log": True},
        "y": {"label": "residual power over noise", "log": True},
        "series": [
            {"label": "noise −3σ", "role": "quiet"},
            {"label": "noise +3σ", "role": "quiet"},
            {"label": "nominal model", "role": "before"},
            {"label": "with the causes", "role": "after"},
        ],
        "band": [2, 1],
        "views": views,
    }


def _filled(label: str, centre: Array, *excesses: Array, run: str = "") -> Chart:
    """A view of the bins that hold a value; the others are empty, and a null there would break the curves."""
    filled = np.any(np.isfinite(excesses), axis=0)
    power = (_rounded(np.maximum(1.0 + excess[filled], _LEAST_POWER)) for excess in excesses)
    return _view(label, _rounded(centre[filled]), *power, run=run)


def _traces(maps: Document, campaign: Campaign) -> list[Chart]:
    """The reading and, below it on the same axis of time, the residuals."""
    labels = {run["id"]: run_label(run) for run in maps["runs"]}
    records = {run.id: run.record for run in campaign.runs}
    readings, residuals = [], []
    for trace in maps["traces"]:
        if trace["id"] not in records:
            continue
        name, label = trace["id"], labels.get(trace["id"], str(trace["id"]))
        record = records[name]
        thin = slice(None, None, max(1, record.yaw_rad.size // _POINTS))
        readings.append(
            _broken(label, record.time_s[thin] - record.time_s[0], record.yaw_rad[thin], run=name)
        )
        before = 1e3 * array(trace["before_rad"])
        after = (
            np.full(before.size, np.nan) if trace["after_rad"] is None else 1e3 * array(trace["after_rad"])
        )
        residuals.append(_broken(label, array(trace["time_s"]), before, after, run=name))
    if not readings:
        return []
    unit = campaign.sensor.unit
    time_axis = {"label": "time since the start of the record [s]", "log": False}
    series = [{"label": "nominal model", "role": "before"}, {"label": "with the causes", "role": "after"}]
    return [
        _lines("Reading", time_axis, unit, [{"label": "reading", "role": "soft"}], readings),
        _lines("Residual", time_axis, f"10⁻³ {unit}", series, residuals),
    ]


def _lines(title: str, x: Chart, unit: str, series: list[Chart], views: list[Chart]) -> Chart:
    y = {"label": f"{title.lower()} [{unit}]", "log": False}
    return {"kind": "lines", "title": title, "x": x, "y": y, "series": series, "views": views}


def _view(label: str, *data: Sequence[float | None], run: str = "") -> Chart:
    return {"label": label, "run": run, "data": list(data)}


def _broken(label: str, time: Array, *curves: Array, run: str) -> Chart:
    """A view of curves over time, which break where samples are missing."""
    when, *values = with_breaks(time, *curves)
    return _view(label, _rounded(when, 6), *map(_rounded, values), run=run)


def _rounded(values: Array, digits: int = 4) -> list[float | None]:
    """Numbers for JSON, as many digits as a screen shows; null where a value is not known."""
    return [float(f"{v:.{digits}g}") if np.isfinite(v) else None for v in np.ravel(values).tolist()]
