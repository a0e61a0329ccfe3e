"""Forms of disturbances by the surroundings of the rig, with the wind on and off."""

from __future__ import annotations

import numpy as np

from tunnel_reference import moments as m
from tunnel_reference.catalogue import Draw, Extra, Form, Group, ParamMaker, moving
from tunnel_reference.integrator import Phase
from tunnel_reference.true_conditions import Array, TrueConditions

T, C, R = Group.TEXTBOOK, Group.COMMON, Group.RARE


def _shaken(kind: str) -> ParamMaker:
    """A random moment of one kind of spectrum, of the same size in all runs."""

    def make(p: float, e: Extra, c: TrueConditions) -> dict[str, float | Array]:
        return {"table": p * m.shaking(kind, c, seed=int(e["seed"]), scale=e["scale"], ratio=e["ratio"])}

    return make


def _seeded(scale: tuple[float, float], ratio: tuple[float, float] = (1.0, 1.0)) -> Draw:
    """A seed, a frequency in Hz and a ratio."""

    def draw(g: np.random.Generator, _c: TrueConditions) -> dict[str, float]:
        return {"seed": float(g.integers(0, 2**31)), "scale": g.uniform(*scale), "ratio": g.uniform(*ratio)}

    return draw


FORMS: tuple[Form, ...] = (
    Form("ambient_vibration", "flat", T, "s, N m", 0.01, moving(m.tabled_moment, Phase.MOMENT, _shaken("flat")),
         draw=_seeded((15.0, 60.0)), edition=3),
    Form("ambient_vibration", "draught", C, "s, N m", 0.01,
         moving(m.tabled_moment, Phase.MOMENT, _shaken("corner")), draw=_seeded((0.5, 5.0)), edition=3),
    Form("ambient_vibration", "floor", C, "s, N m", 0.01, moving(m.tabled_moment, Phase.MOMENT, _shaken("floor")),
         draw=_seeded((4.0, 15.0), (0.02, 0.1)), edition=3),
    Form("ambient_vibration", "octave", R, "s, N m", 0.01,
         moving(m.tabled_moment, Phase.MOMENT, _shaken("octave")), draw=_seeded((3.0, 8.0)), edition=3),
    Form("ambient_vibration", "traffic", R, "s, N m", 0.01,
         moving(m.tabled_moment, Phase.MOMENT, _shaken("traffic")),
         draw=_seeded((15.0, 60.0), (0.2, 0.5)), edition=3),
)  # fmt: skip
