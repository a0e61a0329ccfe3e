"""Figures of the paper's networks against known truth. matplotlib is imported inside the functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from identification.estimate import Estimate, WindowEstimate
from tunnel_lab.paper.network_study import HeldOutErrors, regenerated
from tunnel_lab.plotting.style import BLUE, COLOURS, MARKERS, VERMILION, WIDTH, figure, grid, log_axis, styled
from tunnel_sim.vocabulary.campaign import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from identification.datasets import WindowRow


@styled
def error_figure(errors: HeldOutErrors) -> Figure:
    """Fig. 3: the error of ζ against ζ and of ωn against ωn.

    Args:
        errors: in %, on responses that were not trained on.
    """
    fig = figure(WIDTH, 2.9)
    left, right = fig.subplots(1, 2)
    left.plot(errors.zeta, errors.zeta_percent, ".", ms=1.5, color=BLUE)
    left.set(xlabel="damping ratio ζ [1]", ylabel="error of ζ [%]")
    right.plot(errors.omega_n, errors.omega_percent, ".", ms=1.5, color=VERMILION)
    right.set(xlabel="natural frequency ωn [rad/s]", ylabel="error of ωn [%]")
    for axes in (left, right):
        axes.axhline(0.0, color="0.4", lw=0.8, zorder=1)
        log_axis(axes, "x")
        grid(axes)
    return fig


@styled
def table3_figure(rows: Sequence[WindowRow], shown: Mapping[str, Sequence[WindowEstimate]]) -> Figure:
    """Table III beside windows of simulated runs.

    Returns:
        The figure: ζ on the left, ωn on the right, against the window's number; 95 % intervals.
    """
    fig = figure(WIDTH, 3.4)
    panels = fig.subplots(1, 2)
    number = np.array([row.number for row in rows])
    label = "the paper's Table III"
    panels[0].plot(number, [row.zeta for row in rows], "o-", color="black", ms=4, label=label)
    panels[1].plot(number, [row.omega_n_rad_per_s for row in rows], "o-", color="black", ms=4)
    for place, (label, windows) in enumerate(shown.items()):
        kept = list(windows)[: number.size]
        aside = 0.14 * (place - 0.5 * (len(shown) - 1))  # intervals must not hide each other
        for axes, name in zip(panels, ("zeta", "omega_n"), strict=True):
            values = [getattr(window, name) for window in kept]
            axes.errorbar(
                number[: len(kept)] + aside,
                [value.value for value in values],
                [1.96 * value.std for value in values],
                fmt=f"{MARKERS[place + 1]}-",
                color=COLOURS[place],
                lw=0.8,
                ms=4,
                label=label,
            )
    for axes, label in zip(panels, ("damping ratio ζ [1]", "natural frequency ωn [rad/s]"), strict=True):
        axes.set(xlabel="window of three cycles", ylabel=label)
        axes.set_xticks(number)
        grid(axes)
    fig.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return fig


@styled
def response_figure(run: Run, estimates: Sequence[Estimate], *, magnified: tuple[float, float]) -> Figure:
    """Figs 4 to 6: the record and the responses regenerated from each method's ζ and ωn.

    Args:
        run: the record; its id is looked up in the estimates.
        magnified: stretch shown large, from and to, s.

    Returns:
        The figure: the whole record above, the stretch in the middle, what is left of it below.
    """
    fig = figure(WIDTH, 6.4)
    whole, part, left = fig.subplots(3, 1)
    time = run.record.time_s - run.record.time_s[0]
    whole.axvspan(*magnified, color="#e6e9ec", lw=0)
    whole.plot(time, np.degrees(run.record.yaw_rad), color="black", lw=0.8)
    inside = (time >= magnified[0]) & (time <= magnified[1])
    part.plot(time[inside], np.degrees(run.record.yaw_rad[inside]), color="black", lw=2.0, label="record")
    for estimate, colour, dash in zip(estimates, COLOURS, ("--", "-.", ":"), strict=False):
        found = next(one for one in estimate.runs if one.id == run.id)
        if found.omega_n is None or found.zeta is None:
            continue
        again = regenerated(run, found.omega_n.value, found.zeta.value)
        label = estimate.estimator.replace("_", " ")
        part.plot(time[inside], np.degrees(again[inside]), color=colour, ls=dash, lw=1.4, label=label)
        left.plot(time, np.degrees(run.record.yaw_rad - again), color=colour, lw=0.7)
    names = ("angle β [°]", "angle β, shaded part [°]", "record − response [°]")
    for axes, name in zip((whole, part, left), names, strict=True):
        axes.set_ylabel(name)
        axes.margins(x=0.01)
        grid(axes)
    fig.align_ylabels((whole, part, left))
    left.set_xlabel("time since the start of the record [s]")
    fig.legend(*part.get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return fig
