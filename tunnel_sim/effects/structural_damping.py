"""Hysteretic loss in spring and rod: the same share of the energy per cycle at every frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log, pi, sqrt

from tunnel_sim.effects.base import Effect, Law
from tunnel_sim.effects.parameters import WindOnRun, parameter


@dataclass(frozen=True)
class StructuralDamping(Effect):
    """Hysteretic loss in spring and rod: the same share of the energy per cycle at every frequency.

    Args:
        loss_factor: loss factor, dimensionless.
    """

    name = "structural_damping"
    place = 3
    channel = "damping"
    condition = "always"
    advice = "Model the hysteretic loss: the same share of the energy per cycle at every frequency"
    equation = "−(η Kr/ωn) β̇ with ωn = √(Kr/Izz)"
    signature = (
        "Each run is linear, but the damping moment grows with the square root of the spring's stiffness."
    )
    references = ("Crandall, J. Sound Vib. 11 (1970) 3, doi 10.1016/S0022-460X(70)80105-5",)
    example = (0.02,)

    loss_factor: float = parameter("η", "1", "loss factor", scale=0.005, lower=-1.0, upper=1.0, fit_lower=0.0)

    def unseen_form(self, cn_beta: float, runs: Sequence[WindOnRun]) -> tuple[float, float]:
        """Runs cannot show which frequency sets the loss: that of the motion, or that of the rig in still air.

        Causality may also stiffen the spring by (2η/π) ln(ω/ωn) (Crandall, J. Sound Vib. 11 (1970) 3). The
        truth may lie between the two cases; their difference counts as a rectangular half-width.
        """
        del cn_beta
        if not runs:
            return 0.0, 0.0
        stiffening = [
            2.0 * self.loss_factor / pi * r.spring_stiffness * log(r.still_omega / r.omega) / r.per_cn_beta
            for r in runs
        ]
        loss = [
            self.loss_factor
            * (r.spring_stiffness / r.omega - r.spring_stiffness / r.still_omega)
            / r.per_cn_r
            for r in runs
        ]
        cn_beta_std, cn_r_std = (abs(sum(s)) / len(s) / sqrt(3.0) for s in (stiffening, loss))
        return cn_beta_std, cn_r_std

    def law(self) -> Law:
        """The effect's terms of the moment law."""
        return {"loss_factor": self.loss_factor}
