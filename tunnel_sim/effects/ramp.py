"""How a drift develops over a run: linearly, or exponentially towards a final value."""

from __future__ import annotations

from typing import Any

import numpy as np

from tunnel_sim.effects.parameters import parameter
from tunnel_sim.vocabulary.record import Array

EQUATION = "(1 − e^(−k t/T))/(1 − e^(−k))"


def settling() -> Any:
    """The form parameter of a drift: run length over the time constant; 0: linear, the textbook form."""
    return parameter(
        "k",
        "1",
        "length of the run over the drift's time constant",
        scale=1.0,
        lower=-30.0,
        upper=30.0,
        form=True,
    )


def ramp(part: Array, rate: float) -> Array:
    """The share of a drift that has developed.

    Args:
        part: elapsed share of the run, t/T, shape (n,).
        rate: run length over the drift's time constant, dimensionless ratio; below 0 the drift accelerates, at 0
            it is linear.

    Returns:
        From 0 to 1 over the run, shape (n,).
    """
    if rate == 0.0:
        return part
    return np.asarray(np.expm1(-rate * part) / np.expm1(-rate), dtype=np.float64)
