"""Figures of campaigns and estimates. matplotlib is imported inside the functions.

Every function returns a figure and writes nothing; ``save`` writes one completely or not at all. The colours are
those of Okabe and Ito (2008), which colour-blind readers can distinguish.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from identification.printing.numbers import SYMBOLS, unit
from tunnel_lab.plotting.common import figure, figure_text, grid, styled
from tunnel_sim.files.writing import write_encoded
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from identification.estimate import Estimate, Quantity

BLUE, ORANGE, GREEN, VERMILION, PURPLE, SKY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
MARKERS = ("o", "s", "^", "D", "v", "P")
WIND_OFF, WIND_ON = BLUE, VERMILION
PANELS_PER_PAGE = 12
BINS_PER_DECADE = 60
ONE_RIG = 1.5
"""Frequencies within this factor share one plot in absolute units."""
RUNS_PER_PLOT = 6
"""More lines than colours cannot be distinguished in one plot."""


@styled
def save(figure: Figure, path: Path) -> Path:
    """Write a figure as a PNG, completely or not at all.

    Args:
        path: the file; replaced when it exists.

    Raises:
        TunnelError: when the file cannot be written.
    """
    return write_encoded(path, lambda stream: figure.savefig(stream, format="png", dpi=150))


def run_label(run: Run) -> str:
    """The conditions of a run in a few words, for a figure.

    Returns:
        Text such as ``r02 · 16.12 N m/rad · 15 m/s``.
    """
    parts = [figure_text(run.id)]
    if run.spring_stiffness is not None:
        parts.append(f"{run.spring_stiffness:g} N m/rad")
    if run.wind_on:
        parts.append(f"{run.wind_speed:g} m/s")
    elif run.spring_stiffness is not None:
        parts.append("wind off")
    return " · ".join(parts)


@styled
def trace_pages(campaign: Campaign) -> tuple[Figure, ...]:
    """Angle against time, one panel for each run.

    Returns:
        Figures of up to twelve panels, in the campaign's order.
    """
    pages = range(0, len(campaign.runs), PANELS_PER_PAGE)
    return tuple(_trace_page(campaign.runs[i : i + PANELS_PER_PAGE]) for i in pages)


def _trace_page(runs: Sequence[Run]) -> Figure:
    columns = 1 if len(runs) <= 3 else 2 if len(runs) <= 6 else 3
    rows = ceil(len(runs) / columns)
    fig = figure(4.2 * columns if columns > 1 else 8.0, 2.1 * rows + 0.6)
    for place, run in enumerate(runs, 1):
        axes = fig.add_subplot(rows, columns, place)
        colour = WIND_ON if run.wind_on else WIND_OFF
        axes.plot(run.record.time_s, run.record.yaw_rad, color=colour, linewidth=0.7)
        axes.set_title(run_label(run), fontsize=9)
        axes.margins(x=0.01)
        grid(axes)
        if (place - 1) % columns == 0:
            axes.set_ylabel("angle β [rad]")
        if place > len(runs) - columns:
            axes.set_xlabel("time [s]")
    return fig


@styled
def wind_off_on_figure(off: Run, on: Run) -> Figure:
    """One run with the wind off above one with the wind on, on the same axes.

    Args:
        on: the wind-on run, preferably with the same spring.
    """
    fig = figure(8.0, 5.0)
    first: Axes | None = None
    for place, (run, colour) in enumerate(((off, WIND_OFF), (on, WIND_ON)), 1):
        axes = fig.add_subplot(2, 1, place, sharex=first, sharey=first)
        axes.plot(run.record.time_s, run.record.yaw_rad, color=colour, linewidth=0.8)
        axes.set_title(run_label(run), fontsize=10)
        axes.set_ylabel("angle β [rad]")
        axes.margins(x=0.01)
        grid(axes)
        first = first or axes
    axes.set_xlabel("time since the start of the record [s]")
    return fig


@styled
def spectrum_figure(runs: Sequence[Run]) -> Figure:
    """Power spectral density of the angle, averaged over sixtieths of a decade to reduce the noise.

    Args:
        runs: up to six runs, one line each.

    Returns:
        A figure of one panel with logarithmic axes, rad²/Hz against Hz.
    """
    from scipy.signal import periodogram

    fig = figure(8.0, 4.6)
    axes = fig.add_subplot()
    top = 0.0
    for run, colour in zip(runs[:RUNS_PER_PLOT], COLOURS, strict=False):
        frequency, density = _log_averaged(
            *periodogram(run.record.yaw_rad, run.record.sample_rate, window="hann", detrend="constant")
        )
        axes.loglog(frequency, density, color=colour, linewidth=1.1, label=run_label(run))
        top = max(top, float(density.max()))
    axes.set_ylim(None, 100.0 * top)  # room for the legend
    axes.margins(x=0.01)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("power spectral density of β [rad²/Hz]")
    axes.legend(loc="upper right", fontsize=9)
    grid(axes)
    return fig


@styled
def windows_figure(estimate: Estimate) -> Figure:
    """ζ and ωn of the windows of each run against the amplitude, with 95 % intervals.

    A linear rig gives horizontal lines; a slope shows an effect that the linear model lacks.

    Args:
        estimate: of any campaign; runs past the sixth and windows without an estimate are left out.

    Returns:
        A figure of two panels; ωn is in rad/s or, where springs differ, its difference from that of the
        run's last window in %.
    """
    shown = [window.omega_n.value for run in estimate.runs[:RUNS_PER_PLOT] for window in run.windows]
    one_rig = bool(shown) and max(shown) < ONE_RIG * min(shown)
    fig = figure(10.0, 4.4)
    damping, frequency = fig.add_subplot(1, 2, 1), fig.add_subplot(1, 2, 2)
    for index, run in enumerate(estimate.runs[:RUNS_PER_PLOT]):
        if not run.windows:
            continue
        style = {"color": COLOURS[index], "marker": MARKERS[index], "label": figure_text(run.id)}
        amplitude = [window.amplitude.value for window in run.windows]
        omega_n = [window.omega_n for window in run.windows]
        _intervals(damping, amplitude, [window.zeta for window in run.windows], style)
        _intervals(frequency, amplitude, omega_n if one_rig else _relative(omega_n), style)
    damping.set_ylabel("damping ratio ζ [1]")
    frequency.set_ylabel(
        "natural frequency ωn [rad/s]" if one_rig else "ωn against the run's last window [%]"
    )
    for axes in (damping, frequency):
        axes.set_xlabel("mean amplitude of the window [rad]")
        grid(axes)
    handles, labels = damping.get_legend_handles_labels()
    if handles:
        fig.legend(handles, labels, loc="outside upper center", ncols=len(handles), fontsize=9)
    return fig


@styled
def truth_figure(estimates: Sequence[Estimate], truth: Mapping[str, float]) -> Figure:
    """Estimates of each estimator against the injected values.

    Args:
        truth: injected values by name, all nonzero, each in the unit of the estimate's quantity of that
            name.

    Returns:
        A figure with a panel for each quantity: relative error with 95 % intervals, %.
    """
    from identification.estimate import UNITS

    fig = figure(10.0, 3.6)
    names = tuple(truth)
    for place, name in enumerate(names, 1):
        axes = fig.add_subplot(1, len(names), place)
        axes.axhline(0.0, color="black", linewidth=1.0)
        for index, estimate in enumerate(estimates):
            quantity: Quantity | None = getattr(estimate, name)
            if quantity is not None:
                scale = 100.0 / abs(truth[name])
                axes.errorbar(
                    [index],
                    [scale * (quantity.value - truth[name])],
                    yerr=[1.96 * scale * quantity.std],
                    color=COLOURS[index % len(COLOURS)],
                    marker=MARKERS[index % len(MARKERS)],
                    markersize=7,
                    capsize=5,
                )
        axes.set_xticks(
            range(len(estimates)), [e.estimator.replace("_", "\n") for e in estimates], fontsize=8
        )
        axes.set_xlim(-0.6, len(estimates) - 0.4)
        axes.set_title(f"{SYMBOLS[name]} = {truth[name]:g} {unit(UNITS[name])}", fontsize=10)
        if place == 1:
            axes.set_ylabel("estimate − truth [% of truth]")
        grid(axes)
    return fig


def _relative(quantities: Sequence[Quantity]) -> list[Quantity]:
    """Each as its difference from the last, %."""
    from identification.estimate import Quantity

    last = quantities[-1].value
    return [Quantity(100.0 * (q.value / last - 1.0), 100.0 * q.std / last, "%") for q in quantities]


def _log_averaged(frequency: Array, density: Array) -> tuple[Array, Array]:
    """Means of a spectrum over bins of equal ratio, without the zero frequency."""
    decades = np.log10(frequency[-1] / frequency[1])
    edges = np.geomspace(1.0, frequency.size, max(2, int(BINS_PER_DECADE * decades)))
    starts = np.unique(edges.astype(int))[:-1]
    counts = np.diff(np.append(starts, frequency.size))
    return np.add.reduceat(frequency, starts) / counts, np.add.reduceat(density, starts) / counts


def _intervals(
    axes: Axes, x: Sequence[float], quantities: Sequence[Quantity], style: Mapping[str, str]
) -> None:
    """Points with 95 % intervals."""
    axes.errorbar(
        x,
        [q.value for q in quantities],
        yerr=[1.96 * q.std for q in quantities],
        linewidth=0.9,
        markersize=4.5,
        capsize=2.5,
        color=style["color"],
        marker=style["marker"],
        label=style["label"],
    )
