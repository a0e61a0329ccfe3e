"""The figure of friction against rate: the fitted law with its band, and the points of the energy balance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from diagnosis.findings.whole import Findings
from diagnosis.words.numbers import plain
from identification.printing import unit_mark
from identification.show.drawing import AFTER, INK, NARROW, PAPER
from identification.show.style import INTERVAL, figure, grid, log_axis, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ROOM = 1.15  # length of the axis over the greatest friction drawn
_MOST = 1.6  # times the law's greatest friction: very uncertain points lie beyond the axis


@styled
def friction_figure(answer: Findings) -> Figure | None:
    """Friction against rate with 95 % intervals; None for an answer without friction."""
    curve = answer.figure_data.get("friction")
    if curve is None:
        return None
    rate, moment, std = (np.array(curve[name], np.float64) for name in ("rate_rad_s", "moment", "std"))
    fig = figure(NARROW, 3.0)
    axes = fig.add_subplot()
    low, high = moment - INTERVAL * std, moment + INTERVAL * std
    axes.fill_between(rate, np.maximum(low, 0.0), high, color=AFTER, alpha=0.25, lw=0)
    load = curve.get("per_load", 0.0)
    more = f" without load; {100.0 * load:.2g} % of the load comes on top" if load else ""
    axes.plot(rate, moment, color=AFTER, label=f"law, fitted{more}")
    tops = [float(high.max())]
    if curve["points"]:
        at, mean, error = (
            np.array([point[name] for point in curve["points"]], np.float64)
            for name in ("rate_rad_s", "moment", "std")
        )
        axes.errorbar(
            at, mean, yerr=INTERVAL * error, fmt="o", color=INK, mfc=PAPER, ms=5, capsize=2, elinewidth=1.0,
            label="energy lost between reversals",
        )  # fmt: skip
        tops.append(min(float((mean + INTERVAL * error).max()), _MOST * float(moment.max())))
    axes.set_ylim(0.0, _ROOM * max(tops))
    mark = "N m" if curve["unit"] == "N m" else f"{unit_mark(curve['unit'])}, over inertia"
    axes.set(xlabel="rate [rad/s]", ylabel=f"{plain(curve['effect'])} [{mark}]")
    log_axis(axes, "x")
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=1 if load else 2, borderpad=0.0, borderaxespad=0.3
    )
    grid(axes)
    return fig
