"""Figures of the paper's networks against known truth. matplotlib is imported inside the functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from docs.studies.network_study import HeldOutErrors, regenerated
from identification.estimate import Estimate, WindowEstimate
from tunnel_lab.plotting.plots import BLUE, COLOURS, MARKERS, VERMILION
from tunnel_sim.vocabulary.campaign import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from identification.datasets import WindowRow


def error_figure(errors: HeldOutErrors) -> Figure:
    """Fig. 3: the error of ζ against ζ and of ωn against ωn.

    Args:
        errors: in %, on responses that were not trained on.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.semilogx(errors.zeta, errors.zeta_percent, ".", ms=2, color=BLUE)
    left.set_xlabel("damping ratio ζ")
    left.set_ylabel("error of ζ [%]")
    right.semilogx(errors.omega_n, errors.omega_percent, ".", ms=2, color=VERMILION)
    right.set_xlabel("natural frequency ωn [rad/s]")
    right.set_ylabel("error of ωn [%]")
    for axis in (left, right):
        axis.grid(alpha=0.3)
    return figure


def table3_figure(rows: Sequence[WindowRow], shown: Mapping[str, Sequence[WindowEstimate]]) -> Figure:
    """Table III beside windows of simulated runs.

    Returns:
        The figure: ζ on the left, ωn on the right, against the window's number.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.5), layout="constrained")
    axes = figure.subplots(1, 2)
    number = np.array([row.number for row in rows])
    axes[0].plot(number, [row.zeta for row in rows], "ko-", label="the paper's Table III")
    axes[1].plot(number, [row.omega_n_rad_per_s for row in rows], "ko-", label="the paper's Table III")
    for (label, windows), colour, marker in zip(shown.items(), COLOURS, MARKERS, strict=False):
        kept = list(windows)[: number.size]
        for axis, name in zip(axes, ("zeta", "omega_n"), strict=True):
            values = [getattr(window, name) for window in kept]
            axis.errorbar(
                number[: len(kept)],
                [value.value for value in values],
                [1.96 * value.std for value in values],
                fmt=f"{marker}--",
                color=colour,
                capsize=3,
                label=label,
            )
    for axis, label in zip(axes, ("damping ratio ζ", "natural frequency ωn [rad/s]"), strict=True):
        axis.set_xlabel("window of three cycles")
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


def response_figure(run: Run, estimates: Sequence[Estimate], *, magnified: tuple[float, float]) -> Figure:
    """Figs 4 to 6: the record and the responses regenerated from each method's ζ and ωn.

    Args:
        run: the record; its id is looked up in the estimates.
        magnified: stretch shown large, from and to, s.

    Returns:
        The figure: the whole record above, the stretch in the middle, what is left of it below.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 8.0), layout="constrained")
    whole, part, left = figure.subplots(3, 1)
    time = run.record.time_s - run.record.time_s[0]
    for axis in (whole, part):
        axis.plot(time, np.degrees(run.record.yaw_rad), color="black", lw=1.0, label="record")
    for estimate, colour in zip(estimates, COLOURS, strict=False):
        found = next(one for one in estimate.runs if one.id == run.id)
        if found.omega_n is None or found.zeta is None:
            continue
        again = regenerated(run, found.omega_n.value, found.zeta.value)
        part.plot(time, np.degrees(again), color=colour, ls="--", label=estimate.estimator)
        left.plot(
            time, np.degrees(run.record.yaw_rad - again), color=colour, lw=1.0, label=estimate.estimator
        )
    whole.axvspan(*magnified, color="grey", alpha=0.2)
    part.set_xlim(*magnified)
    inside = (time >= magnified[0]) & (time <= magnified[1])
    reach = 1.2 * float(np.abs(np.degrees(run.record.yaw_rad[inside])).max())
    part.set_ylim(-reach, reach)
    part.legend(loc="upper right", ncols=4, frameon=False)
    for axis, label in zip(
        (whole, part, left), ("yaw [°]", "magnified [°]", "record − response [°]"), strict=True
    ):
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    left.set_xlabel("time [s]")
    left.legend(loc="upper right", ncols=3, frameon=False)
    return figure
