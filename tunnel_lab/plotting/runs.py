"""Figures of runs, windows, estimates and imports. matplotlib is imported inside the functions.

Every function returns a figure and writes nothing.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from math import ceil, sqrt
from typing import TYPE_CHECKING

import numpy as np

from identification.printing import SYMBOLS
from identification.show.drawing import in_words
from identification.show.numbers import unit_mark
from identification.show.quantity import INTERVAL, Quantity
from identification.show.style import (
    BLUE,
    COLOURS,
    MARKERS,
    VERMILION,
    WIDTH,
    figure,
    figure_text,
    grid,
    limit_to_known,
    log_axis,
    styled,
    with_breaks,
)
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.errors import counted
from tunnel_sim.vocabulary.freedom import ANGLE, FREEDOMS, Freedom
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from identification.estimate import Estimate
    from tunnel_sim.files.importing.records import Imported


WIND_OFF, WIND_ON = BLUE, VERMILION
PANELS_PER_PAGE = 12
BINS_PER_DECADE = 60
LEAKING = 2
"""Number of cycles in a record below which a Hann window leaks the mean."""
RUNS_PER_PLOT = 6
"""Maximum number of lines in one plot: more lines than colours cannot be distinguished."""
ONE_RIG = 1.5
"""Ratio of frequencies up to which they share one plot in absolute units."""
MOST_PANELS = 24
_COLUMNS = 3
_POINTS = 2000  # number of intervals, each drawn by its least and greatest reading
_GREY = "0.6"


def run_label(run: Run) -> str:
    """The conditions of a run in a few words, such as ``r02 · 16.12 N m/rad · 15 m/s``."""
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
    """Angle against time, a panel for each run, twelve on a page; the input of a driven run is behind it."""
    pages = []
    for first in range(0, len(campaign.runs), PANELS_PER_PAGE):
        runs = campaign.runs[first : first + PANELS_PER_PAGE]
        columns = 1 if len(runs) <= 3 else 2 if len(runs) <= 6 else 3
        rows = ceil(len(runs) / columns)
        fig = figure(WIDTH if columns < 3 else 1.4 * WIDTH, 1.8 * rows + 0.6)
        for place, run in enumerate(runs, 1):
            axes = fig.add_subplot(rows, columns, place)
            colour, time = WIND_ON if run.wind_on else WIND_OFF, run.record.time_s
            axes.plot(*with_breaks(time, run.record.yaw_rad), color=colour, linewidth=0.7)
            axes.set_title(run_label(run))
            axes.margins(x=0.01)
            grid(axes)
            if (place - 1) % columns == 0:
                axes.set_ylabel("angle β [rad]")
            if place > len(runs) - columns:
                axes.set_xlabel("time [s]")
            if run.drive is not None:  # on a separate axis at the right, behind the response
                beside = axes.twinx()
                beside.plot(*with_breaks(time, run.drive.values), color=_GREY, linewidth=0.5)
                beside.set_ylabel(f"{run.drive.kind.noun} [{unit_mark(run.drive.kind.unit)}]", color="0.4")
                axes.set_zorder(beside.get_zorder() + 1)
                axes.patch.set_visible(False)
        pages.append(in_words(fig, campaign.sensor.freedom, [run.id for run in campaign.runs]))
    return tuple(pages)


@styled
def wind_off_on_figure(off: Run, on: Run) -> Figure:
    """A run with the wind off above a run with the wind on, preferably of the same spring, on the same axes."""
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
def spectrum_figure(runs: Sequence[Run], freedom: Freedom = ANGLE) -> Figure:
    """Power spectral density of the angle of up to six runs, rad²/Hz against Hz, on logarithmic axes."""
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
    return in_words(fig, freedom, [run.id for run in runs])


def spectrum(run: Run) -> tuple[Array, Array]:
    """Power spectral density of a run's angle, averaged over sixtieths of a decade.

    Frequencies below two cycles in the record are left out, because there a Hann window passes the mean and the
    trend of the decay.

    Returns:
        Frequency in Hz and density in rad²/Hz, shape (n,) each.
    """
    from scipy.signal import periodogram

    frequency, density = periodogram(
        run.record.yaw_rad, run.record.sample_rate, window="hann", detrend="constant"
    )
    first = min(LEAKING, frequency.size - 1)
    frequency, density = frequency[first:], density[first:]
    # Means over bins of equal ratio; the first value belongs to ``first`` cycles in the record.
    decades = np.log10(frequency[-1] / frequency[0])
    edges = np.geomspace(first, first + frequency.size, max(2, int(BINS_PER_DECADE * decades)))
    starts = np.unique(edges.astype(int) - first)[:-1]
    counts = np.diff(np.append(starts, frequency.size))
    return np.add.reduceat(frequency, starts) / counts, np.add.reduceat(density, starts) / counts


@styled
def truth_figure(estimates: Sequence[Estimate], truth: Mapping[str, float]) -> Figure:
    """Estimates of each estimator against the injected values, a row for each quantity.

    On the left is the error in reported standard deviations, with the interval expected to contain 95 % of the
    errors. On the right are the standard deviations in % of the truth, on a logarithmic scale.

    Args:
        truth: injected values by name, all nonzero, each in the unit of the estimate's quantity of that name.
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


@styled
def windows_figure(estimate: Estimate) -> Figure:
    """ζ and ωn of the windows of each run against the amplitude, with 95 % intervals.

    A linear rig gives horizontal lines; a slope shows an effect that the linear model lacks. Runs after the
    sixth and runs with fewer than two windows are left out. If the runs differ in frequency, each quantity is
    shown as its deviation from the weighted mean of its run, to show only the change with the amplitude.
    """
    runs = [run for run in estimate.runs if len(run.windows) > 1][:RUNS_PER_PLOT]
    centres = [window.omega_n.value for run in runs for window in run.windows]
    one_rig = bool(centres) and max(centres) < ONE_RIG * min(centres)
    fig = figure(WIDTH, 3.6)
    panels = fig.subplots(1, 2)
    for axes, name in zip(panels, ("zeta", "omega_n"), strict=True):
        drawn: list[Quantity] = []
        for index, run in enumerate(runs):
            quantities: list[Quantity] = [getattr(window, name) for window in run.windows]
            if not one_rig:
                shifts = deviations(quantities)
                mean = quantities[0].value - shifts[0].value
                scale, unit = (1e3, "10⁻³") if name == "zeta" else (100.0 / mean, "%")
                quantities = [Quantity(scale * q.value, scale * q.known_std, unit) for q in shifts]
            axes.errorbar(
                [window.amplitude.value for window in run.windows],
                [q.value for q in quantities],
                yerr=[INTERVAL * q.known_std for q in quantities],
                color=COLOURS[index],
                marker=MARKERS[index],
                label=figure_text(run.id),
                linewidth=0.8,
                markersize=3.5,
            )
            drawn += quantities
        if runs:
            limit_to_known(axes, np.array([q.value for q in drawn]), np.array([q.std for q in drawn]))
            log_axis(axes, "x")
        if not one_rig:
            axes.axhline(0.0, color="0.4", linewidth=0.8, zorder=0)
        axes.set_xlabel("mean amplitude of the window [rad]")
        grid(axes)
    if one_rig:
        labels = ("damping ratio ζ [1]", "natural frequency ωn [rad/s]")
    else:
        labels = ("ζ − weighted mean of the run [10⁻³]", "ωn − weighted mean of the run [%]")
    for axes, label in zip(panels, labels, strict=True):
        axes.set_ylabel(label)
    if runs:
        handles, names = panels[0].get_legend_handles_labels()
        fig.legend(handles, names, loc="outside upper center", ncols=3)
    return in_words(fig, FREEDOMS[estimate.motion], [run.id for run in runs])


def deviations(quantities: Sequence[Quantity]) -> list[Quantity]:
    """Deviations of independent values of the same unit from their weighted mean.

    The variance of a deviation is the value's variance minus the mean's, because the mean includes the value.
    """
    stds = np.array([quantity.std for quantity in quantities])
    least = 1e-6 * float(np.min(stds[stds > 0.0], initial=np.inf))
    weights = np.maximum(stds, least if np.isfinite(least) else 1.0) ** -2.0  # a value may be exact
    mean = float(weights @ [quantity.value for quantity in quantities] / weights.sum())
    of_mean = 1.0 / float(weights.sum())
    return [Quantity(q.value - mean, sqrt(max(q.known_std**2 - of_mean, 0.0)), q.unit) for q in quantities]


@styled
def import_picture(imported: Imported) -> bytes:
    """Draw imported records as PNG: left-out samples are grey, vertical lines mark the beginning and end of runs.

    Samples that are not part of a free decay, but might be mistaken for one, are shaded.
    """
    raws = {id(part.raw): part.raw for part in imported.parts}
    shown = list(raws)[:MOST_PANELS]
    columns = min(_COLUMNS, len(shown))
    rows = -(-len(shown) // columns)
    picture = figure(max(4.5 * columns, 8.0), 2.2 * rows + 0.8)
    panels = picture.subplots(rows, columns, squeeze=False).ravel()
    for key, axes in zip(shown, panels, strict=False):
        raw, parts = raws[key], [part for part in imported.parts if id(part.raw) == key]
        time, reading = raw.cleaned.file_time_s, raw.cleaned.reading
        axes.plot(*thinned(time, reading), color=_GREY, linewidth=0.7)
        kept = 0
        for number, part in enumerate(parts):
            if part.run is None:
                _shade(axes, time[part.piece.first], time[part.piece.last - 1])
                continue
            kept += 1
            piece = slice(part.piece.first, part.piece.last)
            colour = COLOURS[number % len(COLOURS)] if len(parts) > 1 else BLUE
            axes.plot(*thinned(time[piece], reading[piece]), color=colour, linewidth=0.7)
            axes.axvline(time[part.piece.first], color=VERMILION, linewidth=0.8, linestyle="--")
            if part.piece.held > 0.0:
                _shade(axes, time[part.piece.first] - part.piece.held, time[part.piece.first])
            if part.piece.stopped:
                axes.axvline(time[part.piece.last - 1], color=VERMILION, linewidth=0.8, linestyle=":")
        if raw.input is not None:
            name, values = raw.sensor.freedom.own_input(raw.input.role), raw.input.values
            beside = axes.twinx()
            beside.plot(*thinned(time, values), color=VERMILION, linewidth=0.4, alpha=0.6)
            beside.set_ylabel(f"input {name}", fontsize=8, color=VERMILION)
            beside.tick_params(labelsize=7)
        axes.set_title(
            figure_text(raw.id if kept == 1 else f"{raw.id}: {counted(kept, 'run')}"), fontsize=9, loc="left"
        )
        axes.set_xlabel("time of the file [s]", fontsize=8)
        axes.set_ylabel(f"reading [{imported.campaign.sensor.unit}]", fontsize=8)
        axes.tick_params(labelsize=7)
    for axes in panels[len(shown) :]:
        axes.remove()
    more = f" (the first {MOST_PANELS} of {len(raws)} records)" if len(raws) > MOST_PANELS else ""
    picture.suptitle(
        figure_text(f"{imported.campaign.name}\nruns in colour, others in grey, doubtful ones shaded{more}"),
        fontsize=9,
    )
    stream = io.BytesIO()
    picture.savefig(stream, format="png", dpi=120)
    return stream.getvalue()


def _shade(axes: Axes, start: float, end: float) -> None:
    axes.axvspan(start, end, color=VERMILION, alpha=0.15, linewidth=0.0)


def thinned(time: Array, reading: Array) -> tuple[Array, Array]:
    """A curve with few points that looks the same, broken where samples are missing.

    Args:
        time: times, shape (n,), s.
        reading: readings, shape (n,).

    Returns:
        Times and readings, shape (m,): the least and the greatest reading of each interval; NaN within a gap.
    """
    size = time.size // _POINTS
    if size > 1:
        starts = np.arange(0, time.size, size)
        ends = np.stack([np.minimum.reduceat(reading, starts), np.maximum.reduceat(reading, starts)], axis=1)
        time, reading = np.repeat(time[starts], 2), ends.ravel()
    when, values = with_breaks(time, reading)
    return when, values
