"""A figure of a table of windows and its explanations. matplotlib is imported inside the function."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from docs.studies.window_rivals import Explanation, WindowDiagnosis
from identification.show.style import COLOURS, WIDTH, figure, grid, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TITLE = 17  # characters in a line


@styled
def window_figure(found: WindowDiagnosis, shown: Sequence[Explanation]) -> Figure:
    """Both columns of a table of windows, and their explanations.

    Args:
        found: the table (rad/s for ωn) with its scatter.
        shown: explanations, six at most.

    Returns:
        The figure: a column of panels for each explanation, damping above and frequency below, against the
        window's number, each with the table and its scatter.
    """
    fig = figure(WIDTH, 3.9)
    panels = fig.subplots(2, len(shown), sharex=True, sharey="row", squeeze=False)
    window = np.arange(1, found.measured.zeta.size + 1)
    for (above, below), explanation, colour in zip(panels.T, shown, COLOURS, strict=False):
        for axes, column in ((above, "zeta"), (below, "omega_n")):
            axes.errorbar(
                window, getattr(found.measured, column), getattr(found.std, column),
                fmt="o", color="black", ms=2.5, elinewidth=0.8,
            )  # fmt: skip
            axes.plot(window, getattr(explanation.columns, column), color=colour, lw=1.6)
            grid(axes)
        words = explanation.name.replace("_", " ").split(" + ")
        title = " +\n".join(textwrap.fill(name, _TITLE) for name in words)
        above.set_title(title, loc="center", fontsize=7.5)
        below.set_xticks(window[::3])
    panels[0, 0].set_ylabel("ζ [1]")
    panels[1, 0].set_ylabel("ωn [rad/s]")
    fig.align_ylabels(panels[:, 0])
    fig.supxlabel("window of three cycles", fontsize=9)
    return fig
