"""Where the gap is: by run and time, by amplitude and frequency, in backbones and in the phase plane."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tunnel_lab.diagnosis_view.figures_common import (
    AFTER,
    BEFORE,
    MARKERS,
    QUIET,
    WIDTH,
    Document,
    array,
    run_label,
    shade,
)
from tunnel_lab.plotting.common import figure, grid
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SIGMAS = 3.0  # cells and bands below this are drawn as noise
_MOST_CURVES = 16
_UNITS: dict[str, str] = {"rad/s2": "rad/s²"}


def runs_figure(document: Document) -> Figure:
    """Excess of every run over time, with the run's own excess beside it.

    Args:
        document: a diagnosis with its maps.

    Returns:
        A heat map on a logarithmic scale; cells within the noise stay white.
    """
    from matplotlib.colors import LogNorm

    maps = document["maps"]
    runs = maps["runs"]
    fig = figure(WIDTH, 1.2 + 0.27 * max(len(runs), 4))
    heat, bars = fig.subplots(1, 2, sharey=True, width_ratios=(3.2, 1.0))
    edges = array(maps["time"]["edges_s"])
    cells = np.stack([array(row) for row in maps["time"]["by_run"]])
    floor = _SIGMAS * _cell_noise(maps)
    top = max(float(np.nanmax(cells)), 2.0 * floor)
    shown = np.where(cells > floor, cells, np.nan)
    extent = (float(edges[0]), float(edges[-1]), len(runs) - 0.5, -0.5)
    image = heat.imshow(
        shown, aspect="auto", extent=extent, cmap="YlOrRd", norm=LogNorm(floor, top), interpolation="nearest"
    )
    if not np.isfinite(shown).any():
        heat.text(0.5, 0.5, "every cell within the noise", transform=heat.transAxes, ha="center", color="0.4")
    heat.set_yticks(range(len(runs)), [run_label(run) for run in runs], fontsize=8)
    heat.set_xlabel("time since the start of the record [s]")
    heat.set_title("over time", fontsize=10, loc="left")
    fig.colorbar(image, ax=heat, label="excess (noise variances)", pad=0.01, aspect=30)
    colours = [BEFORE if run["id"] in document["where"]["runs"] else "0.75" for run in runs]
    bars.barh(range(len(runs)), [max(run["excess"], 0.0) for run in runs], color=colours, height=0.7)
    threshold = _SIGMAS * max(run["std"] for run in runs)
    bars.set_xscale("symlog", linthresh=threshold)
    greatest = max(max(run["excess"] for run in runs), 2.0 * threshold)
    powers = np.arange(np.ceil(np.log10(threshold)), np.floor(np.log10(greatest)) + 1.0)
    bars.set_xticks([0.0, *(10.0 ** powers[:: max(1, -(-powers.size // 3))])], minor=False)
    bars.set_xlim(0.0, 1.6 * greatest)
    bars.set_xlabel("excess of the run")
    bars.set_title("whole run", fontsize=10, loc="left")
    bars.tick_params(labelleft=False)
    grid(bars)
    return fig


def _cell_noise(maps: Document) -> float:
    """Standard deviation of one cell of the map without a gap."""
    times = array(maps["time"]["edges_s"])
    run = min(maps["runs"], key=lambda entry: entry["std"])
    return float(run["std"] * np.sqrt(times.size - 1))


def profiles_figure(document: Document) -> Figure:
    """Excess over time, amplitude and frequency, all runs together.

    Args:
        document: a diagnosis with its maps.

    Returns:
        Three panels; the shaded intervals hold four fifths of the gap.
    """
    maps, where = document["maps"], document["where"]
    fig = figure(WIDTH, 5.4)
    axes = fig.subplot_mosaic([["time", "amplitude"], ["frequency", "frequency"]])
    _profile(axes["time"], maps["time"], "edges_s", where["time_s"])
    _moment(axes["time"], maps["time"])
    axes["time"].set_xlabel("time since the start of the record [s]")
    _profile(axes["amplitude"], maps["amplitude"], "edges_rad", where["amplitude_rad"])
    axes["amplitude"].set_xlabel("amplitude of the motion [rad]")
    _spectrum(axes["frequency"], maps["frequency"], where["frequency_hz"])
    return fig


def _profile(axes: Axes, values: Document, edges: str, interval: list[float] | None) -> None:
    bounds, mean, std = array(values[edges]), array(values["excess"]), array(values["std"])
    shade(axes, interval)
    axes.stairs(_SIGMAS * std, bounds, baseline=-_SIGMAS * std, fill=True, color="0.85")
    axes.stairs(mean, bounds, color=BEFORE, linewidth=1.4)
    axes.set_xlim(0.0, float(bounds[-1]))
    axes.set_ylim(min(-4.0 * float(np.nanmedian(std)), 1.05 * float(np.nanmin(mean))), None)
    axes.set_ylabel("excess (noise variances)")
    grid(axes)


def _moment(axes: Axes, values: Document) -> None:
    """The missing moment's energy: it shows when a moment acts, not how long the motion after it lasts."""
    beside = axes.twinx()
    share = 100.0 * array(values["moment_share"])
    beside.stairs(share, array(values["edges_s"]), fill=True, color=AFTER, alpha=0.3)
    beside.set_ylim(0.0, 1.05 * max(float(share.max()), 20.0))
    beside.set_ylabel("missing moment [%]", color=AFTER, fontsize=9)
    beside.spines["top"].set_visible(False)
    axes.set_zorder(beside.get_zorder() + 1)
    axes.patch.set_visible(False)


def _spectrum(axes: Axes, values: Document, interval: list[float] | None) -> None:
    edges = array(values["edges_hz"])
    left = np.concatenate([[0.5 * edges[1]], edges[1:]])
    centre = np.sqrt(left[:-1] * left[1:])
    before, std = array(values["excess"]) + 1.0, array(values["std"])
    known = np.isfinite(before)
    shade(axes, interval)
    low, high = values["resonance_hz"]
    axes.axvspan(0.985 * low, 1.015 * high, ymax=0.035, color="0.35", linewidth=0)
    axes.fill_between(
        centre[known],
        np.maximum(1.0 - _SIGMAS * std[known], 0.3),
        1.0 + _SIGMAS * std[known],
        color="0.8",
        linewidth=0,
        label="noise (3σ)",
    )
    floor = 0.3
    axes.plot(centre[known], np.maximum(before[known], floor), color=BEFORE, label="nominal model")
    if values["after"] is not None:
        after = array(values["after"]) + 1.0
        axes.plot(
            centre[known], np.maximum(after[known], floor), color=AFTER, lw=1.2, label="with the causes"
        )
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(float(left[0]), float(edges[-1]))
    axes.set_xlabel("frequency [Hz]; dark bar: the runs' own frequencies")
    axes.set_ylabel("residual power over noise")
    axes.legend(loc="upper right", fontsize=8, frameon=False)
    grid(axes)


def backbone_figure(document: Document) -> Figure:
    """Frequency and damping of the runs that show the gap against amplitude, with 95 % bands.

    Args:
        document: a diagnosis with its maps.

    Returns:
        Two panels: frequency relative to the nominal model's, and damping ratio minus the nominal model's.
    """
    from matplotlib import colormaps

    maps = document["maps"]
    curves = [curve for curve in maps["backbones"] if len(curve["time_s"]) > 1]
    named = [curve for curve in curves if curve["id"] in document["where"]["runs"]]
    # the runs that show the gap first, in the campaign's order, and then the rest for comparison
    chosen = (named + [curve for curve in curves if curve not in named])[:_MOST_CURVES]
    labels = {run["id"]: run_label(run) for run in maps["runs"]}
    fig = figure(WIDTH, 4.6)
    frequency, damping = fig.subplots(1, 2)
    palette = colormaps["viridis"](np.linspace(0.0, 0.92, max(len(chosen), 1)))
    for index, curve in enumerate(chosen):
        amplitude = array(curve["amplitude_rad"])
        nominal = curve["nominal_frequency_hz"]
        style = {"color": palette[index], "marker": MARKERS[index % len(MARKERS)]}
        shift = 100.0 * (array(curve["frequency_hz"]) / nominal - 1.0)
        _curve(frequency, amplitude, shift, 100.0 * array(curve["frequency_std"]) / nominal, style)
        change = 1e3 * (array(curve["zeta"]) - curve["nominal_zeta"])
        _curve(damping, amplitude, change, 1e3 * array(curve["zeta_std"]), style, labels[curve["id"]])
    for axes, name in ((frequency, "frequency against the nominal model [%]"),
                       (damping, "damping ratio minus the nominal one [10⁻³]")):  # fmt: skip
        axes.axhline(0.0, color="black", linewidth=1.0)
        axes.set_xlabel("amplitude [rad]")
        axes.set_ylabel(name)
        grid(axes)
    if chosen:
        fig.legend(loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    return fig


def _curve(
    axes: Axes, x: Array, y: Array, std: Array, style: dict[str, Any], label: str | None = None
) -> None:
    order = np.argsort(x)
    colour, marker = style["color"], str(style["marker"])
    band = 1.96 * std[order]
    axes.fill_between(x[order], y[order] - band, y[order] + band, color=colour, alpha=0.15, linewidth=0)
    axes.plot(x[order], y[order], color=colour, marker=marker, ms=3.5, lw=1.0, label=label)


def phase_plane_figure(document: Document) -> Figure | None:
    """The missing moment over angle and rate, and its means over each.

    Args:
        document: a diagnosis with its maps.

    Returns:
        A map with two profiles and their 95 % bands; None where the maps hold none.
    """
    plane = document["maps"]["phase_plane"]
    if plane is None:
        return None
    edges = array(plane["edges_rad"])
    count = edges.size - 1
    moment = np.stack([array(row) for row in plane["moment"]])
    std = np.stack([array(row) for row in plane["std"]])
    unit, factor = _readable(plane, np.abs(moment))
    fig = figure(WIDTH, 4.0)
    field, angle, rate = fig.subplots(1, 3, width_ratios=(1.25, 1.0, 1.0))
    clear = np.where(np.abs(moment) > _SIGMAS * std, moment * factor, np.nan)
    reach = float(np.nanquantile(np.abs(moment), 0.98)) * factor if np.isfinite(moment).any() else 1.0
    extent = (float(edges[0]), float(edges[-1]), float(edges[0]), float(edges[-1]))
    image = field.imshow(
        clear, origin="lower", extent=extent, cmap="RdBu_r", vmin=-reach, vmax=reach, interpolation="nearest"
    )
    field.set_xlabel("angle β [rad]")
    field.set_ylabel("rate β̇/ω [rad]")
    fig.colorbar(image, ax=field, location="top", label=f"missing moment [{unit}]", shrink=0.9, aspect=25)
    centre = 0.5 * (edges[1:] + edges[:-1])
    for axes, name, label in ((angle, "by_angle", "angle β [rad]"), (rate, "by_rate", "rate β̇/ω [rad]")):
        mean, spread = factor * array(plane[name]), factor * array(plane[f"{name}_std"])
        assert mean.size == count
        axes.axhline(0.0, color=QUIET, linewidth=0.8)
        axes.fill_between(centre, mean - 1.96 * spread, mean + 1.96 * spread, color=BEFORE, alpha=0.2, lw=0)
        axes.plot(centre, mean, color=BEFORE, marker="o", ms=3)
        axes.set_xlabel(label)
        axes.set_title(f"mean over all {'rates' if name == 'by_angle' else 'angles'} [{unit}]", fontsize=9)
        grid(axes)
    return fig


def _readable(plane: Document, size: Array) -> tuple[str, float]:
    """A unit in which the values are neither thousands nor thousandths."""
    unit = _UNITS.get(plane["unit"], str(plane["unit"]))
    greatest = float(np.nanmax(size)) if np.isfinite(size).any() else 1.0
    return (f"10⁻³ {unit}", 1e3) if greatest < 0.1 else (unit, 1.0)
