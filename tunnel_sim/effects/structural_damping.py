"""Hysteretic loss in spring and rod, the same share of energy a cycle at any frequency."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect, parameter, with_law
from tunnel_sim.run_settings import RunSettings


@dataclass(frozen=True)
class StructuralDamping(Effect):
    """Hysteretic loss in spring and rod, the same share of energy a cycle at any frequency.

    Args:
        loss_factor: loss factor, dimensionless.
    """

    name = "structural_damping"
    channel = "damping"
    condition = "always"
    equation = "−(η Kr/ωn) β̇, ωn = √(Kr/Izz)"
    signature = (
        "Linear in every run, but the damping moment grows with the square root of the spring's stiffness."
    )
    references = ("Crandall, J. Sound Vib. 11 (1970) 3, doi 10.1016/S0022-460X(70)80105-5",)

    loss_factor: float = parameter("η", "1", "loss factor", scale=0.005, lower=-1.0, upper=1.0)

    def on_run(self, run: RunSettings, stated: RunSettings, rng: np.random.Generator) -> RunSettings:
        """Set the moment law's term."""
        del stated, rng
        return with_law(run, loss_factor=self.loss_factor)
