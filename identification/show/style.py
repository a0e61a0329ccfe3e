"""The common style of all figures, and their output. matplotlib is imported inside the functions.

The colours follow Okabe and Ito (2008), which colour-blind readers can distinguish.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, wraps
from importlib import resources
from itertools import pairwise
from math import ceil, floor, inf, log10
from pathlib import Path
from threading import RLock
from typing import TYPE_CHECKING, Literal, ParamSpec, TypeVar

import numpy as np

from tunnel_sim.files.writing import write_encoded
from tunnel_sim.vocabulary.record import Array, gaps

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

WIDTH = 7.2
"""Width of a figure that fills a page, inches."""
_FEW_DECADES = 2.5
_STEPS = ((1.0, 1.5, 2.0, 3.0, 5.0, 7.0), (1.0, 2.0, 5.0), (1.0, 3.0), (1.0,))
_DIGIT, _POWER = 0.075, 0.24  # inches: a digit of a label, and a label such as 10² with the gap after it
_WIDE = 5.0  # multiple of the median standard deviation
P = ParamSpec("P")
R = TypeVar("R")


COLOURS = (
    "#0072b2", "#d55e00", "#009e73", "#b0529b", "#9a6f00", "#2f8fb0", "#b5484f", "#6f8200", "#7a63c7", "#77808a",
    "#c88090", "#207060", "#7090f0", "#989860", "#b878d8", "#805870",
)  # fmt: skip
"""The colour cycle of `figures.mplstyle`."""


BLUE, VERMILION = COLOURS[:2]


MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "h")


_STYLE = RLock()
"""The lock of matplotlib's style, a state of the process that two threads of the bench must not change at once."""


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """A function drawing in the style of `figures.mplstyle`, without changing the settings of the process."""

    @wraps(draw)
    def drawn(*args: P.args, **named: P.kwargs) -> R:
        from matplotlib import style

        file = resources.files("identification.show") / "figures.mplstyle"
        with _STYLE, resources.as_file(file) as path, style.context(path):
            return draw(*args, **named)

    return drawn


def figure(width: float, height: float) -> Figure:
    """An empty figure, made without pyplot to avoid global state.

    Args:
        width: inches.
        height: inches.
    """
    return _laid_out_once()(figsize=(width, height), layout="constrained")


@cache
def _laid_out_once() -> type[Figure]:
    from matplotlib.backend_bases import RendererBase
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    class LaidOutOnce(Figure):
        def draw(self, renderer: RendererBase) -> None:
            """Compute the layout only for ``savefig``, which then draws again without this engine."""
            engine = self.get_layout_engine()
            if isinstance(engine, ConstrainedLayoutEngine) and self.canvas.is_saving():
                engine.execute(self)
            else:
                super().draw(renderer)

    return LaidOutOnce


def text_width(text: str, points: float) -> float:
    """Width of the longest line of a text, inches.

    Args:
        text: without formulas.
        points: size of the font, in 72nds of inches.
    """
    from matplotlib.textpath import TextPath

    paths = [TextPath((0, 0), line, size=points) for line in text.splitlines() if line.strip()]
    return max((float(path.get_extents().width) / 72.0 for path in paths), default=0.0)


def grid(axes: Axes, axis: Literal["both", "x", "y"] = "both") -> None:
    """A quiet grid behind the data."""
    axes.grid(visible=True, axis=axis)


def log_axis(axes: Axes, which: Literal["x", "y"], room: float = inf) -> None:
    """Make an axis logarithmic, with labels few enough not to touch.

    On a short axis Matplotlib also labels ticks between the powers of ten, such as 6×10⁰.

    Args:
        axes: axes with their data already drawn, because the labels depend on the limits.
        room: length of a horizontal axis, inches, if the axis may be too short for the labels.
    """
    from matplotlib.ticker import FuncFormatter, LogFormatterSciNotation, LogLocator, NullFormatter

    least = axes.dataLim.minposx if which == "x" else axes.dataLim.minposy
    if not np.isfinite(least):  # no drawn value can be shown on a logarithmic axis
        return
    axis: Axis
    if which == "x":
        axes.set_xscale("log")
        axis, limits = axes.xaxis, axes.get_xlim()
    else:
        axes.set_yscale("log")
        axis, limits = axes.yaxis, axes.get_ylim()
    decades = log10(max(limits) / min(limits))
    axis.set_minor_formatter(NullFormatter())
    if decades > _FEW_DECADES:
        axis.set_major_locator(LogLocator(10.0, (1.0,), numticks=int(min(8, max(2, room / _POWER)))))
        axis.set_major_formatter(LogFormatterSciNotation(10.0))
    else:
        steps = next((one for one in _STEPS[decades > 1.0 :] if _fit(one, limits, room)), _STEPS[-1])
        axis.set_major_locator(LogLocator(10.0, steps))
        plain = min(limits) >= 1e-4 and max(limits) < 1e5
        powers = LogFormatterSciNotation(10.0, minor_thresholds=(np.inf, np.inf))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}") if plain else powers)


def _fit(steps: Sequence[float], limits: tuple[float, float], room: float) -> bool:
    """Whether the labels of a logarithmic axis do not touch.

    Args:
        steps: labelled multiples of every power of ten.
        limits: limits of the axis, above 0, in its unit.
        room: length of the axis, inches.
    """
    low, high = log10(min(limits)), log10(max(limits))
    exponents = range(floor(low), ceil(high) + 1)
    ticks = sorted(step * 10.0**power for power in exponents for step in steps)
    shown = [tick for tick in ticks if low <= log10(tick) <= high]
    widths = [_DIGIT * len(f"{tick:g}") for tick in shown]
    apart = [room * log10(after / before) / (high - low) for before, after in pairwise(shown)]
    return all(
        gap >= 0.5 * (one + other) + _DIGIT for gap, (one, other) in zip(apart, pairwise(widths), strict=True)
    )


def limit_to_known(axes: Axes, values: Array, stds: Array) -> None:
    """Limit the vertical axis to values of usual uncertainty, with their 95 % intervals.

    Otherwise a few very uncertain values, such as the last cycles of a decay, would determine the scale.
    Their intervals extend beyond the axis.

    Args:
        values: values, shape (n,), in the axis' unit; NaN for a missing value.
        stds: standard deviations, shape (n,), in the same unit.
    """
    known_at_all = np.isfinite(values) & np.isfinite(stds)
    if not known_at_all.any():
        return
    known = known_at_all & (stds <= _WIDE * np.median(stds[known_at_all]))
    low, high = np.min((values - 2.0 * stds)[known]), np.max((values + 2.0 * stds)[known])
    margin = 0.05 * (high - low) or 0.1 * abs(high) or 1.0
    axes.set_ylim(low - margin, high + margin)


def with_breaks(time: Array, *readings: Array) -> tuple[Array, ...]:
    """Curves broken where samples are missing, instead of a straight line across the gap.

    Args:
        time: shape (n,), s, increasing.
        readings: at these times, shape (n,) each.

    Returns:
        The time and the readings, shape (m,) each; in the middle of every gap they have a time with readings of
        NaN.
    """
    after = np.flatnonzero(gaps(time)) + 1
    middles = 0.5 * (time[after - 1] + time[after])
    return np.insert(time, after, middles), *(np.insert(reading, after, np.nan) for reading in readings)


def figure_text(text: str) -> str:
    """A text from the user, such as the id of a run, escaped so that matplotlib shows it unchanged.

    Dollar signs, which would begin a formula, are escaped. A leading underscore, which would hide the text in a
    legend, is preceded by a blank.
    """
    return (" " if text.startswith("_") else "") + text.replace("$", r"\$")


@styled
def save(figure: Figure, path: Path) -> Path:
    """Write a figure as ``.png`` or ``.pdf``, completely or not at all; files are reproducible."""
    form = path.suffix[1:]
    dates = {"CreationDate": None} if form == "pdf" else None
    return write_encoded(path, lambda stream: figure.savefig(stream, format=form, metadata=dates))


def save_both(figure: Figure, path: Path) -> tuple[Path, Path]:
    """Write a figure as a picture, ``.png``, and as a vector graphic, ``.pdf``, beside it."""
    return save(figure, path), save(figure, path.with_suffix(".pdf"))
