"""Forms of a second oscillation beside the first."""

from __future__ import annotations

import numpy as np

from tunnel_reference.catalogue import Draw, Extra, Form, Group, ParamMaker, reading
from tunnel_reference.conditions import Array, Conditions
from tunnel_reference.inputs import oscillator_response
from tunnel_reference.readings import Order, Params, Reading


def ringing(r: Reading, p: Params) -> Array:
    """Adds the real part of a e^((i − ζ) ω t + i φ), and what the input excites."""
    pole, time = p["frequency"] * (1j - p["damping_ratio"]), r.conditions.time
    wave = p["amplitude"] * np.exp(pole * time[:, None] + 1j * p["phase"])
    out = np.asarray(r.value + wave.real)
    drive = r.conditions.drive
    if drive is None or not p["excited"].any():
        return out
    # of a moment in shares of the spring's stiffness; a delay of the input delays the response
    per = p["frequency"] ** 2 * (1.0 + p["damping_ratio"] ** 2)
    per = per * (1.0 if drive.column == "base_rad" else drive.gain / r.conditions.spring_stiffness)
    response = oscillator_response(r.conditions, pole) * (p["excited"] * per)[:, None]
    delay = np.broadcast_to(drive.delay, (r.conditions.runs,))
    written = np.arange(response.shape[1]) / r.conditions.sample_rate
    for run in range(out.shape[1]):
        out[:, run] += np.interp(time - delay[run], written, response[run])
    return out


def _made(released: float, in_phase: bool) -> ParamMaker:
    """Amplitude as the release angle to a power; phases drawn, or that of a rod released at rest.

    Where the power is not 0, the input excites the mode of a driven run, as it holds the body at a release.
    """

    def make(p: float, e: Extra, c: Conditions) -> dict[str, float | Array]:
        driven = np.zeros(c.runs, np.bool_) if c.drive is None or not released else c.drive.driven
        reach = np.max(np.abs(np.where(driven, 0.0, c.start_angle))) or c.reach
        size = np.where(driven, 0.0, p * np.abs(c.start_angle / reach) ** released)
        phase: float | Array
        if in_phase:
            phase = np.where(c.start_angle < 0.0, np.pi, 0.0)
        elif "seed" in e:
            phase = np.random.default_rng(int(e["seed"])).uniform(0.0, 2.0 * np.pi, c.runs)
        else:
            phase = e["own"]
        return {
            "amplitude": size,
            "excited": np.where(driven, p / reach, 0.0),
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
