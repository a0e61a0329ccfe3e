"""Backbone curves: frequency and damping against amplitude."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tunnel_lab.diagnosis_view.figures_common import INK, Document, array, drawn_label
from tunnel_lab.plotting.common import WIDTH, figure, grid, limit_to_known, log_axis, styled
from tunnel_lab.plotting.plots import COLOURS, MARKERS
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_CURVES = len(COLOURS)
_LEGEND, _HANDLE = 108, 8  # characters: the width of the figure, and the line beside a label


@styled
def backbone_figure(document: Document) -> Figure:
    """Frequency and damping of the runs that show the gap against amplitude, with 95 % bands.

    Args:
        document: a diagnosis with its maps.

    Returns:
        Two panels: frequency relative to the nominal model's, and damping ratio minus the nominal model's.
    """
    maps = document["maps"]
    curves = [curve for curve in maps["backbones"] if len(curve["time_s"]) > 1]
    named = [curve for curve in curves if curve["id"] in document["where"]["runs"]]
    # the runs that show the gap first, in the campaign's order, and then the rest for comparison
    chosen = (named + [curve for curve in curves if curve not in named])[:_MOST_CURVES]
    labels = {run["id"]: drawn_label(run) for run in maps["runs"]}
    fig = figure(WIDTH, 4.6)
    frequency, damping = fig.subplots(1, 2)
    shifts, changes = [], []
    for index, curve in enumerate(chosen):
        amplitude = array(curve["amplitude_rad"])
        nominal = curve["nominal_frequency_hz"]
        style = {"color": COLOURS[index], "marker": MARKERS[(index + index // len(MARKERS)) % len(MARKERS)]}
        shift = 100.0 * (array(curve["frequency_hz"]) / nominal - 1.0)
        shift_std = 100.0 * array(curve["frequency_std"]) / nominal
        _curve(frequency, amplitude, shift, shift_std, style)
        change = 1e3 * (array(curve["zeta"]) - curve["nominal_zeta"])
        change_std = 1e3 * array(curve["zeta_std"])
        _curve(damping, amplitude, change, change_std, style, labels[curve["id"]])
        shifts.append((shift, shift_std))
        changes.append((change, change_std))
    for axes, name in ((frequency, "frequency against the nominal model [%]"),
                       (damping, "damping ratio minus the nominal one [10⁻³]")):  # fmt: skip
        axes.axhline(0.0, color=INK, linewidth=1.0)
        axes.set_xlabel("amplitude [rad]")
        axes.set_ylabel(name)
        grid(axes)
    for axes, pairs in ((frequency, shifts), (damping, changes)):
        if pairs:
            limit_to_known(axes, *(np.concatenate(column) for column in zip(*pairs, strict=True)))
            log_axis(axes, "x")
    if chosen:
        longest = max(len(labels[curve["id"]]) for curve in chosen)
        columns = min(3, _LEGEND // (longest + _HANDLE)) or 1
        fig.legend(loc="outside lower center", ncols=columns)
    return fig


def _curve(
    axes: Axes, x: Array, y: Array, std: Array, style: dict[str, Any], label: str | None = None
) -> None:
    order = np.argsort(x)
    colour, marker = style["color"], str(style["marker"])
    band = 1.96 * std[order]
    axes.fill_between(x[order], y[order] - band, y[order] + band, color=colour, alpha=0.15, linewidth=0)
    axes.plot(x[order], y[order], color=colour, marker=marker, ms=3.5, lw=1.0, label=label)
