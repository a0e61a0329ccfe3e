"""What all figures have in common. matplotlib is imported inside the functions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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
    axes.grid(visible=True, axis=axis, color="0.88", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def figure_text(text: str) -> str:
    """A text of the user's, such as the id of a run, as matplotlib has to be given it to show it as it is.

    Dollar signs would begin a formula, and a legend leaves out what begins with an underscore.

    Returns:
        The text with its dollar signs escaped, and with a blank before a leading underscore.
    """
    return (" " if text.startswith("_") else "") + text.replace("$", r"\$")
