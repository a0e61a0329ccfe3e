"""The trace of a run up to any time, without drawing the axes again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tunnel_lab.plotting.style import with_breaks
from tunnel_sim.vocabulary.record import Array, Record

Image = NDArray[np.uint8]
_DPI = 100
_DOT = 5  # pixels
_CURSOR = (90, 90, 90)
_VERMILION = (213, 94, 0)


@dataclass(frozen=True, eq=False)
class Trace:
    """Two drawings of the same axes, and the positions of the samples.

    Args:
        faint: all of the trace in grey, shape (height, width, 3).
        full: all of it in colour, of the same shape.
        time: of the samples, shape (n,), s.
        columns: of the samples, shape (n,), pixels from the left.
        rows: of the samples, shape (n,), pixels from the top.
        top: first row of the axes, pixels.
        bottom: last row, pixels.
    """

    faint: Image
    full: Image
    time: Array
    columns: Array
    rows: Array
    top: int
    bottom: int

    def at(self, time: float) -> Image:
        """The trace up to a time.

        Args:
            time: s from the release.

        Returns:
            RGB, shape (height, width, 3).
        """
        picture = self.faint.copy()
        column = round(float(np.interp(time, self.time, self.columns)))
        row = round(float(np.interp(time, self.time, self.rows)))
        picture[:, : column + 1] = self.full[:, : column + 1]
        picture[self.top : self.bottom, column] = _CURSOR
        down, across = np.ogrid[: picture.shape[0], : picture.shape[1]]
        picture[(down - row) ** 2 + (across - column) ** 2 <= _DOT**2] = _VERMILION
        return picture


def draw_trace(record: Record, width: int, height: int, title: str) -> Trace:
    """Draw a record's axes once.

    Args:
        width: pixels.
        height: pixels.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI)
    figure.set_layout_engine("constrained", w_pad=0.15, h_pad=0.1)  # inches
    canvas: Any = FigureCanvasAgg(figure)  # matplotlib types it in parts only
    axes = figure.add_subplot()
    time, angle = record.time_s - record.time_s[0], record.yaw_rad
    (line,) = axes.plot(*with_breaks(time, angle), color="0.85", linewidth=1.2)
    axes.set_xlim(time[0], time[-1])
    axes.set_xlabel("time [s]")
    axes.set_ylabel("angle β [rad]")
    axes.set_title(title, fontsize=10, wrap=True)
    axes.grid(alpha=0.3)
    faint = _pixels(canvas)
    line.set_color("#0072B2")
    full = _pixels(canvas)
    places = axes.transData.transform(np.column_stack((time, angle)))
    box = axes.get_window_extent()
    return Trace(
        faint,
        full,
        time,
        np.clip(places[:, 0], 0.0, width - 1.0),
        np.clip(height - 1.0 - places[:, 1], 0.0, height - 1.0),
        round(height - box.y1),
        round(height - box.y0),
    )


def _pixels(canvas: Any) -> Image:
    canvas.draw()
    return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3], dtype=np.uint8)
