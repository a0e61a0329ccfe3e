"""What all figures have in common. matplotlib is imported inside the functions."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from importlib import resources
from typing import TYPE_CHECKING, Literal, ParamSpec, TypeVar

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

P = ParamSpec("P")
R = TypeVar("R")


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """A function that draws in the style of `figures.mplstyle`, without changing the settings of the process."""

    @wraps(draw)
    def drawn(*args: P.args, **named: P.kwargs) -> R:
        from matplotlib import style

        file = resources.files("tunnel_lab.plotting") / "figures.mplstyle"
        with resources.as_file(file) as path, style.context(path):
            return draw(*args, **named)

    return drawn


def figure(width: float, height: float) -> Figure:
    """An empty figure; made without pyplot, so that no global state is touched.

    Args:
        width: inches.
        height: inches.
    """
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def grid(axes: Axes, axis: Literal["both", "x", "y"] = "both") -> None:
    """A quiet grid behind the data."""
    axes.grid(visible=True, axis=axis)


def figure_text(text: str) -> str:
    """A text of the user's, such as the id of a run, as matplotlib has to be given it to show it as it is.

    Dollar signs would begin a formula, and a legend leaves out what begins with an underscore.

    Returns:
        The text with its dollar signs escaped, and with a blank before a leading underscore.
    """
    return (" " if text.startswith("_") else "") + text.replace("$", r"\$")
