"""The picture of an import: each record of the files, where its runs begin, and what is cut off."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from tunnel_lab.plotting.common import figure_text, styled, with_breaks
from tunnel_lab.plotting.plots import BLUE, COLOURS, VERMILION
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tunnel_sim.files.importing.records import Imported, Part

MOST_PANELS = 24
_COLUMNS = 3
_POINTS = 2000  # least and greatest readings of as many stretches are drawn
_GREY = "0.6"


@styled
def import_picture(imported: Imported) -> bytes:
    """Draw what was read.

    Returns:
        A PNG. Samples that are left out are grey; a vertical line marks where a run begins.
    """
    from matplotlib.figure import Figure

    raws = {id(part.raw): part.raw for part in imported.parts}
    shown = list(raws)[:MOST_PANELS]
    columns = min(_COLUMNS, len(shown))
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(max(4.5 * columns, 8.0), 2.2 * rows + 0.8), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for key, axes in zip(shown, panels, strict=False):
        _draw(axes, [part for part in imported.parts if id(part.raw) == key], imported.campaign.sensor.unit)
    for axes in panels[len(shown) :]:
        axes.remove()
    more = f" (the first {MOST_PANELS} of {len(raws)} records)" if len(raws) > MOST_PANELS else ""
    figure.suptitle(
        figure_text(f"{imported.campaign.name}\nruns in colour, samples that are left out in grey{more}"),
        fontsize=9,
    )
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=120)
    return stream.getvalue()


def _draw(axes: Axes, parts: list[Part], unit: str) -> None:
    """One record with its runs."""
    raw = parts[0].raw
    time, reading = raw.cleaned.time_s, raw.cleaned.reading
    axes.plot(*thinned(time, reading), color=_GREY, linewidth=0.7)
    for number, part in enumerate(parts):
        if part.run is None:
            continue
        piece = slice(part.piece.first, part.piece.last)
        colour = COLOURS[number % len(COLOURS)] if len(parts) > 1 else BLUE
        axes.plot(*thinned(time[piece], reading[piece]), color=colour, linewidth=0.7)
        axes.axvline(time[part.piece.first], color=VERMILION, linewidth=0.8, linestyle="--")
    kept = sum(part.run is not None for part in parts)
    about = raw.id if kept == 1 else f"{raw.id}: {kept} runs"
    axes.set_title(figure_text(about), fontsize=9, loc="left")
    axes.set_xlabel("time [s]", fontsize=8)
    axes.set_ylabel(f"reading [{unit}]", fontsize=8)
    axes.tick_params(labelsize=7)


def thinned(time: Array, reading: Array) -> tuple[Array, Array]:
    """A curve with few points that looks the same, and that breaks where samples are missing.

    Args:
        time: shape (n,), s.
        reading: shape (n,).

    Returns:
        Times and readings, shape (m,): the least and the greatest reading of each stretch; NaN within a gap.
    """
    size = time.size // _POINTS
    if size > 1:
        starts = np.arange(0, time.size, size)
        ends = np.stack([np.minimum.reduceat(reading, starts), np.maximum.reduceat(reading, starts)], axis=1)
        time, reading = np.repeat(time[starts], 2), ends.ravel()
    when, values = with_breaks(time, reading)
    return when, values
