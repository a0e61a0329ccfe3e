"""Figures of the place of a gap: maps and profiles of the misfit, backbones and the missing moment."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from diagnosis.findings.misfit import Misfit, run_labels
from diagnosis.where.along_motion import PhasePlane
from diagnosis.where.described import Where
from diagnosis.where.maps import ExcessMap, ExcessSpectrum, Maps
from identification.show.drawing import (
    AFTER,
    BEFORE,
    INK,
    MARK,
    NARROW,
    NOISE,
    QUIET,
    SIGMAS,
    colour_bar,
    faded,
)
from identification.show.numbers import motion_shown, unit_mark
from identification.show.quantity import INTERVAL
from identification.show.style import (
    COLOURS,
    MARKERS,
    figure,
    figure_text,
    grid,
    limit_to_known,
    log_axis,
    styled,
)
from tunnel_sim.vocabulary.columns import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


TIME = "time since the start of the record [s]"
LEAST_POWER = 0.3  # excess in noise variances: smaller values are drawn at the edge of the axis
ANGLE, RATE = "angle β [{}]", "rate β̇/ω [{}]"
_MOST_CURVES = len(COLOURS)
_LONG = 30  # characters in a label
_LEGEND, _HANDLE = 62, 8  # characters: the width of the figure, and the line beside a label


@styled
def place_figure(cells: ExcessMap, misfit: Misfit) -> Figure:
    """Misfit by amplitude and by wind speed, or by amplitude and time if the runs have one speed.

    Cells within the noise are empty. The figure is small enough for a phone.
    """
    unit, size = misfit.scale()
    mark, per_si = motion_shown(misfit.unit)
    rows = per_si * cells.amplitude_edges_rad
    speeds = [] if cells.wind_speeds is None else cells.wind_speeds.tolist()
    columns = np.arange(len(speeds) + 1) - 0.5 if cells.time_edges_s is None else cells.time_edges_s
    sizes = np.vectorize(size, otypes=[float])(np.nan_to_num(cells.excess))
    shown = np.where(cells.excess > SIGMAS * cells.std, sizes, np.nan)
    fig = figure(NARROW, 2.7)
    axes = fig.add_subplot()
    top = float(np.nanmax(shown)) if np.isfinite(shown).any() else 1.0
    mesh = axes.pcolormesh(columns, rows, shown, cmap=faded(BEFORE), vmin=0.0, vmax=top)
    if speeds:
        axes.set_xticks(range(len(speeds)), [f"{speed:g}" if speed else "off" for speed in speeds])
    axes.set(xlabel="wind speed [m/s]" if speeds else TIME, ylabel=f"amplitude [{mark}]")
    axes.set(xlim=(columns[0], columns[-1]), ylim=(0.0, rows[-1]))
    colour_bar(fig, mesh, axes, label=f"root mean square misfit [{unit}]")
    return fig


@styled
def runs_figure(maps: Maps) -> Figure:
    """Excess of every run over time on a logarithmic scale; cells within the noise are empty."""
    from matplotlib.colors import LogNorm

    runs = maps.runs
    fig = figure(NARROW, 1.4 + 0.24 * max(len(runs), 4))
    axes = fig.add_subplot()
    first, *_, last = maps.time.edges_s.tolist()
    cells, floor, top = run_cells(maps)
    image = axes.imshow(
        cells, aspect="auto", extent=(first, last, len(runs) - 0.5, -0.5), cmap=faded(BEFORE),
        norm=LogNorm(floor, top), interpolation="nearest",
    )  # fmt: skip
    if not np.isfinite(cells).any():
        axes.text(0.5, 0.5, "every cell within the noise", transform=axes.transAxes, ha="center")
    axes.set_yticks(range(len(runs)), [*map(figure_text, run_labels(runs))])
    axes.set_xlabel(TIME, loc="right")  # below long names of runs too, as the axis may be shorter
    colour_bar(fig, image, axes, location="top", label="excess (noise variances)", aspect=50)
    return fig


def run_cells(maps: Maps) -> tuple[Array, float, float]:
    """Excess by run and bin of time, shape (runs, n), NaN within the noise; and the limits of its scale."""
    cells, times = maps.time.by_run, maps.time.edges_s
    floor = SIGMAS * float(min(run.std for run in maps.runs) * np.sqrt(times.size - 1))
    known = cells[np.isfinite(cells)]
    return np.where(cells > floor, cells, np.nan), floor, max(float(known.max(initial=0.0)), 2.0 * floor)


@styled
def profiles_figure(where: Where, maps: Maps) -> Figure:
    """Excess over time and amplitude, all runs together, and the times at which a moment is missing.

    The shaded intervals contain 80 % of the gap.
    """
    mark, per_si = motion_shown(maps.unit)
    swings = None if where.amplitude_rad is None else [per_si * end for end in where.amplitude_rad]
    fig = figure(NARROW, 6.0)
    by_time, moment, by_amplitude = fig.subplots(3, 1, height_ratios=(1.3, 0.8, 1.3))
    for axes, values, bounds, interval in (
        (by_time, maps.time, maps.time.edges_s, where.time_s),
        (by_amplitude, maps.amplitude, per_si * maps.amplitude.edges_rad, swings),
    ):
        mean, std = values.excess, values.std
        if interval is not None:
            axes.axvspan(*interval, color=MARK, alpha=0.28, linewidth=0)
        axes.stairs(SIGMAS * std, bounds, baseline=-SIGMAS * std, fill=True, color=NOISE)
        axes.stairs(mean, bounds, color=BEFORE, linewidth=1.4)
        axes.set(xlim=(0.0, bounds[-1]), ylabel="excess (noise variances)")
        axes.set_ylim(min(-4.0 * float(np.nanmedian(std)), 1.05 * float(np.nanmin(mean))), None)
        grid(axes)
    by_time.tick_params(labelbottom=False)
    # The energy of the missing moment shows when a moment acts; the misfit lasts as long as the motion after
    # it.
    edges, share = maps.time.edges_s, 100.0 * maps.time.moment_share
    moment.stairs(share, edges, fill=True, color=AFTER, alpha=0.6)
    moment.set(xlim=(0.0, edges[-1]), ylim=(0.0, 1.05 * max(float(share.max()), 20.0)))
    moment.set(xlabel=TIME, ylabel="missing moment\n[% of its energy]")
    grid(moment)
    by_amplitude.set_xlabel(f"amplitude of the motion [{mark}]")
    return fig


@styled
def spectrum_figure(where: Where, given: ExcessSpectrum) -> Figure:
    """Residual power over frequency, all runs together, before and after, on logarithmic axes.

    The shaded interval contains 80 % of the gap.
    """
    interval = where.frequency_hz
    fig = figure(NARROW, 3.0)
    axes = fig.add_subplot()
    edges, centre = spectrum_axis(given)
    known = np.isfinite(given.excess)
    centre, noise = centre[known], SIGMAS * given.std[known]
    if interval is not None:
        axes.axvspan(*interval, color=MARK, alpha=0.28, linewidth=0)
    low, high = given.resonance_hz
    axes.axvspan(0.985 * low, 1.015 * high, ymax=0.035, color=QUIET, linewidth=0)
    floor = np.maximum(1.0 - noise, LEAST_POWER)
    axes.fill_between(centre, floor, 1.0 + noise, color=NOISE, linewidth=0, label="noise (3σ)")
    before = np.maximum((given.excess + 1.0)[known], LEAST_POWER)
    axes.plot(centre, before, color=BEFORE, label="nominal model")
    if given.after is not None:
        after = np.maximum((given.after + 1.0)[known], LEAST_POWER)
        axes.plot(centre, after, color=AFTER, lw=1.2, label="with the causes")
    axes.set(xscale="log", yscale="log", xlim=(edges[0], edges[-1]), ylabel="residual power over noise")
    axes.set_xlabel("frequency [Hz]; dark bar: the natural frequencies of the runs")
    axes.legend(loc="upper right")
    grid(axes)
    return fig


def spectrum_axis(given: ExcessSpectrum) -> tuple[Array, Array]:
    """Edges of the bins for a logarithmic scale, the first at half the second, not at zero; and centres, Hz."""
    edges = given.edges_hz
    positive = np.concatenate([[0.5 * edges[1]], edges[1:]])
    return positive, np.sqrt(positive[:-1] * positive[1:])


@styled
def phase_plane_figure(plane: PhasePlane | None, reading: str) -> Figure | None:
    """The missing moment over angle and rate; None where it is not known.

    Args:
        reading: unit of the readings.
    """
    if plane is None:
        return None
    mark, per_si = motion_shown(reading)
    low, *_, high = (per_si * plane.edges_rad).tolist()
    clear, reach, unit, _ = plane_cells(plane)
    fig = figure(NARROW, 4.4)
    axes = fig.add_subplot()
    image = axes.imshow(
        clear, origin="lower", extent=(low, high, low, high), cmap=faded(AFTER, BEFORE),
        vmin=-reach, vmax=reach, interpolation="nearest",
    )  # fmt: skip
    axes.set(xlabel=ANGLE.format(mark), ylabel=RATE.format(mark))
    colour_bar(fig, image, axes, location="top", label=f"missing moment [{unit}]", shrink=0.9, aspect=40)
    return fig


@styled
def moment_figure(plane: PhasePlane | None, reading: str) -> Figure | None:
    """Means of the missing moment over all rates and over all angles; None where it is not known.

    Args:
        reading: unit of the readings.
    """
    if plane is None:
        return None
    mark, per_si = motion_shown(reading)
    edges = per_si * plane.edges_rad
    _, _, unit, factor = plane_cells(plane)
    fig = figure(NARROW, 5.0)
    centre = 0.5 * (edges[1:] + edges[:-1])
    for axes, mean, std, label, others in zip(
        fig.subplots(2, 1),
        (plane.by_angle, plane.by_rate),
        (plane.by_angle_std, plane.by_rate_std),
        (ANGLE.format(mark), RATE.format(mark)),
        ("rates", "angles"),
        strict=True,
    ):
        mean, band = factor * mean, INTERVAL * (factor * std)
        axes.axhline(0.0, color=QUIET, linewidth=0.8)
        axes.fill_between(centre, mean - band, mean + band, color=BEFORE, alpha=0.2, lw=0)
        axes.plot(centre, mean, color=BEFORE, marker="o", ms=3)
        axes.set(xlabel=label, ylabel=f"mean over all {others} [{unit}]")
        grid(axes)
    return fig


def plane_cells(plane: PhasePlane) -> tuple[Array, float, str, float]:
    """The missing moment by rate (rows) and angle (columns), NaN within three standard deviations of zero.

    Also the greatest value of its scale, a unit that suits the size of the values, and the factor from the
    document's unit to it.
    """
    moment, std = plane.moment, plane.std
    known = np.abs(moment[np.isfinite(moment)])
    unit, factor = unit_mark(plane.unit), 1.0
    if known.size and known.max() < 0.1:
        unit, factor = f"10⁻³ {unit}", 1e3
    reach = float(np.quantile(known, 0.98)) * factor if known.size else 1.0
    return np.where(np.abs(moment) > SIGMAS * std, moment * factor, np.nan), reach, unit, factor


@styled
def backbone_figure(where: Where, maps: Maps) -> Figure:
    """Frequency and damping against amplitude, relative to the nominal model's, with 95 % bands."""
    curves = [curve for curve in maps.backbones if curve.time_s.size > 1]
    named = [curve for curve in curves if curve.id in where.runs]
    # first the runs that show the gap, in the campaign's order, then the others for comparison
    chosen = (named + [curve for curve in curves if curve not in named])[:_MOST_CURVES]
    labels = {run.id: figure_text(label) for run, label in zip(maps.runs, run_labels(maps.runs), strict=True)}
    fig = figure(NARROW, 7.0)
    mark, per_si = motion_shown(maps.unit)
    frequency, damping = fig.subplots(2, 1)
    drawn: dict[Axes, list[tuple[Array, Array]]] = {frequency: [], damping: []}
    for index, curve in enumerate(chosen):
        order = np.argsort(curve.amplitude_rad)
        x, nominal = per_si * curve.amplitude_rad[order], curve.nominal_frequency_hz
        colour, marker = COLOURS[index], MARKERS[(index + index // len(MARKERS)) % len(MARKERS)]
        shift = 100.0 * (curve.frequency_hz / nominal - 1.0)
        change = 1e3 * (curve.zeta - curve.nominal_zeta)
        for axes, y, std, label in (
            (frequency, shift, 100.0 * curve.frequency_std / nominal, None),
            (damping, change, 1e3 * curve.zeta_std, labels[curve.id]),
        ):
            drawn[axes].append((y, std))
            y, band = y[order], INTERVAL * std[order]
            axes.fill_between(x, y - band, y + band, color=colour, alpha=0.15, linewidth=0)
            axes.plot(x, y, color=colour, marker=marker, ms=3.5, lw=1.0, label=label)
    frequency.set_ylabel("frequency minus\nthe nominal one [%]")
    damping.set_ylabel("damping ratio minus\nthe nominal one [10⁻³]")
    for axes, pairs in drawn.items():
        axes.axhline(0.0, color=INK, linewidth=1.0)
        axes.set_xlabel(f"amplitude [{mark}]")
        grid(axes)
        if pairs:
            limit_to_known(axes, *(np.concatenate(column) for column in zip(*pairs, strict=True)))
            log_axis(axes, "x")
    if chosen:
        longest = max(len(labels[curve.id]) for curve in chosen)
        columns = min(3, _LEGEND // (longest + _HANDLE)) or 1
        fig.legend(loc="outside lower center", ncols=columns, fontsize="x-small" if longest > _LONG else None)
    return fig
