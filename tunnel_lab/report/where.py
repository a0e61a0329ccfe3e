"""The place of the gap, and the fit over the data: figures, and the charts that replace them on a screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from diagnosis.findings.misfit import misfit_scale, run_labels
from diagnosis.findings.whole import Findings
from identification.printing import Document
from identification.show.drawing import (
    AFTER,
    BEFORE,
    MARK,
    NARROW,
    NOISE,
    QUIET,
    SIGMAS,
    array,
    colour_bar,
    faded,
)
from identification.show.numbers import unit_shown
from identification.show.style import INTERVAL, WIDTH, figure, figure_text, grid, styled, with_breaks
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


TIME = "time since the start of the record [s]"
_ANGLE, _RATE = "angle β [°]", "rate β̇/ω [°]"
Chart = dict[str, Any]
_LEAST_POWER = 0.3  # of the noise: smaller values are drawn at the edge of the axis
PLACE_HEIGHT = 2.7
"""Height of the map of where the gap is, inches."""
_COLUMNS = 2  # runs in a figure
_HEIGHT = 5.4  # inches
_SHEETS = {
    "fit": _HEIGHT, "fit-whole-2": 4.9, "fit-whole-3": 4.4, "fit-whole-4": 4.0,
    "fit-near-1": 3.6, "fit-near-2": 3.2, "fit-near-3": 2.8, "fit-near-4": 2.5, "fit-near-5": 2.25,
}  # fmt: skip
"""Heights in inches; ``near`` leaves the whole record out."""
_MEASURED, _NOMINAL, _CAUSES = "measured", "nominal model", "with the causes"


@styled
def place_figure(answer: Findings, height: float = PLACE_HEIGHT) -> Figure | None:
    """Misfit by amplitude and by wind speed, or by time where there is one speed; None where the maps lack it.

    Cells within the noise are empty.

    Args:
        height: of the figure, inches; small enough for a phone.
    """
    grid_of = answer.figure_data.get("grid")
    if grid_of is None:
        return None
    unit, size = misfit_scale(answer)
    excess, std = (np.stack([array(row) for row in grid_of[name]]) for name in ("excess", "std"))
    rows = np.degrees(array(grid_of["amplitude_edges_rad"]))
    speeds = grid_of["wind_speeds"]
    columns = np.arange(len(speeds) + 1) - 0.5 if speeds else array(grid_of["time_edges_s"])
    cells = np.vectorize(size, otypes=[float])(np.nan_to_num(excess))
    shown = np.where(excess > SIGMAS * std, cells, np.nan)
    fig = figure(NARROW, height)
    axes = fig.add_subplot()
    top = float(np.nanmax(shown)) if np.isfinite(shown).any() else 1.0
    mesh = axes.pcolormesh(columns, rows, shown, cmap=faded(BEFORE), vmin=0.0, vmax=top)
    if speeds:
        axes.set_xticks(range(len(speeds)), [f"{speed:g}" if speed else "off" for speed in speeds])
    axes.set(xlabel="wind speed [m/s]" if speeds else TIME, ylabel="amplitude [°]")
    axes.set(xlim=(columns[0], columns[-1]), ylim=(0.0, rows[-1]))
    colour_bar(fig, mesh, axes, label=f"root mean square misfit [{unit}]")
    return fig


@styled
def runs_figure(answer: Findings) -> Figure:
    """Excess of every run over time on a logarithmic scale; cells within the noise are empty."""
    from matplotlib.colors import LogNorm

    maps = answer.figure_data
    runs = maps["runs"]
    fig = figure(NARROW, 1.4 + 0.24 * max(len(runs), 4))
    axes = fig.add_subplot()
    first, *_, last = maps["time"]["edges_s"]
    cells, floor, top = _run_cells(maps)
    image = axes.imshow(
        cells, aspect="auto", extent=(first, last, len(runs) - 0.5, -0.5), cmap=faded(BEFORE),
        norm=LogNorm(floor, top), interpolation="nearest",
    )  # fmt: skip
    if not np.isfinite(cells).any():
        axes.text(0.5, 0.5, "every cell within the noise", transform=axes.transAxes, ha="center")
    axes.set_yticks(range(len(runs)), [*map(figure_text, run_labels(maps))])
    axes.set_xlabel(TIME)
    colour_bar(fig, image, axes, location="top", label="excess (noise variances)", aspect=50)
    return fig


def _run_cells(maps: Document) -> tuple[Array, float, float]:
    """Excess by run and bin of time, shape (runs, n), NaN within the noise; and the limits of its scale."""
    cells = np.stack([array(row) for row in maps["time"]["by_run"]])
    times = array(maps["time"]["edges_s"])
    run = min(maps["runs"], key=lambda entry: entry["std"])
    floor = SIGMAS * float(run["std"] * np.sqrt(times.size - 1))
    known = cells[np.isfinite(cells)]
    return np.where(cells > floor, cells, np.nan), floor, max(float(known.max(initial=0.0)), 2.0 * floor)


@styled
def profiles_figure(answer: Findings) -> Figure:
    """Excess over time and amplitude, all runs together, and the times at which a moment is missing.

    The shaded intervals contain four fifths of the gap.
    """
    maps, where = answer.figure_data, answer.where
    swings = None if where.amplitude_rad is None else np.degrees(where.amplitude_rad).tolist()
    fig = figure(NARROW, 6.0)
    by_time, moment, by_amplitude = fig.subplots(3, 1, height_ratios=(1.3, 0.8, 1.3))
    for axes, values, bounds, interval in (
        (by_time, maps["time"], array(maps["time"]["edges_s"]), where.time_s),
        (by_amplitude, maps["amplitude"], np.degrees(array(maps["amplitude"]["edges_rad"])), swings),
    ):
        mean, std = array(values["excess"]), array(values["std"])
        if interval is not None:
            axes.axvspan(*interval, color=MARK, alpha=0.28, linewidth=0)
        axes.stairs(SIGMAS * std, bounds, baseline=-SIGMAS * std, fill=True, color=NOISE)
        axes.stairs(mean, bounds, color=BEFORE, linewidth=1.4)
        axes.set(xlim=(0.0, bounds[-1]), ylabel="excess (noise variances)")
        axes.set_ylim(min(-4.0 * float(np.nanmedian(std)), 1.05 * float(np.nanmin(mean))), None)
        grid(axes)
    by_time.tick_params(labelbottom=False)
    # The missing moment's energy shows when a moment acts, not the duration of the motion after it.
    edges, share = array(maps["time"]["edges_s"]), 100.0 * array(maps["time"]["moment_share"])
    moment.stairs(share, edges, fill=True, color=AFTER, alpha=0.6)
    moment.set(xlim=(0.0, edges[-1]), ylim=(0.0, 1.05 * max(float(share.max()), 20.0)))
    moment.set(xlabel=TIME, ylabel="missing moment\n[% of its energy]")
    grid(moment)
    by_amplitude.set_xlabel("amplitude of the motion [°]")
    return fig


@styled
def spectrum_figure(answer: Findings) -> Figure:
    """Residual power over frequency, all runs together, before and after, on logarithmic axes.

    The shaded interval contains four fifths of the gap.
    """
    values, interval = answer.figure_data["frequency"], answer.where.frequency_hz
    fig = figure(NARROW, 3.0)
    axes = fig.add_subplot()
    edges, centre = _spectrum_axis(values)
    known = np.isfinite(array(values["excess"]))
    centre, noise = centre[known], SIGMAS * array(values["std"])[known]
    if interval is not None:
        axes.axvspan(*interval, color=MARK, alpha=0.28, linewidth=0)
    low, high = values["resonance_hz"]
    axes.axvspan(0.985 * low, 1.015 * high, ymax=0.035, color=QUIET, linewidth=0)
    floor = np.maximum(1.0 - noise, _LEAST_POWER)
    axes.fill_between(centre, floor, 1.0 + noise, color=NOISE, linewidth=0, label="noise (3σ)")
    before = np.maximum((array(values["excess"]) + 1.0)[known], _LEAST_POWER)
    axes.plot(centre, before, color=BEFORE, label="nominal model")
    if values["after"] is not None:
        after = np.maximum((array(values["after"]) + 1.0)[known], _LEAST_POWER)
        axes.plot(centre, after, color=AFTER, lw=1.2, label="with the causes")
    axes.set(xscale="log", yscale="log", xlim=(edges[0], edges[-1]), ylabel="residual power over noise")
    axes.set_xlabel("frequency [Hz]; dark bar: the natural frequencies of the runs")
    axes.legend(loc="upper right")
    grid(axes)
    return fig


def _spectrum_axis(values: Document) -> tuple[Array, Array]:
    """Edges of the bins for a logarithmic scale, the first half the second instead of zero; and centres, Hz."""
    edges = array(values["edges_hz"])
    positive = np.concatenate([[0.5 * edges[1]], edges[1:]])
    return positive, np.sqrt(positive[:-1] * positive[1:])


@styled
def phase_plane_figure(answer: Findings) -> Figure | None:
    """The missing moment over angle and rate; None where the maps lack it."""
    plane = answer.figure_data["phase_plane"]
    if plane is None:
        return None
    low, *_, high = np.degrees(plane["edges_rad"]).tolist()
    clear, reach, unit, _ = _plane_cells(plane)
    fig = figure(NARROW, 4.4)
    axes = fig.add_subplot()
    image = axes.imshow(
        clear, origin="lower", extent=(low, high, low, high), cmap=faded(AFTER, BEFORE),
        vmin=-reach, vmax=reach, interpolation="nearest",
    )  # fmt: skip
    axes.set(xlabel=_ANGLE, ylabel=_RATE)
    colour_bar(fig, image, axes, location="top", label=f"missing moment [{unit}]", shrink=0.9, aspect=40)
    return fig


@styled
def moment_figure(answer: Findings) -> Figure | None:
    """Means of the missing moment over all rates and over all angles; None where the maps lack it."""
    plane = answer.figure_data["phase_plane"]
    if plane is None:
        return None
    edges = np.degrees(array(plane["edges_rad"]))
    _, _, unit, factor = _plane_cells(plane)
    fig = figure(NARROW, 5.0)
    centre = 0.5 * (edges[1:] + edges[:-1])
    for axes, name, label in zip(fig.subplots(2, 1), ("by_angle", "by_rate"), (_ANGLE, _RATE), strict=True):
        mean, band = factor * array(plane[name]), INTERVAL * (factor * array(plane[f"{name}_std"]))
        axes.axhline(0.0, color=QUIET, linewidth=0.8)
        axes.fill_between(centre, mean - band, mean + band, color=BEFORE, alpha=0.2, lw=0)
        axes.plot(centre, mean, color=BEFORE, marker="o", ms=3)
        others = "rates" if name == "by_angle" else "angles"
        axes.set(xlabel=label, ylabel=f"mean over all {others} [{unit}]")
        grid(axes)
    return fig


def _plane_cells(plane: Document) -> tuple[Array, float, str, float]:
    """The missing moment by rate (rows) and angle (columns), NaN within three standard deviations of zero.

    Also the greatest value of its scale, a unit that suits the size of the values, and the factor from the
    document's unit to it.
    """
    moment = np.stack([array(row) for row in plane["moment"]])
    std = np.stack([array(row) for row in plane["std"]])
    known = np.abs(moment[np.isfinite(moment)])
    unit, factor = plane["unit"].replace("rad/s2", "rad/s²"), 1.0
    if known.size and known.max() < 0.1:
        unit, factor = f"10⁻³ {unit}", 1e3
    reach = float(np.quantile(known, 0.98)) * factor if known.size else 1.0
    return np.where(np.abs(moment) > SIGMAS * std, moment * factor, np.nan), reach, unit, factor


def charts(answer: Findings) -> dict[str, list[Chart]]:
    """The charts of a diagnosis by the name of the figure that they replace on a screen; none without ``maps``."""
    maps = answer.maps
    if not maps:
        return {}
    cells, low, high = _run_cells(maps)
    labels = run_labels(maps)
    ids = [str(run["id"]) for run in maps["runs"]]
    runs = {
        "kind": "cells",
        "title": "Excess of every run over time",
        "x": {"label": TIME, "edges": maps["time"]["edges_s"]},
        "y": {"label": "run", "edges": np.arange(len(ids) + 1).tolist(), "names": ids},
        "labels": labels,
        "values": [_rounded(row) for row in cells],
        "unit": "noise variances",
        "range": [low, high],
        "log": True,
    }
    given = maps["frequency"]
    centre = _spectrum_axis(given)[1]
    none = np.full(centre.size, np.nan)
    excess, std = array(given["excess"]), SIGMAS * array(given["std"])
    after = none if given["after"] is None else array(given["after"])
    views = [_filled("all runs together", centre, -std, std, excess, after)]
    for run, label, by_bin in zip(maps["runs"], labels, given.get("by_run", []), strict=False):
        views.append(_filled(label, centre, none, none, array(by_bin), none, run=run["id"]))
    spectrum = {
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
    by_figure: dict[str, list[Chart]] = {"where-runs": [runs], "where-spectrum": [spectrum]}
    plane = maps["phase_plane"]
    if plane is not None:
        cells, reach, unit, _ = _plane_cells(plane)
        edges = np.degrees(plane["edges_rad"]).tolist()
        missing = {
            "kind": "cells",
            "title": "Missing moment",
            "x": {"label": _ANGLE, "edges": edges},
            "y": {"label": _RATE, "edges": edges},
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
    power = (_rounded(np.maximum(1.0 + excess[filled], _LEAST_POWER)) for excess in excesses)
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


def fitted_runs(answer: Findings, ids: Sequence[str] = ()) -> list[Curves]:
    """The runs of a diagnosis against time, by ids or all, the largest gap first; none without ``maps``."""
    maps = answer.figure_data or {"runs": [], "traces": []}
    unit, factor = unit_shown(maps.get("unit", "rad"))
    labels = {run["id"]: label for run, label in zip(maps["runs"], run_labels(maps), strict=True)}
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


def fit_sheets(answer: Findings) -> dict[str, Figure]:
    """The fit over the data of the two runs with the largest gap, in several heights to fill a printed page.

    The highest comes first; lower ones omit the whole record and show the cycles where the models differ most.
    """
    runs = fitted_runs(answer)[:_COLUMNS]
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
                "x": {"label": TIME, "log": False},
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
    """Curves over time, broken where samples are missing, and the interval shown first."""
    time, *values = with_breaks(run.time, *curves)
    data = [_rounded(time, 6), *(_rounded(one, 5) for one in values)]
    return {"label": run.label, "run": run.id, "data": data, "range": list(run.differ)}
