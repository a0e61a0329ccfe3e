"""Forms of a second oscillation beside the first."""

from __future__ import annotations

import numpy as np

from tunnel_reference.catalogue import Draw, Extra, Form, Group, ParamMaker, reading
from tunnel_reference.conditions import Array, Conditions
from tunnel_reference.readings import Order, Params, Reading


def ringing(r: Reading, p: Params) -> Array:
    """Adds the real part of a e^((i − ζ) ω t + i φ)."""
    pole = p["frequency"] * (1j - p["damping_ratio"])
    wave = p["amplitude"] * np.exp(pole * r.conditions.time[:, None] + 1j * p["phase"])
    return np.asarray(r.value + wave.real)


def _made(released: float, in_phase: bool) -> ParamMaker:
    """Amplitude as the release angle to a power; phases drawn, or that of a rod released at rest."""

    def make(p: float, e: Extra, c: Conditions) -> dict[str, float | Array]:
        size = p * np.abs(c.start_angle / np.max(np.abs(c.start_angle))) ** released
        phase: float | Array
        if in_phase:
            phase = np.where(c.start_angle < 0.0, np.pi, 0.0)
        elif "seed" in e:
            phase = np.random.default_rng(int(e["seed"])).uniform(0.0, 2.0 * np.pi, c.runs)
        else:
            phase = e["own"]
        return {
            "amplitude": size,
            "phase": phase,
            "frequency": e["frequency"],
            "damping_ratio": e["damping_ratio"],
        }

    return make


def _drawn(low: float, high: float) -> Draw:
    """A seed, a frequency between two in Hz, and a light damping."""
    return lambda g, _c: {
        "seed": float(g.integers(0, 2**31)),
        "frequency": 2.0 * np.pi * g.uniform(low, high),
        "damping_ratio": g.uniform(0.002, 0.02),
    }


FORMS = (
    Form("second_mode", "line", Group.TEXTBOOK, "a, rad", 0.001,
         reading(ringing, Order.LINKAGE, _made(0.0, in_phase=False)), draw=_drawn(6.0, 20.0)),
    Form("second_mode", "released", Group.COMMON, "a, rad", 0.001,
         reading(ringing, Order.LINKAGE, _made(1.0, in_phase=True)), draw=_drawn(6.0, 20.0)),
    Form("second_mode", "other_plane", Group.COMMON, "a, rad", 0.001,
         reading(ringing, Order.ADDED, _made(1.0, in_phase=False)), draw=_drawn(0.7, 6.0)),
)  # fmt: skip
