"""Effects outside the known families, which leave an unexplained residual: their laws, and their forms.

Moments are in N m on the right-hand side of Izz β̈ = …; ``rows`` are the runs that a law applies to, ``p`` its
parameters by run. Most of `LAW_FORMS` are moments of the state, to check what a law can explain.
"""

from __future__ import annotations

import numpy as np

from tunnel_reference import moments as m
from tunnel_reference.catalogue import Draw, Extra, Form, Group, moving, reading
from tunnel_reference.integrator import Params, Phase, Rows, RungeKuttaStage
from tunnel_reference.readings import Order, SensorSignal
from tunnel_reference.readings import Params as ReadingParams
from tunnel_reference.true_conditions import Array, TrueConditions


def stop(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−k max(|θ| − θs, 0) sgn θ: rubber stops on both sides, or (``one_sided``) on the positive side only."""
    t = s.theta[rows]
    lower = np.where(p["one_sided"] > 0.0, 0.0, np.maximum(-t - p["place"], 0.0))
    s.top[rows] -= p["stiffness"] * (np.maximum(t - p["place"], 0.0) - lower)


def ripple(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−M sin(nθ): cogging of a motor or a magnetic bearing."""
    s.top[rows] -= p["moment"] * np.sin(p["number"] * s.theta[rows])


def dashpot(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−c exp(−(θ/w)²) θ̇: a damper that acts near the middle only."""
    s.top[rows] -= p["coefficient"] * np.exp(-((s.theta[rows] / p["width"]) ** 2)) * s.omega[rows]


def widening_damping(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−c (θ/0.1)² θ̇: damping that grows away from the middle, with the wind off too."""
    s.top[rows] -= p["coefficient"] * (s.theta[rows] / 0.1) ** 2 * s.omega[rows]


def one_way_damping(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−c max(θ̇, 0): a damper that acts in one direction."""
    s.top[rows] -= p["coefficient"] * np.maximum(s.omega[rows], 0.0)


def bouc_wen(s: RungeKuttaStage, rows: Rows, p: Params, x: Array, dx: Array) -> None:
    """−k z with ż = θ̇ − |θ̇| |z| z/zs²: a hysteresis loop that saturates softly (Wen 1976)."""
    omega = s.omega[rows]
    s.top[rows] -= p["stiffness"] * x[0]
    dx[0] = omega - np.abs(omega) * np.abs(x[0]) * x[0] / p["slide"] ** 2


def stall(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−M q/q₂₀ tanh((|β| − βs)/w)₊ sgn β: a yaw moment that breaks away beyond an angle; M per 20 m/s."""
    beta = s.beta[rows]
    beyond = np.maximum(np.tanh((np.abs(beta) - p["place"]) / p["width"]), 0.0)
    s.body[rows] -= p["moment"] * p["pressure"] * beyond * np.sign(beta)


def wake(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """+M q/q₂₀ (β/w) exp(½ − β²/2w²): the air's moment departs from its line near zero yaw."""
    t = s.beta[rows] / p["width"]
    s.body[rows] += p["moment"] * p["pressure"] * t * np.exp(0.5 - 0.5 * t * t)


def slip(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """+Kr e θ after t0: a clamp that slips, in every run."""
    s.top[rows] += s.stiffness[rows] * p["share"] * (s.time > p["when"]) * s.theta[rows]


def fading_friction(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Tc exp(−t/τ): a bearing that runs in during every run."""
    s.level[rows] += p["moment"] * np.exp(-s.time / p["time"])


def reading_ripple(r: SensorSignal, p: ReadingParams) -> Array:
    """Adds a sin(n y): the windings of a potentiometer."""
    return np.asarray(r.value + p["size"] * np.sin(p["number"] * r.value))


def reading_kink(r: SensorSignal, p: ReadingParams) -> Array:
    """Adds g |y|: a different gain on one side."""
    return np.asarray(r.value + p["gain"] * np.abs(r.value))


def gain_change(r: SensorSignal, p: ReadingParams) -> Array:
    """Multiplies by 1 + g after t0."""
    return r.value * (1.0 + p["gain"] * (r.conditions.time[:, None] > p["when"]))


def zero_step(r: SensorSignal, p: ReadingParams) -> Array:
    """Adds d after t0, in the runs where d is not zero."""
    return r.value + p["step"] * (r.conditions.time[:, None] > p["when"])


def wandering_zero(r: SensorSignal, p: ReadingParams) -> Array:
    """Adds a random walk of the sensor's zero, of standard deviation d over one run."""
    steps = r.rng.standard_normal(r.value.shape) / np.sqrt(r.value.shape[0])
    return np.asarray(r.value + p["size"] * np.cumsum(steps, axis=0))


def clock_jitter(r: SensorSignal, p: ReadingParams) -> Array:
    """Samples at random times about the stated ones: y + β̇ ε."""
    return r.value + r.motion.rate * p["jitter"] * r.rng.standard_normal(r.value.shape)


def motion_noise(r: SensorSignal, p: ReadingParams) -> Array:
    """Noise of standard deviation n |β| (a worn track)."""
    noise = p["level"] * np.abs(r.motion.angle) * r.rng.standard_normal(r.value.shape)
    return np.asarray(r.value + noise)


def amplitude_zero(r: SensorSignal, p: ReadingParams) -> Array:
    """Adds z E/E0, E the running energy of the motion: a zero that follows the amplitude."""
    c = r.conditions
    omega = np.maximum(c.wind_off_omega, 1.0)
    energy = r.motion.angle**2 + (r.motion.rate / omega) ** 2
    weight = 1.0 / (c.sample_rate * p["time"])
    slow = np.empty_like(energy)
    now = energy[0]
    for k in range(energy.shape[0]):
        now = now + weight * (energy[k] - now)
        slow[k] = now
    return np.asarray(r.value + p["shift"] * slow / energy[0].max())


def held_samples(r: SensorSignal, p: ReadingParams) -> Array:
    """At random times the reading is held for ``length`` seconds."""
    n, runs = r.value.shape
    out = r.value.copy()
    length = int(p["length"][0] * r.conditions.sample_rate)
    for run in range(runs):
        starts = np.flatnonzero(r.rng.random(n) < p["rate"][run] / r.conditions.sample_rate)
        for start in starts:
            out[start : start + length, run] = out[start, run]
    return out


def spikes(r: SensorSignal, p: ReadingParams) -> Array:
    """Errors of standard deviation ``size`` in single samples, ``rate`` per second."""
    hit = r.rng.random(r.value.shape) < p["rate"] / r.conditions.sample_rate
    return np.asarray(r.value + hit * p["size"] * r.rng.standard_normal(r.value.shape))


UNKNOWN = "unknown"
C, R = Group.COMMON, Group.RARE
_BOTH = (-1, 1)


def _in_run(value: float, e: Extra, c: TrueConditions, *, windy: bool = False) -> Array:
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


def _seeded(g: np.random.Generator, _c: TrueConditions) -> dict[str, float]:
    """A seed for the phases of the runs, and a frequency."""
    return {"seed": float(g.integers(0, 2**31)), "frequency": float(g.uniform(0.2, 0.6))}


def _phases(e: Extra, c: TrueConditions) -> Array:
    """One phase per run."""
    return np.random.default_rng(int(e["seed"])).uniform(0.0, 2.0 * np.pi, c.runs)


_BLOWS = (
    Form(UNKNOWN, "bump_all_runs", C, "J, N m s", 0.002,
         moving(m.bump, Phase.MOMENT,
                lambda p, e, c: {"impulse": p, "when": e["part"] * c.duration, "width": e["width"]}), _BOTH,
         draw=_when(0.3, 0.7)),
    Form(UNKNOWN, "bump_one_run", C, "J, N m s", 0.01,
         moving(m.bump, Phase.MOMENT,
                lambda p, e, c: {"impulse": _in_run(p, e, c), "when": e["part"] * c.duration,
                                 "width": e["width"]}), _BOTH, draw=_when(0.3, 0.7)),
    Form(UNKNOWN, "gust_one_run", C, "g, share of V", 0.01,
         moving(m.gust, Phase.WIND,
                lambda p, e, c: {"size": _in_run(p, e, c, windy=True), "when": e["part"] * c.duration,
                                 "width": 0.15 * c.duration}), _BOTH, draw=_when(0.2, 0.5)),
    Form(UNKNOWN, "platform_vibration", R, "M, N m", 0.01,
         moving(m.harmonic_moment, Phase.MOMENT,
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
         reading(gain_change, Order.CURVE,
                 lambda p, e, c: {"gain": p, "when": e["part"] * c.duration}), _BOTH,
         draw=_when(0.1, 0.4)),
    Form(UNKNOWN, "zero_step_one_run", R, "d, rad", 3e-3,
         reading(zero_step, Order.ADDED,
                 lambda p, e, c: {"step": _in_run(p, e, c), "when": e["part"] * c.duration}), _BOTH,
         draw=_when(0.2, 0.8)),
    Form(UNKNOWN, "wandering_zero", C, "d, rad", 1e-3,
         reading(wandering_zero, Order.ADDED, lambda p, _e, _c: {"size": p})),
    Form(UNKNOWN, "clock_jitter", C, "ε, s", 3e-4,
         reading(clock_jitter, Order.ADDED, lambda p, _e, _c: {"jitter": p})),
    Form(UNKNOWN, "motion_noise", C, "n, rad/rad", 5e-3,
         reading(motion_noise, Order.ADDED, lambda p, _e, _c: {"level": p})),
    Form(UNKNOWN, "amplitude_zero", R, "z, rad", 2e-3,
         reading(amplitude_zero, Order.ADDED, lambda p, e, _c: {"shift": p, "time": e["time"]}), _BOTH,
         draw=lambda g, _c: {"time": g.uniform(0.5, 1.5)}),
    Form(UNKNOWN, "held_samples", C, "rate, 1/s", 0.3,
         reading(held_samples, Order.LINE, lambda p, e, _c: {"rate": p, "length": e["length"]}),
         draw=lambda g, _c: {"length": g.uniform(0.008, 0.03)}),
    Form(UNKNOWN, "spikes", R, "rate, 1/s", 1.0,
         reading(spikes, Order.NOISE, lambda p, e, _c: {"rate": p, "size": e["size"]}),
         draw=lambda g, _c: {"size": g.uniform(0.01, 0.05)}),
)  # fmt: skip

OUTSIDE_FORMS: tuple[Form, ...] = (*_BLOWS, *_SLOW, *_PLACE, *_SENSOR)


def _pressure(c: TrueConditions) -> np.ndarray:
    """Ratio of dynamic pressure to its value at 20 m/s, by run."""
    return np.asarray((c.true_speed / 20.0) ** 2)


LAW_FORMS: tuple[Form, ...] = (
    Form(UNKNOWN, "stops", C, "k, N m/rad", 2.0,
         moving(stop, Phase.MOMENT,
                lambda p, e, _c: {"stiffness": p, "place": e["place"], "one_sided": 0.0}),
         draw=lambda g, _c: {"place": g.uniform(0.08, 0.22)}),
    Form(UNKNOWN, "one_stop", C, "k, N m/rad", 2.0,
         moving(stop, Phase.MOMENT,
                lambda p, e, _c: {"stiffness": p, "place": e["place"], "one_sided": 1.0}),
         draw=lambda g, _c: {"place": g.uniform(0.08, 0.22)}),
    Form(UNKNOWN, "cogging", C, "M, N m", 0.01,
         moving(ripple, Phase.MOMENT, lambda p, e, _c: {"moment": p, "number": e["number"]}), _BOTH,
         draw=lambda g, _c: {"number": g.uniform(12.0, 40.0)}),
    Form(UNKNOWN, "centre_damper", C, "c, N m s/rad", 5e-3,
         moving(dashpot, Phase.MOMENT, lambda p, e, _c: {"coefficient": p, "width": e["width"]}),
         draw=lambda g, _c: {"width": g.uniform(0.03, 0.1)}),
    Form(UNKNOWN, "widening_damping", C, "c, N m s/rad", 2e-3,
         moving(widening_damping, Phase.MOMENT, lambda p, _e, _c: {"coefficient": p})),
    Form(UNKNOWN, "one_way_damper", C, "c, N m s/rad", 5e-3,
         moving(one_way_damping, Phase.MOMENT, lambda p, _e, _c: {"coefficient": p})),
    Form(UNKNOWN, "hysteresis_loop", C, "k, N m/rad", 0.1,
         moving(bouc_wen, Phase.MOMENT, lambda p, e, _c: {"stiffness": p, "slide": e["slide"]}, states=1,
                at_release=False),
         draw=lambda g, _c: {"slide": g.uniform(0.05, 0.3)}),
    Form(UNKNOWN, "stall", C, "M, N m", 0.02,
         moving(stall, Phase.MOMENT,
                lambda p, e, c: {"moment": p, "place": e["place"], "width": e["width"],
                                 "pressure": _pressure(c)}), _BOTH,
         draw=lambda g, _c: {"place": g.uniform(0.1, 0.2), "width": g.uniform(0.03, 0.08)}),
    Form(UNKNOWN, "wake", C, "M, N m", 0.01,
         moving(wake, Phase.MOMENT,
                lambda p, e, c: {"moment": p, "width": e["width"], "pressure": _pressure(c)}), _BOTH,
         draw=lambda g, _c: {"width": g.uniform(0.02, 0.06)}),
    Form(UNKNOWN, "slipping_clamp", C, "e, share of Kr", 2e-3,
         moving(slip, Phase.MOMENT, lambda p, e, c: {"share": p, "when": e["part"] * c.duration}),
         draw=lambda g, _c: {"part": g.uniform(0.1, 0.4)}),
    Form(UNKNOWN, "fading_friction", C, "T, N m", 5e-3,
         moving(fading_friction, Phase.FRICTION,
                lambda p, e, c: {"moment": p, "time": e["part"] * c.duration}),
         draw=lambda g, _c: {"part": g.uniform(0.1, 0.3)}),
    Form(UNKNOWN, "reading_ripple", C, "a, rad", 1e-3,
         reading(reading_ripple, Order.CURVE, lambda p, e, _c: {"size": p, "number": e["number"]}), _BOTH,
         draw=lambda g, _c: {"number": g.uniform(30.0, 80.0)}),
    Form(UNKNOWN, "reading_kink", C, "g", 5e-3,
         reading(reading_kink, Order.CURVE, lambda p, _e, _c: {"gain": p}), _BOTH),
)  # fmt: skip
"""Forms for the kind ``law`` of campaigns."""
