"""Effects outside the known families, which leave a gap that no family explains."""

from __future__ import annotations

import numpy as np

from tunnel_reference import air_moments as air
from tunnel_reference import laws_outside as r
from tunnel_reference import moments as m
from tunnel_reference.catalogue import Draw, Extra, Form, Group, moving, reading
from tunnel_reference.conditions import Array, Conditions
from tunnel_reference.integrator import Phase
from tunnel_reference.readings import Order

UNKNOWN = "unknown"
C, R = Group.COMMON, Group.RARE
_BOTH = (-1, 1)


def _in_run(value: float, e: Extra, c: Conditions, *, windy: bool = False) -> Array:
    """The value in one run, or in one wind-on run; zero in the others."""
    out = np.zeros(c.runs)
    places = np.flatnonzero(c.wind_on) if windy else np.arange(c.runs)
    out[places[int(e["run"]) % places.size]] = value
    return out


def _when(low: float, high: float) -> Draw:
    """A run, and a time as a share of the duration."""
    return lambda g, _c: {
        "run": float(g.integers(0, 64)),
        "part": g.uniform(low, high),
        "width": g.uniform(0.02, 0.1),
    }


def _seeded(g: np.random.Generator, _c: Conditions) -> dict[str, float]:
    """A seed for the phases of the runs, and a frequency."""
    return {"seed": float(g.integers(0, 2**31)), "frequency": float(g.uniform(0.2, 0.6))}


def _phases(e: Extra, c: Conditions) -> Array:
    """One phase per run."""
    return np.random.default_rng(int(e["seed"])).uniform(0.0, 2.0 * np.pi, c.runs)


_BLOWS = (
    Form(UNKNOWN, "bump_all_runs", C, "J, N m s", 0.002,
         moving(air.bump, Phase.MOMENT,
                lambda p, e, c: {"impulse": p, "when": e["part"] * c.duration, "width": e["width"]}), _BOTH,
         draw=_when(0.3, 0.7)),
    Form(UNKNOWN, "bump_one_run", C, "J, N m s", 0.01,
         moving(air.bump, Phase.MOMENT,
                lambda p, e, c: {"impulse": _in_run(p, e, c), "when": e["part"] * c.duration,
                                 "width": e["width"]}), _BOTH, draw=_when(0.3, 0.7)),
    Form(UNKNOWN, "gust_one_run", C, "g, share of V", 0.01,
         moving(air.gust, Phase.WIND,
                lambda p, e, c: {"size": _in_run(p, e, c, windy=True), "when": e["part"] * c.duration,
                                 "width": 0.15 * c.duration}), _BOTH, draw=_when(0.2, 0.5)),
    Form(UNKNOWN, "platform_vibration", R, "M, N m", 0.01,
         moving(air.harmonic_moment, Phase.MOMENT,
                lambda p, e, c: {"moment": p, "frequency": e["frequency"], "phase": _phases(e, c),
                                 "second": 0.0}),
         draw=lambda g, _c: {"seed": float(g.integers(0, 2**31)), "frequency": g.uniform(5.5, 9.0)}),
)  # fmt: skip

_SLOW = (
    Form(UNKNOWN, "spring_creep", C, "c, share of Kr", 1e-3,
         moving(m.creep, Phase.MOMENT, lambda p, e, c: {"share": p, "time": e["part"] * c.duration}),
         draw=lambda g, _c: {"part": g.uniform(0.1, 0.4)}),
    Form(UNKNOWN, "damping_warms_up", C, "c, N m s per campaign", 1e-3,
         moving(m.viscous, Phase.MOMENT,
                lambda p, _e, c: {"coefficient": p * np.linspace(-1.0, 1.0, c.runs)}),
         _BOTH),
    Form(UNKNOWN, "breathing_spring", R, "e, share of Kr", 1e-3,
         moving(m.breathing, Phase.MOMENT,
                lambda p, e, c: {"share": p, "frequency": e["frequency"], "phase": _phases(e, c)}),
         draw=_seeded),
    Form(UNKNOWN, "moving_mass", C, "e, share of Izz", 1e-3,
         moving(m.moving_mass, Phase.MOMENT,
                lambda p, e, c: {"share": p, "frequency": e["frequency"], "inertia": c.yaw_inertia}),
         draw=_seeded),
)  # fmt: skip

_PLACE = (
    Form(UNKNOWN, "scraping", C, "T, N m", 0.01,
         moving(m.scraping_level, Phase.FRICTION,
                lambda p, e, _c: {"moment": p, "place": e["place"], "width": e["width"]}),
         draw=lambda g, _c: {"place": g.choice([-1.0, 1.0]) * g.uniform(0.08, 0.2),
                             "width": g.uniform(0.01, 0.03)}),
    Form(UNKNOWN, "magnetic_detent", C, "M, N m", 0.002,
         moving(m.detent, Phase.MOMENT, lambda p, e, _c: {"moment": p, "width": e["width"]}), _BOTH,
         draw=lambda g, _c: {"width": g.uniform(0.02, 0.06)}),
)  # fmt: skip

_SENSOR = (
    Form(UNKNOWN, "gain_change", C, "g", 3e-3,
         reading(r.gain_change, Order.CURVE,
                 lambda p, e, c: {"gain": p, "when": e["part"] * c.duration}), _BOTH,
         draw=_when(0.1, 0.4)),
    Form(UNKNOWN, "zero_step_one_run", R, "d, rad", 3e-3,
         reading(r.zero_step, Order.ADDED,
                 lambda p, e, c: {"step": _in_run(p, e, c), "when": e["part"] * c.duration}), _BOTH,
         draw=_when(0.2, 0.8)),
    Form(UNKNOWN, "wandering_zero", C, "d, rad", 1e-3,
         reading(r.wandering_zero, Order.ADDED, lambda p, _e, _c: {"size": p})),
    Form(UNKNOWN, "clock_jitter", C, "ε, s", 3e-4,
         reading(r.clock_jitter, Order.ADDED, lambda p, _e, _c: {"jitter": p})),
    Form(UNKNOWN, "motion_noise", C, "n, rad/rad", 5e-3,
         reading(r.motion_noise, Order.ADDED, lambda p, _e, _c: {"level": p})),
    Form(UNKNOWN, "amplitude_zero", R, "z, rad", 2e-3,
         reading(r.amplitude_zero, Order.ADDED, lambda p, e, _c: {"shift": p, "time": e["time"]}), _BOTH,
         draw=lambda g, _c: {"time": g.uniform(0.5, 1.5)}),
    Form(UNKNOWN, "held_samples", C, "rate, 1/s", 0.3,
         reading(r.held_samples, Order.LINE, lambda p, e, _c: {"rate": p, "length": e["length"]}),
         draw=lambda g, _c: {"length": g.uniform(0.008, 0.03)}),
    Form(UNKNOWN, "spikes", R, "rate, 1/s", 1.0,
         reading(r.spikes, Order.NOISE, lambda p, e, _c: {"rate": p, "size": e["size"]}),
         draw=lambda g, _c: {"size": g.uniform(0.01, 0.05)}),
)  # fmt: skip

OUTSIDE_FORMS: tuple[Form, ...] = (*_BLOWS, *_SLOW, *_PLACE, *_SENSOR)
