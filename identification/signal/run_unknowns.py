"""The unknowns of one run in a linear fit of its motion, and their values at the optimum."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal, TypeAlias

import numpy as np

from identification.signal.free_decay import Decay
from identification.statistics import eliminate
from tunnel_sim.vocabulary.quantities import Gain, Rad, RadPerS
from tunnel_sim.vocabulary.record import Array

# Local order of one run's unknowns throughout: decay rate, stiffness | zero (or constant acceleration) |
# initial angle, initial rate | gain of its input, if it has one.
RATE, STIFFNESS, ZERO, ANGLE, ANGULAR_RATE, GAIN = range(6)

Zero: TypeAlias = Annotated[float, "rad, the sensor's; without a spring the constant acceleration, rad/s²"]
ZeroKind = Literal["shared", "own", "known"]
"""Whether the sensor's zero is an unknown of all runs together, of every run, or known."""


@dataclass(frozen=True, eq=False)
class RunUnknowns:
    """The unknowns of one run.

    Args:
        angle: initial angle from the sensor's zero, rad.
        rate: initial rate, rad/s.
        gain: gain of the input; 0 without an input.
    """

    decay: Decay
    zero: Zero
    angle: Rad
    rate: RadPerS
    gain: Gain = 0.0


@dataclass(frozen=True, eq=False)
class RunFit(RunUnknowns):
    """One run at the optimum.

    Args:
        residual: reading less model, shape (n,), rad.
        information: JᵀJ in the local order, shape (5, 5), or (6, 6) with a gain; divide by the noise variance for
            Fisher's.
        score: Jᵀ residual, shape (5,) or (6,).
    """

    residual: Array = field(kw_only=True)
    information: Array = field(kw_only=True)
    score: Array = field(kw_only=True)

    @property
    def coefficients(self) -> list[int]:
        """Places of a and k, and of the gain if there is one, in the local order."""
        return [RATE, STIFFNESS, GAIN][: len(self.score) - 3]

    def reduced(self, zero: ZeroKind) -> tuple[Array, Array]:
        """Information and score of the coefficients, and of a shared zero last; the other unknowns eliminated."""
        kept = [*self.coefficients, *([ZERO] if zero == "shared" else [])]
        order = [*kept, *([ZERO] if zero == "own" else []), ANGLE, ANGULAR_RATE]
        return eliminate(self.information[np.ix_(order, order)], self.score[order], len(kept))
