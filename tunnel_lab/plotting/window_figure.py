"""ζ and ωn of windows against the amplitude. matplotlib is imported inside the functions."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from identification.estimate import Quantity
from tunnel_lab.plotting.common import WIDTH, figure, figure_text, grid, limit_to_known, log_axis, styled
from tunnel_lab.plotting.plots import COLOURS, MARKERS, RUNS_PER_PLOT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from identification.estimate import Estimate, RunEstimate

ONE_RIG = 1.5
"""Frequencies within this factor share one plot in absolute units."""
_INTERVAL = 1.96


@styled
def windows_figure(estimate: Estimate) -> Figure:
    """ζ and ωn of the windows of each run against the amplitude, with 95 % intervals.

    A linear rig gives horizontal lines; a slope shows an effect that the linear model lacks.

    Args:
        estimate: of any campaign; runs past the sixth and those with fewer than two windows are left out.

    Returns:
        A figure of two panels. Where the runs differ in frequency, each quantity is shown as its deviation from
        the weighted mean of its run, so that only its change with the amplitude is seen.
    """
    runs = [run for run in estimate.runs if len(run.windows) > 1][:RUNS_PER_PLOT]
    centres = [window.omega_n.value for run in runs for window in run.windows]
    one_rig = bool(centres) and max(centres) < ONE_RIG * min(centres)
    fig = figure(WIDTH, 3.6)
    panels = fig.subplots(1, 2)
    for axes, name in zip(panels, ("zeta", "omega_n"), strict=True):
        shown = [_shown(run, name, absolute=one_rig) for run in runs]
        for index, (run, quantities) in enumerate(zip(runs, shown, strict=True)):
            amplitude = [window.amplitude.value for window in run.windows]
            _intervals(axes, amplitude, quantities, index, figure_text(run.id))
        if runs:
            drawn = [quantity for quantities in shown for quantity in quantities]
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
    return fig


def deviations(quantities: Sequence[Quantity]) -> list[Quantity]:
    """Each value less the weighted mean of all.

    Args:
        quantities: independent, of one unit.

    Returns:
        The deviations. Their variance is that of the value less that of the mean, which has the value in it.
    """
    stds = np.array([quantity.std for quantity in quantities])
    least = 1e-6 * float(np.min(stds[stds > 0.0], initial=np.inf))
    weights = np.maximum(stds, least if np.isfinite(least) else 1.0) ** -2.0  # a value may be exact
    mean = float(weights @ [quantity.value for quantity in quantities] / weights.sum())
    left = 1.0 / float(weights.sum())
    return [Quantity(q.value - mean, sqrt(max(q.std**2 - left, 0.0)), q.unit) for q in quantities]


def _shown(run: RunEstimate, name: str, *, absolute: bool) -> list[Quantity]:
    """One quantity of the windows as it is drawn."""
    given: list[Quantity] = [getattr(window, name) for window in run.windows]
    if absolute:
        return given
    found = deviations(given)
    mean = given[0].value - found[0].value
    scale, unit = (1e3, "10⁻³") if name == "zeta" else (100.0 / mean, "%")
    return [Quantity(scale * q.value, scale * q.std, unit) for q in found]


def _intervals(
    axes: Axes, x: Sequence[float], quantities: Sequence[Quantity], index: int, label: str
) -> None:
    """Points with 95 % intervals."""
    style: dict[str, Any] = {"color": COLOURS[index], "marker": MARKERS[index], "label": label}
    spans = [_INTERVAL * q.std for q in quantities]
    axes.errorbar(x, [q.value for q in quantities], yerr=spans, linewidth=0.8, markersize=3.5, **style)
