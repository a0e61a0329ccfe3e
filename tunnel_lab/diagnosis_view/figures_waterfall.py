"""How far the gap closes with each cause, as steps from the nominal gap down to the noise."""

from __future__ import annotations

import textwrap
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.names import plain
from diagnosis.printing import excess_std, held_out_excess
from tunnel_lab.diagnosis_view import figures_common as common
from tunnel_lab.plotting.common import figure, grid, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tunnel_sim.vocabulary.record import Array

_LABEL = 20  # characters in a line of a label
_LEAST_NOISE = 1e-3  # noise powers: where the document has no maps, and so no noise of an excess


@styled
def waterfall_figure(document: common.Document) -> Figure | None:
    """What is left of the gap as the causes are added one after another.

    Returns:
        A dot for the nominal gap, a bar for each cause from what was left before it to what it leaves, and a dot
        for the rest, on a logarithmic scale. None where no cause is named.
    """
    steps = document.get("waterfall", [])
    if len(steps) < 2:
        return None
    noise = common.SIGMAS * (excess_std(document) or _LEAST_NOISE)
    left = np.array([step["excess"] for step in steps], np.float64)
    alone = np.array(list(document.get("without", {}).values()), np.float64)
    fig = figure(common.NARROW, 1.2 + 0.4 * (left.size + 1))
    axes = fig.add_subplot()
    floor = common.noise_axis(axes, noise, float(np.concatenate([left, alone]).max()))
    axes.set_xlim(None, 12.0 * axes.get_xlim()[1])  # room for the numbers
    _steps(axes, left, floor)
    _alone(axes, document, floor)
    names = [textwrap.fill(f"+ {plain(str(step['effect']))}", _LABEL) for step in steps[1:]]
    axes.set_yticks(
        range(left.size + 1), ["nominal model", *names, textwrap.fill(_rest_name(document), _LABEL)]
    )
    axes.invert_yaxis()
    fig.legend(loc="outside upper left", ncols=2)
    grid(axes, "x")
    return fig


def _steps(axes: Axes, left: Array, floor: float) -> None:
    """What each cause closes (or opens) as a bar between two values; the first and the last value as dots."""
    shown = np.maximum(left, floor)
    starts, ends = np.minimum(shown[:-1], shown[1:]), np.maximum(shown[:-1], shown[1:])
    colours = [common.AFTER if after <= before else common.BEFORE for before, after in pairwise(left)]
    rows = np.arange(left.size + 1)
    axes.barh(rows[1:-1], ends - starts, left=starts, color=colours, height=0.55)
    for row, value, colour in ((0, shown[0], common.BEFORE), (rows[-1], shown[-1], common.ACCENT)):
        axes.plot(value, row, "o", color=colour, ms=8)
    axes.vlines(shown, rows[:-1], rows[1:], color=common.QUIET, linewidth=0.8)
    texts = [held_out_excess(value) for value in left.tolist()]
    words = [texts[0], *(f"leaves {text}" for text in texts[1:]), texts[-1]]
    for row, (text, end) in enumerate(zip(words, [shown[0], *ends, shown[-1]], strict=True)):
        axes.annotate(text, (float(end), row), (7, 0), textcoords="offset points", va="center")


def _alone(axes: Axes, document: common.Document, floor: float) -> None:
    """Mark what is left without each cause alone, where there are several."""
    without = document.get("without", {})
    rows = {step["effect"]: row for row, step in enumerate(document["waterfall"])}
    if len(without) < 2:
        return
    values = np.maximum(list(without.values()), floor)
    places = [rows[name] for name in without]
    axes.plot(values, places, "o", color=common.INK, mfc=common.PAPER, ms=5, label="without it alone")


def _rest_name(document: common.Document) -> str:
    rest = document.get("rest") or {}
    if not rest.get("significant"):
        return "the rest: within the noise"
    return "the rest: material" if rest.get("material") else "the rest: immaterial"
