"""More effects outside the known families: most are moments of the state, for checks of what a law can explain."""

from __future__ import annotations

import numpy as np

from tunnel_reference import laws_outside as m
from tunnel_reference.catalogue import Form, Group, moving, reading
from tunnel_reference.conditions import Conditions
from tunnel_reference.integrator import Phase
from tunnel_reference.outside import UNKNOWN
from tunnel_reference.readings import Order

C = Group.COMMON
_BOTH = (-1, 1)


def _pressure(c: Conditions) -> np.ndarray:
    """Dynamic pressure over that at 20 m/s, by run."""
    return np.asarray((c.true_speed / 20.0) ** 2)


LAW_FORMS: tuple[Form, ...] = (
    Form(UNKNOWN, "stops", C, "k, N m/rad", 2.0,
         moving(m.stop, Phase.MOMENT,
                lambda p, e, _c: {"stiffness": p, "place": e["place"], "one_sided": 0.0}),
         draw=lambda g, _c: {"place": g.uniform(0.08, 0.22)}),
    Form(UNKNOWN, "one_stop", C, "k, N m/rad", 2.0,
         moving(m.stop, Phase.MOMENT,
                lambda p, e, _c: {"stiffness": p, "place": e["place"], "one_sided": 1.0}),
         draw=lambda g, _c: {"place": g.uniform(0.08, 0.22)}),
    Form(UNKNOWN, "cogging", C, "M, N m", 0.01,
         moving(m.ripple, Phase.MOMENT, lambda p, e, _c: {"moment": p, "number": e["number"]}), _BOTH,
         draw=lambda g, _c: {"number": g.uniform(12.0, 40.0)}),
    Form(UNKNOWN, "centre_damper", C, "c, N m s/rad", 5e-3,
         moving(m.dashpot, Phase.MOMENT, lambda p, e, _c: {"coefficient": p, "width": e["width"]}),
         draw=lambda g, _c: {"width": g.uniform(0.03, 0.1)}),
    Form(UNKNOWN, "widening_damping", C, "c, N m s/rad", 2e-3,
         moving(m.widening_damping, Phase.MOMENT, lambda p, _e, _c: {"coefficient": p})),
    Form(UNKNOWN, "one_way_damper", C, "c, N m s/rad", 5e-3,
         moving(m.one_way_damping, Phase.MOMENT, lambda p, _e, _c: {"coefficient": p})),
    Form(UNKNOWN, "hysteresis_loop", C, "k, N m/rad", 0.1,
         moving(m.bouc_wen, Phase.MOMENT, lambda p, e, _c: {"stiffness": p, "slide": e["slide"]}, states=1,
                at_release=False),
         draw=lambda g, _c: {"slide": g.uniform(0.05, 0.3)}),
    Form(UNKNOWN, "stall", C, "M, N m", 0.02,
         moving(m.stall, Phase.MOMENT,
                lambda p, e, c: {"moment": p, "place": e["place"], "width": e["width"],
                                 "pressure": _pressure(c)}), _BOTH,
         draw=lambda g, _c: {"place": g.uniform(0.1, 0.2), "width": g.uniform(0.03, 0.08)}),
    Form(UNKNOWN, "wake", C, "M, N m", 0.01,
         moving(m.wake, Phase.MOMENT,
                lambda p, e, c: {"moment": p, "width": e["width"], "pressure": _pressure(c)}), _BOTH,
         draw=lambda g, _c: {"width": g.uniform(0.02, 0.06)}),
    Form(UNKNOWN, "slipping_clamp", C, "e, share of Kr", 2e-3,
         moving(m.slip, Phase.MOMENT, lambda p, e, c: {"share": p, "when": e["part"] * c.duration}),
         draw=lambda g, _c: {"part": g.uniform(0.1, 0.4)}),
    Form(UNKNOWN, "fading_friction", C, "T, N m", 5e-3,
         moving(m.fading_friction, Phase.FRICTION,
                lambda p, e, c: {"moment": p, "time": e["part"] * c.duration}),
         draw=lambda g, _c: {"part": g.uniform(0.1, 0.3)}),
    Form(UNKNOWN, "reading_ripple", C, "a, rad", 1e-3,
         reading(m.reading_ripple, Order.CURVE, lambda p, e, _c: {"size": p, "number": e["number"]}), _BOTH,
         draw=lambda g, _c: {"number": g.uniform(30.0, 80.0)}),
    Form(UNKNOWN, "reading_kink", C, "g", 5e-3,
         reading(m.reading_kink, Order.CURVE, lambda p, _e, _c: {"gain": p}), _BOTH),
)  # fmt: skip
"""Drawn for the kind ``law`` of campaigns."""
