"""Helpers of the figures of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tunnel_lab.plotting.common import figure_text
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Document = Mapping[str, Any]
BEFORE, AFTER, ACCENT, QUIET = "#D55E00", "#0072B2", "#009E73", "0.55"
WIDTH = 9.0  # inches
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "h")


def array(values: Sequence[float | None]) -> Array:
    """Numbers of a JSON list, NaN where it says null, shape (n,)."""
    return np.array([np.nan if v is None else v for v in values], dtype=np.float64)


def run_label(run: Document) -> str:
    """A run and its conditions in a few words.

    Args:
        run: an entry of ``maps.runs``.

    Returns:
        Text such as ``r02 · 16.1 N m/rad · 15 m/s``.
    """
    parts = [figure_text(str(run["id"]))]
    if run["spring_stiffness"] is not None:
        parts.append(f"{run['spring_stiffness']:.4g} N m/rad")
        parts.append(f"{run['wind_speed']:g} m/s" if run["wind_speed"] > 0 else "wind off")
    return " · ".join(parts)


def plain(name: str) -> str:
    """An effect's name as words: underscores become spaces."""
    return name.replace("_", " ")


def shade(axes: Axes, interval: Sequence[float] | None) -> None:
    """Shade the interval that holds most of the gap.

    Args:
        axes: where.
        interval: its ends, in the unit of the horizontal axis; None: nothing is shaded.
    """
    if interval is not None:
        axes.axvspan(interval[0], interval[1], color="#F0E442", alpha=0.28, linewidth=0)
