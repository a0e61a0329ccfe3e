"""An aerodynamic moment that lags or leads the yaw angle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tunnel_sim.effects.base import Effect, Law
from tunnel_sim.effects.parameters import Circumstances, Trial, WindOnRun, parameter

#: Uncertainty of Cnr as a share of the first-order effect a·Cnβ, chosen from the errors in the tuning sets.
_UNSEEN_SHARE = 0.2


@dataclass(frozen=True)
class UnsteadyAeroLag(Effect):
    """An aerodynamic moment that lags or leads the yaw angle.

    Args:
        lag: time constant in units of l/V, l/V.
    """

    name = "unsteady_aero_lag"
    place = 12
    channel = "damping"
    condition = "wind_on"
    advice = "Model the lag of the aerodynamic moment"
    equation = (
        "Ka x instead of Ka β, with τ ẋ = β − x, τ = a l/V; for a < 0 a phase lead: Ka (2β − x) with |τ|"
    )
    signature = (
        "To first order it is a change of Cnr, which absorbs it; the remainder is of second order in τω "
        "and shows when springs and speeds are compared."
    )
    references = (
        "Theissen, Unsteady Vehicle Aerodynamics in Gusty Crosswind (dissertation), TU München 2012",
        "Jones, NACA Report 681 (1940)",
    )
    example = (1.5,)
    tries = 2
    caveat = (
        "The Cnr after adding the lag describes the damping term alone; the lag damps the motion as well. In a "
        "slow oscillation both together act as an effective Cnr − a Cnβ, which is what the nominal model finds "
        "(before)."
    )

    lag: float = parameter("a", "l/V", "time constant in units of l/V", scale=0.5, lower=-20.0, upper=20.0)

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """First a phase lag, then a phase lead."""
        del campaign
        scale = cls.parameters()[0].scale
        return [Trial({"lag": scale}, "lag"), Trial({"lag": -scale}, "lag")]

    def unseen_form(self, cn_beta: float, runs: Sequence[WindOnRun]) -> tuple[float, float]:
        """To first order a lag only changes Cnr by a·Cnβ; runs show the second-order remainder alone.

        With two time constants, as in Jones's approximation (NACA Report 681, 1940), their mean is up to a third
        below the single constant that fits best; the same holds for a phase lead.
        """
        del runs
        return 0.0, _UNSEEN_SHARE * abs(self.lag * cn_beta)

    def law(self) -> Law:
        """The effect's terms of the moment law."""
        return {"aero_lag": self.lag}
