"""A figure of a table of windows and what reproduces it. matplotlib is imported inside the function."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from docs.studies.window_rivals import Explanation, WindowDiagnosis
from tunnel_lab.plotting.plots import COLOURS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (8, 3)))


def window_figure(found: WindowDiagnosis, shown: Sequence[Explanation]) -> Figure:
    """Both columns of a table of windows, and explanations of it.

    Args:
        found: the table (rad/s for ωn) with its scatter.
        shown: explanations, six at most.

    Returns:
        The figure: damping on the left, frequency on the right, against the window's number.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 5.0), layout="constrained")
    axes = figure.subplots(1, 2)
    window = np.arange(1, found.measured.zeta.size + 1)
    for axis, column, label in zip(
        axes, ("zeta", "omega_n"), ("damping ratio ζ", "natural frequency ωn [rad/s]"), strict=True
    ):
        for e, colour, dash in zip(shown, COLOURS, _DASHES, strict=False):
            axis.plot(window, getattr(e.columns, column), color=colour, ls=dash, label=e.name)
        axis.errorbar(
            window,
            getattr(found.measured, column),
            getattr(found.std, column),
            fmt="ko",
            capsize=3,
            label="measured, ± scatter",
        )
        axis.set_xlabel("window of three cycles")
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
    return figure
