"""Forms of a delay of the input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tunnel_reference.catalogue import Extra, Form, Group, calibration
from tunnel_reference.conditions import Conditions

_BOTH = (-1, 1)


def _later(p: float, e: Extra, c: Conditions) -> Conditions:
    """The input acts later by p, in every run by the share ``spread`` of it more or less."""
    assert c.drive is not None
    own = np.random.default_rng(int(e["seed"])).uniform(-1.0, 1.0, c.runs)
    return replace(c, drive=replace(c.drive, delay=p * (1.0 + e["spread"] * own)))


FORMS = (
    Form("input_delay", "constant", Group.TEXTBOOK, "τ, s", 5e-4, calibration(_later), _BOTH,
         draw=lambda _g, _c: {"seed": 0.0, "spread": 0.0}, limits=(1e-6, 0.05), driven=True),
    Form("input_delay", "by_run", Group.COMMON, "τ, s", 5e-4, calibration(_later), _BOTH,
         draw=lambda g, _c: {"seed": float(g.integers(0, 2**31)), "spread": 0.1}, limits=(1e-6, 0.05),
         driven=True),
)  # fmt: skip
