"""The course of a drift over a run: a straight ramp, or one that settles."""

from __future__ import annotations

from typing import Any

import numpy as np

from tunnel_sim.effects.base import parameter
from tunnel_sim.vocabulary.record import Array

EQUATION = "(1 − e^(−k t/T))/(1 − e^(−k))"


def settling() -> Any:
    """The form parameter of a drift: run length over the time constant; 0 is the textbook's straight ramp."""
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
    """How much of the drift has come.

    Args:
        part: of the run that has passed, t/T, shape (n,).
        rate: run length over the drift's time constant; below 0 the drift quickens, at 0 it is straight.

    Returns:
        From 0 to 1 over the run, shape (n,).
    """
    if rate == 0.0:
        return part
    return np.asarray(np.expm1(-rate * part) / np.expm1(-rate), dtype=np.float64)
