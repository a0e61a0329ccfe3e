"""How far the gap closes with each cause, as steps from the nominal gap down to the noise."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.printing import excess_std, held_out_excess
from tunnel_lab.diagnosis_view import figures_common as common
from tunnel_lab.plotting.common import figure, grid

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tunnel_sim.vocabulary.record import Array

_SIGMAS = 3.0
_LEAST_NOISE = 1e-3  # noise powers: where the document has no maps, and so no noise of an excess


def waterfall_figure(document: common.Document) -> Figure | None:
    """What is left of the gap as the causes are added one after another.

    Returns:
        A bar for the nominal gap; for each cause one from what was left before it to what it leaves; and one for
        the rest, on a logarithmic scale. None where no cause is named.
    """
    steps = document.get("waterfall", [])
    if len(steps) < 2:
        return None
    noise = _SIGMAS * (excess_std(document) or _LEAST_NOISE)
    floor = 0.1 * noise
    left = np.array([step["excess"] for step in steps], np.float64)
    fig = figure(common.WIDTH, 1.5 + 0.42 * (left.size + 1))
    axes = fig.add_subplot()
    axes.set_xscale("log")
    axes.axvspan(floor, noise, color="0.92", linewidth=0, label="noise (3σ)")
    _bars(axes, left, floor)
    greatest = max(float(left.max()), _alone(axes, document, floor), 10.0 * noise)
    names = [f"+ {common.plain(str(step['effect']))}" for step in steps[1:]]
    axes.set_yticks(range(left.size + 1), ["nominal model", *names, _rest_name(document)])
    axes.set_xlim(floor, 20.0 * greatest)
    axes.invert_yaxis()
    axes.set_xlabel("excess: mean squared residual over noise variance, minus one")
    fig.legend(loc="outside upper left", ncols=2, fontsize=8, frameon=False)
    grid(axes)
    return fig


def _bars(axes: Axes, left: Array, floor: float) -> None:
    """The nominal gap, what each cause closes (or opens), and the rest, with their values."""
    shown = np.maximum(left, floor)
    starts = np.array([floor, *np.minimum(shown[:-1], shown[1:]), floor])
    ends = np.array([shown[0], *np.maximum(shown[:-1], shown[1:]), shown[-1]])
    steps = [common.AFTER if after <= before else common.BEFORE for before, after in pairwise(left)]
    rows = np.arange(left.size + 1)
    axes.barh(rows, ends - starts, left=starts, color=[common.BEFORE, *steps, common.ACCENT], height=0.6)
    axes.vlines(shown, rows[:-1], rows[1:], color=common.QUIET, linewidth=0.8)
    texts = [held_out_excess(value) for value in left.tolist()]
    words = [texts[0], *(f"leaves {text}" for text in texts[1:]), texts[-1]]
    for row, text in enumerate(words):
        place = (float(ends[row]), float(row))
        axes.annotate(text, place, (7, 0), textcoords="offset points", va="center", fontsize=9)


def _alone(axes: Axes, document: common.Document, floor: float) -> float:
    """Mark what is left without each cause alone, where there are several; returns the greatest."""
    without = document.get("without", {})
    rows = {step["effect"]: row for row, step in enumerate(document["waterfall"])}
    if len(without) < 2:
        return 0.0
    values = np.maximum(list(without.values()), floor)
    places = [rows[name] for name in without]
    axes.plot(values, places, "o", color="0.25", mfc="white", ms=6, label="without it alone")
    return float(values.max())


def _rest_name(document: common.Document) -> str:
    rest = document.get("rest") or {}
    if not rest.get("significant"):
        return "the rest: within the noise"
    return "the rest: material" if rest.get("material") else "the rest: immaterial"
