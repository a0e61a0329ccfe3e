"""Figures of the paper that no other module draws. matplotlib is imported inside the functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from identification.campaign.springs import SpringFit
from identification.datasets import SpringRow
from identification.decay.damped_oscillation import Decay, free_decay
from tunnel_lab.paper.equations import printed_transfer_function
from tunnel_lab.plotting.style import BLUE, COLOURS, VERMILION, WIDTH, figure, grid, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DRAWN_ZETA = (0.01, 0.05, 0.1, 0.35)
_PRINTED_ZETA = 0.1


@styled
def springs_figure(springs: Sequence[SpringRow], fit: SpringFit, stated: float) -> Figure:
    """The springs and their line, and how far each is from it.

    Args:
        springs: of Table II.
        fit: of the same springs.
        stated: inertia of Table I, kg m².
    """
    fig = figure(WIDTH, 2.9)
    left, right = fig.subplots(1, 2)
    square = np.array([(2.0 * np.pi * spring.frequency_hz) ** 2 for spring in springs])
    stiffness = np.array([spring.stiffness_n_m_per_rad for spring in springs])
    ends = np.array([0.0, 1.03 * square.max()])
    left.plot(square, stiffness, "o", color=BLUE, ms=4, label="Table II")
    left.plot(
        ends,
        fit.inertia.value * ends + fit.intercept.value,
        color=BLUE,
        label=f"gradient {fit.inertia.value:.4f} kg m²",
    )
    left.plot(ends, stated * ends, "--", color=VERMILION, label=f"Table I: {stated:g} kg m²")
    left.set(xlabel="ωn² [rad²/s²]", ylabel="stiffness Kr [N m/rad]", xlim=(0.0, ends[1]), ylim=(0.0, None))
    left.legend(loc="upper left")
    numbers = [spring.number for spring in springs]
    right.axhline(0.0, color="0.4", lw=0.8)
    right.vlines(numbers, 0.0, fit.residual_percent, color=BLUE, lw=0.8)
    right.plot(numbers, fit.residual_percent, "o", color=BLUE, ms=4)
    right.set(xlabel="spring", ylabel="stiffness against the line [%]")
    right.set_xticks(numbers)
    for axes in (left, right):
        grid(axes)
    return fig


@styled
def impulse_figure() -> Figure:
    """Fig. 2: impulse responses over ωn t, the largest value 1; and eq. 12 as printed for one of them."""
    fig = figure(WIDTH, 3.0)
    axes = fig.add_subplot()
    time = np.linspace(0.0, 6.6 * np.pi, 1200)
    for zeta, colour in zip(_DRAWN_ZETA, COLOURS, strict=False):
        response = free_decay(time, Decay.from_modal(1.0, zeta), 0.0, 1.0)
        axes.plot(time, response / response.max(), color=colour, label=f"ζ = {zeta:g}")
    wrong = np.sin(printed_transfer_function(_PRINTED_ZETA, 1.0).omega_n * time)
    axes.plot(time, wrong, ":", color="black", lw=1.0, label=f"eq. 12 as printed, ζ = {_PRINTED_ZETA:g}")
    axes.axvspan(0.0, 6.0 * np.pi, color="#e6e9ec", lw=0, zorder=0)
    axes.set(
        xlabel="ωn t [rad]; shaded: three cycles",
        ylabel="response over its largest value",
        xlim=(0.0, time[-1]),
    )
    axes.set_xticks(2.0 * np.pi * np.arange(4), ["0", "2π", "4π", "6π"])
    fig.legend(loc="outside upper center", ncols=5)
    grid(axes)
    return fig
