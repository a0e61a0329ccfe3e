"""The figure of stated against observed probabilities. matplotlib is imported inside the functions it uses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tunnel_lab.plotting.common import figure, grid, styled
from tunnel_lab.plotting.plots import BLUE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from diagnosis.blind.smooth import SmoothCalibration


@styled
def calibration_figure(found: SmoothCalibration) -> Figure:
    """How often effects act, against the stated probability that they do.

    Args:
        found: calibration of the probabilities.
    """
    fig = figure(5.0, 4.6)
    axes = fig.add_subplot()
    axes.plot([0.0, 1.0], [0.0, 1.0], color="0.4", linewidth=1.0, linestyle="--", label="calibrated")
    axes.fill_between(found.stated, found.low, found.high, color=BLUE, alpha=0.2, linewidth=0.0, label="95 %")
    axes.plot(found.stated, found.observed, color=BLUE, label=f"{found.campaigns} campaigns")
    axes.set(
        xlim=(0.0, 1.0), ylim=(0.0, 1.0),
        xlabel="stated probability that an effect is among the causes", ylabel="share of them that are",
        title=f"smooth calibration error {found.error:.3f}",
    )  # fmt: skip
    axes.legend(loc="upper left")
    grid(axes)
    return fig
