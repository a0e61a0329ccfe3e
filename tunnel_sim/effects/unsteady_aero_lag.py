"""An aerodynamic moment that follows the angle late, or leads it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect, parameter, with_law
from tunnel_sim.run_settings import RunSettings


@dataclass(frozen=True)
class UnsteadyAeroLag(Effect):
    """An aerodynamic moment that follows the angle late, or leads it.

    Args:
        lag: time constant in units of l/V, l/V.
    """

    name = "unsteady_aero_lag"
    channel = "damping"
    condition = "wind_on"
    equation = (
        "Ka x in place of Ka β, τ ẋ = β − x, τ = a l/V; for a < 0 the mirrored lead Ka (2β − x) with |τ|"
    )
    signature = (
        "To first order a change of Cnr, which absorbs it; what is left is of second order in τω "
        "and shows across springs and speeds."
    )
    references = (
        "Theissen, Unsteady Vehicle Aerodynamics in Gusty Crosswind (dissertation), TU München 2012",
        "Jones, NACA Report 681 (1940)",
    )

    lag: float = parameter("a", "l/V", "time constant in units of l/V", scale=0.5, lower=-20.0, upper=20.0)

    def on_run(self, run: RunSettings, stated: RunSettings, rng: np.random.Generator) -> RunSettings:
        """Set the moment law's term."""
        del stated, rng
        return with_law(run, aero_lag=self.lag)
