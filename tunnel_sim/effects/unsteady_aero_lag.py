"""An aerodynamic moment that follows the angle late, or leads it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tunnel_sim.effects.base import Circumstances, Effect, Trial, WindOnRun, parameter

#: Share of the first order, a·Cnβ, by which the form leaves Cnr open: chosen on the tuning sets' errors.
_UNSEEN_SHARE = 0.2


@dataclass(frozen=True)
class UnsteadyAeroLag(Effect):
    """An aerodynamic moment that follows the angle late, or leads it.

    Args:
        lag: time constant in units of l/V, l/V.
    """

    name = "unsteady_aero_lag"
    place = 12
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
    example = (1.5,)
    tries = 2
    caveat = (
        "Cnr after is the derivative of the moment's own damping term; the lag acts besides. Over a slow "
        "oscillation the two together give the effective Cnr − a Cnβ, which is what the nominal model finds "
        "(before)."
    )

    lag: float = parameter("a", "l/V", "time constant in units of l/V", scale=0.5, lower=-20.0, upper=20.0)

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """A lag and a lead."""
        del campaign
        scale = cls.parameters()[0].scale
        return [Trial({"lag": scale}, "lag"), Trial({"lag": -scale}, "lag")]

    def unseen_form(self, cn_beta: float, runs: Sequence[WindOnRun]) -> tuple[float, float]:
        """To first order a lag is a change a·Cnβ of Cnr, and only its second order is seen.

        Two time constants, as in Jones's approximation (NACA Report 681, 1940), have a mean up to a third below the
        one that fits, and a lead mirrors them.
        """
        del runs
        return 0.0, _UNSEEN_SHARE * abs(self.lag * cn_beta)

    def law(self) -> Mapping[str, float]:
        """The term of the moment law."""
        return {"aero_lag": self.lag}
