"""What no effect explains: the missing moment, or error of the reading, as a curve or a map."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tunnel_lab.diagnosis_view import figures_common as common
from tunnel_lab.plotting.common import WIDTH, figure, grid, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_AXES = {"angle": "angle [rad]", "rate": "rate [rad/s]", "time": "time since the start [s]"}
_BAND = 1.96


@styled
def law_figure(document: common.Document) -> Figure | None:
    """The law without a formula.

    Returns:
        A curve with its 95 % band, or a map in which white cells are within it; None where there is none.
    """
    curve = (document.get("closable") or {}).get("curve")
    if curve is None:
        return None
    shape = [len(axis) for axis in curve["places"]]
    values, std = (np.reshape(curve[name], shape) for name in ("values", "std"))
    unit = "rad" if curve["unit"] == "rad" else "N m" if curve["unit"] == "N m" else "rad/s²"
    name = f"{'error of the reading' if unit == 'rad' else 'missing moment'} [{unit}]"
    fig = figure(WIDTH, 3.2)
    axes = fig.add_subplot()
    axes.set_xlabel(_AXES[curve["over"][0]])
    if len(shape) == 1:
        (place,) = curve["places"]
        axes.fill_between(
            place, values - _BAND * std, values + _BAND * std, color=common.AFTER, alpha=0.25, lw=0
        )
        axes.plot(place, values, color=common.AFTER)
        axes.set_ylabel(name)
        grid(axes)
        return fig
    reach = float(np.max(np.abs(values))) or 1.0
    shown = np.where(np.abs(values) > _BAND * std, values, np.nan)
    mesh = axes.pcolormesh(
        *curve["places"],
        shown.T,
        cmap=common.faded(common.AFTER, common.BEFORE),
        vmin=-reach,
        vmax=reach,
        shading="nearest",
    )
    axes.set_ylabel(_AXES[curve["over"][1]])
    fig.colorbar(mesh, ax=axes, label=name)
    return fig
