"""Effects of one's own for the tests: a class and an expression."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from tunnel_sim.effects import Effect
from tunnel_sim.effects.expression_effect import ExpressionParameter, expression_effect
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.physics.run_settings import RunSettings


@dataclass(frozen=True)
class OwnCubic(Effect):
    """A spring whose stiffness grows with the angle."""

    name = "own_cubic"
    channel = "stiffness"
    condition = "always"
    equation = "-k*Kr*b^3"
    signature = "That of cubic stiffness."
    references = ()
    example = (1.0,)

    hardening: float = parameter("k", "1/rad2", "hardening", scale=0.2, lower=-10.0, upper=50.0)

    def law(self) -> Mapping[str, float]:
        return {"stiffness_cubic": self.hardening}

    def moment_oracle(self, stated: RunSettings) -> Callable[[float, float, float], float] | None:
        return lambda _t, angle, _rate: -self.hardening * stated.spring_stiffness * angle**3


CUBIC = expression_effect(
    "stated_cubic",
    channel="stiffness",
    moment="-k*Kr*b^3",
    parameters={"k": ExpressionParameter("1/rad2", 0.2, -10.0, 50.0, 0.0, "hardening")},
)

DETENT = expression_effect(
    "detent",
    channel="stiffness",
    moment="-k*b*exp(-(b/w)^2)",
    parameters={
        "k": ExpressionParameter("N m/rad", 0.1, 0.0, 50.0, 0.0, "stiffness at the centre"),
        "w": ExpressionParameter("rad", 0.05, 0.01, 0.3, 0.06, "width"),
    },
)

EFFECTS_FILE = """
[[effects]]
name = "detent"
channel = "stiffness"
moment = "-k*b*exp(-(b/w)^2)"
parameters.k = { unit = "N m/rad", scale = 0.1, lower = 0.0, upper = 50.0 }
parameters.w = { unit = "rad", scale = 0.05, lower = 0.01, upper = 0.3, default = 0.06 }

[[effects]]
name = "gain"
channel = "sensor"
reading = "y + s*y^3"
parameters.s = { unit = "1/rad2", scale = 0.05, lower = -1, upper = 1 }
"""
