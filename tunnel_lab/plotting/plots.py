"""Figures of campaigns and estimates. matplotlib is imported inside the functions.

Every function returns a figure and writes nothing; ``save`` writes one completely or not at all. The colours follow
Okabe and Ito (2008), which colour-blind readers can distinguish.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from identification.printing.numbers import SYMBOLS
from tunnel_lab.plotting.common import WIDTH, figure, figure_text, grid, log_axis, styled, with_breaks
from tunnel_sim.files.writing import write_encoded
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from identification.estimate import Estimate

COLOURS = (
    "#0072b2", "#d55e00", "#009e73", "#b0529b", "#9a6f00", "#2f8fb0", "#b5484f", "#6f8200", "#7a63c7", "#77808a",
    "#c88090", "#207060", "#7090f0", "#989860", "#b878d8", "#805870",
)  # fmt: skip
"""Of `figures.mplstyle`."""
BLUE, VERMILION = COLOURS[:2]
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "h")
WIND_OFF, WIND_ON = BLUE, VERMILION
PANELS_PER_PAGE = 12
BINS_PER_DECADE = 60
LEAKING = 2
"""Cycles in a record below which a Hann window leaks the mean."""
INTERVAL = 1.96
RUNS_PER_PLOT = 6
"""More lines than colours cannot be distinguished in one plot."""


@styled
def save(figure: Figure, path: Path) -> Path:
    """Write a figure, completely or not at all; the same figure gives the same file.

    Args:
        path: the file, ``.png`` or ``.pdf``; replaced when it exists.

    Raises:
        TunnelError: when the file cannot be written.
    """
    form = path.suffix[1:]
    dates = {"CreationDate": None} if form == "pdf" else None
    return write_encoded(path, lambda stream: figure.savefig(stream, format=form, metadata=dates))


def save_both(figure: Figure, path: Path) -> tuple[Path, Path]:
    """Write a figure as a picture, and as a vector graphic beside it.

    Args:
        path: the picture, ``.png``.

    Returns:
        The picture and the PDF.
    """
    return save(figure, path), save(figure, path.with_suffix(".pdf"))


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
    fig = figure(WIDTH if columns < 3 else 1.4 * WIDTH, 1.8 * rows + 0.6)
    for place, run in enumerate(runs, 1):
        axes = fig.add_subplot(rows, columns, place)
        colour = WIND_ON if run.wind_on else WIND_OFF
        axes.plot(*with_breaks(run.record.time_s, run.record.yaw_rad), color=colour, linewidth=0.7)
        axes.set_title(run_label(run))
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
    fig = figure(WIDTH, 4.2)
    first: Axes | None = None
    for place, (run, colour) in enumerate(((off, WIND_OFF), (on, WIND_ON)), 1):
        axes = fig.add_subplot(2, 1, place, sharex=first, sharey=first)
        axes.plot(*with_breaks(run.record.time_s, run.record.yaw_rad), color=colour, linewidth=0.8)
        axes.set_title(run_label(run))
        axes.set_ylabel("angle β [rad]")
        axes.margins(x=0.01)
        grid(axes)
        first = first or axes
    axes.set_xlabel("time since the start of the record [s]")
    return fig


@styled
def spectrum_figure(runs: Sequence[Run]) -> Figure:
    """Power spectral density of the angle.

    Args:
        runs: up to six runs, one line each.

    Returns:
        A figure of one panel with logarithmic axes, rad²/Hz against Hz.
    """
    fig = figure(WIDTH, 3.6)
    axes = fig.add_subplot()
    for run, colour in zip(runs[:RUNS_PER_PLOT], COLOURS, strict=False):
        axes.plot(*spectrum(run), color=colour, linewidth=1.0, label=run_label(run))
    log_axis(axes, "y")
    log_axis(axes, "x")
    axes.margins(x=0.01)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("power spectral density of β [rad²/Hz]")
    fig.legend(loc="outside upper center", ncols=2)
    grid(axes)
    return fig


def spectrum(run: Run) -> tuple[Array, Array]:
    """Power spectral density of a run's angle, averaged over sixtieths of a decade.

    Frequencies below two cycles in the record are left out: there a Hann window passes the mean and the trend of
    the decay, and not a motion.

    Returns:
        Frequency in Hz and density in rad²/Hz, shape (n,) each.
    """
    from scipy.signal import periodogram

    frequency, density = periodogram(
        run.record.yaw_rad, run.record.sample_rate, window="hann", detrend="constant"
    )
    first = min(LEAKING, frequency.size - 1)
    return _log_averaged(frequency[first:], density[first:], first)


@styled
def truth_figure(estimates: Sequence[Estimate], truth: Mapping[str, float]) -> Figure:
    """Estimates of each estimator against the injected values.

    Args:
        truth: injected values by name, all nonzero, each in the unit of the estimate's quantity of that
            name.

    Returns:
        Two panels with a row for each quantity: the error in reported standard deviations with the interval that
        holds 95 % of them, and the standard deviations in % of the truth, on a logarithmic scale.
    """
    names = tuple(truth)
    fig = figure(WIDTH, 1.3 + 0.5 * len(names))
    errors, stds = fig.subplots(1, 2, sharey=True)
    errors.axvspan(-INTERVAL, INTERVAL, color="#e6e9ec", linewidth=0.0, label="holds 95 %")
    errors.axvline(0.0, color="0.4", linewidth=0.8)
    for index, estimate in enumerate(estimates):
        given = [(row, getattr(estimate, name), truth[name]) for row, name in enumerate(names)]
        known = [(row, quantity, true) for row, quantity, true in given if quantity and quantity.std > 0.0]
        rows = [row + 0.6 * ((index + 0.5) / len(estimates) - 0.5) for row, _, _ in known]
        deviation = [(quantity.value - true) / quantity.std for _, quantity, true in known]
        relative = [100.0 * quantity.std / abs(true) for _, quantity, true in known]
        style = {"color": COLOURS[index % len(COLOURS)], "marker": MARKERS[index % len(MARKERS)]}
        label = estimate.estimator.replace("_", " ")
        errors.plot(deviation, rows, linestyle="none", label=label, **style)
        stds.plot(relative, rows, linestyle="none", **style)
    reach = max(3.0, 1.1 * float(np.max(np.abs(errors.dataLim.intervalx))))
    errors.set(xlim=(-reach, reach), xlabel="(estimate − truth) / σ", ylim=(len(names) - 0.5, -0.5))
    errors.set_yticks(range(len(names)), [SYMBOLS[name] for name in names])
    stds.margins(x=0.08)
    log_axis(stds, "x")
    stds.set_xlabel("reported standard deviation σ [% of the truth]")
    for axes in (errors, stds):
        grid(axes, "x")
        for edge in range(1, len(names)):
            axes.axhline(edge - 0.5, color="0.8", linewidth=0.6)
        axes.tick_params(axis="y", length=0)
    fig.legend(loc="outside upper center", ncols=4)
    return fig


def _log_averaged(frequency: Array, density: Array, first: int) -> tuple[Array, Array]:
    """Means of a spectrum over bins of equal ratio; its first value belongs to ``first`` cycles in the record."""
    decades = np.log10(frequency[-1] / frequency[0])
    edges = np.geomspace(first, first + frequency.size, max(2, int(BINS_PER_DECADE * decades)))
    starts = np.unique(edges.astype(int) - first)[:-1]
    counts = np.diff(np.append(starts, frequency.size))
    return np.add.reduceat(frequency, starts) / counts, np.add.reduceat(density, starts) / counts
