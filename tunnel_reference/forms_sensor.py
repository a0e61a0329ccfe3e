"""Forms of the sensor families, and of a second oscillation beside the first."""

from __future__ import annotations

import numpy as np

from tunnel_reference import readings as r
from tunnel_reference.catalogue import Draw, Extra, Form, Group, ParamMaker, reading
from tunnel_reference.driven_inputs import oscillator_response
from tunnel_reference.readings import Order, Params, SensorSignal
from tunnel_reference.true_conditions import Array, TrueConditions

T, C, R = Group.TEXTBOOK, Group.COMMON, Group.RARE
_BOTH = (-1, 1)


def ringing(r: SensorSignal, p: Params) -> Array:
    """Adds the real part of a e^((i − ζ) ω t + i φ), and the oscillation excited by the input."""
    pole, time = p["frequency"] * (1j - p["damping_ratio"]), r.conditions.time
    wave = p["amplitude"] * np.exp(pole * time[:, None] + 1j * p["phase"])
    out = np.asarray(r.value + wave.real)
    drive = r.conditions.drive
    if drive is None or not p["excited"].any():
        return out
    # from a moment in shares of the spring's stiffness; a delay of the input delays the response
    per = p["frequency"] ** 2 * (1.0 + p["damping_ratio"] ** 2)
    per = per * (1.0 if drive.column == "base_rad" else drive.gain / r.conditions.spring_stiffness)
    response = oscillator_response(r.conditions, pole) * (p["excited"] * per)[:, None]
    delay = np.broadcast_to(drive.delay, (r.conditions.runs,))
    written = np.arange(response.shape[1]) / r.conditions.sample_rate
    for run in range(out.shape[1]):
        out[:, run] += np.interp(time - delay[run], written, response[run])
    return out


def _made(released: float, in_phase: bool) -> ParamMaker:
    """Amplitude as the release angle to a power; phases drawn, or the phase of a rod released at rest.

    Where the power is not 0, the input excites the mode of a driven run, as holding the body excites it at a
    release.
    """

    def make(p: float, e: Extra, c: TrueConditions) -> dict[str, float | Array]:
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
    """A seed, a frequency between two bounds in Hz, and a light damping."""
    return lambda g, _c: {
        "seed": float(g.integers(0, 2**31)),
        "frequency": 2.0 * np.pi * g.uniform(low, high),
        "damping_ratio": g.uniform(0.002, 0.02),
    }


_SECOND_MODE = (
    Form("second_mode", "line", T, "a, rad", 0.001,
         reading(ringing, Order.LINKAGE, _made(0.0, in_phase=False)), draw=_drawn(6.0, 20.0)),
    Form("second_mode", "released", C, "a, rad", 0.001,
         reading(ringing, Order.LINKAGE, _made(1.0, in_phase=True)), draw=_drawn(6.0, 20.0)),
    Form("second_mode", "other_plane", C, "a, rad", 0.001,
         reading(ringing, Order.ADDED, _made(1.0, in_phase=False)), draw=_drawn(0.7, 6.0)),
)  # fmt: skip

_CURVE: ParamMaker = lambda p, _e, _c: {"s": p}  # noqa: E731
_CURVES = (
    Form("sensor_nonlinearity", "cubic", T, "s, 1/rad²", 0.03,
         reading(r.cubic_curve, Order.CURVE, _CURVE), _BOTH),
    Form("sensor_nonlinearity", "sine", C, "s, 1/rad²", 0.03,
         reading(r.sine_curve, Order.CURVE, _CURVE), _BOTH),
    Form("sensor_nonlinearity", "tangent", C, "s, 1/rad²", 0.03,
         reading(r.tangent_curve, Order.CURVE, _CURVE), _BOTH),
    Form("sensor_nonlinearity", "loaded_potentiometer", R, "ρ", 0.03,
         reading(r.loaded_potentiometer, Order.CURVE, _CURVE)),
)  # fmt: skip

_STEP: ParamMaker = lambda p, _e, _c: {"step": p}  # noqa: E731
_STEPS = (
    Form("sensor_quantisation", "rounding", T, "step, rad", 0.003,
         reading(r.coarse_rounding, Order.ROUNDING, _STEP)),
    Form("sensor_quantisation", "truncation", C, "step, rad", 0.003,
         reading(r.coarse_truncation, Order.ROUNDING, _STEP)),
    Form("sensor_quantisation", "uneven", R, "step, rad", 0.003,
         reading(r.uneven_rounding, Order.ROUNDING, _STEP)),
)  # fmt: skip


def _gap(p: float, e: Extra, c: TrueConditions) -> dict[str, float | Array]:
    """Half width, and the position in the gap at which each run starts."""
    start = np.random.default_rng(int(e["seed"])).uniform(-1.0, 1.0, c.runs) * e["random"]
    return {"half": p, "start": start}


def _start(random: float) -> Draw:
    """A seed, and the greatest distance of a run's start from the middle of the gap."""
    return lambda g, _c: {"seed": float(g.integers(0, 2**31)), "random": random}


_LINKAGE = (
    Form("sensor_hysteresis", "backlash", T, "w, rad", 0.001, reading(r.backlash, Order.LINKAGE, _gap),
         draw=_start(0.0)),
    Form("sensor_hysteresis", "backlash_any_start", C, "w, rad", 0.001,
         reading(r.backlash, Order.LINKAGE, _gap), draw=_start(1.0)),
    Form("sensor_hysteresis", "two_plays", C, "w, rad", 0.001, reading(r.two_plays, Order.LINKAGE, _gap),
         draw=_start(0.5)),
    Form("sensor_hysteresis", "sliding", R, "w, rad", 0.001, reading(r.sliding_linkage, Order.LINKAGE, _gap),
         draw=_start(0.0)),
)  # fmt: skip

_DRIFTS = (
    Form("sensor_drift", "linear", T, "d, rad", 0.002,
         reading(r.drift, Order.ADDED, lambda p, _e, _c: {"drift": p, "exponent": 1.0}), _BOTH),
    Form("sensor_drift", "power", C, "d, rad", 0.002,
         reading(r.drift, Order.ADDED, lambda p, e, _c: {"drift": p, "exponent": e["exponent"]}), _BOTH,
         draw=lambda g, _c: {"exponent": g.choice([0.5, 1.5, 2.0])}),
    Form("sensor_drift", "warming", C, "d, rad", 0.002,
         reading(r.settling_drift, Order.ADDED,
                 lambda p, e, c: {"drift": p, "time": e["part"] * c.duration}), _BOTH,
         draw=lambda g, _c: {"part": g.uniform(0.25, 0.7)}),
)  # fmt: skip


def _hum(p: float, e: Extra, c: TrueConditions) -> dict[str, float | Array]:
    """Amplitude, frequency, and phases drawn per run."""
    rng = np.random.default_rng(int(e["seed"]))
    return {"amplitude": p, "frequency": e["frequency"], "phase": rng.uniform(0, 2 * np.pi, c.runs),
            "third": e["third"], "third_phase": rng.uniform(0, 2 * np.pi, c.runs), "slow": 0.4,
            "seed": e["seed"], "apart": _APART * c.time_scale, "step": _STEP_OF_MAINS * c.time_scale}  # fmt: skip


_WANDER = 0.5  # Hz: large grids stay within it (EN 50160; NERC PRC-024)
_APART, _STEP_OF_MAINS = 0.02, 0.002  # Hz: of a large grid within minutes, and within half a second


def _hum_draw(third: float) -> Draw:
    """Seed, frequency within a grid's range about 50 or 60 Hz as written, and up to ``third`` of third harmonic."""

    def draw(g: np.random.Generator, c: TrueConditions) -> dict[str, float]:
        seed = int(g.integers(0, 2**31))
        mains = 50.0 if np.random.default_rng([seed, 1]).random() < 0.5 else 60.0
        return {"seed": float(seed), "frequency": (mains + g.uniform(-_WANDER, _WANDER)) * c.time_scale,
                "third": g.uniform(0.3, 1.0) * third}  # fmt: skip

    return draw


def _hum_at_50(off: float, third: float) -> Draw:
    """As `_hum_draw`, within ``off`` of 50 Hz."""
    return lambda g, c: {"seed": float(g.integers(0, 2**31)),
                         "frequency": (50.0 + g.uniform(-off, off)) * c.time_scale,
                         "third": g.uniform(0.3, 1.0) * third}  # fmt: skip


_HUM = (
    Form("mains_hum", "line", T, "a, rad", 0.001, reading(r.hum, Order.ADDED, _hum), draw=_hum_at_50(0.0, 0.0),
         until=1),
    Form("mains_hum", "third_harmonic", C, "a, rad", 0.001, reading(r.hum, Order.ADDED, _hum),
         draw=_hum_at_50(0.03, 0.3), until=1),
    Form("mains_hum", "bursts", R, "a, rad", 0.001, reading(r.hum_bursts, Order.ADDED, _hum),
         draw=_hum_at_50(0.05, 0.0), until=1),
    Form("mains_hum", "line", T, "a, rad", 0.001, reading(r.hum, Order.ADDED, _hum), draw=_hum_draw(0.0),
         edition=2),
    Form("mains_hum", "third_harmonic", C, "a, rad", 0.001, reading(r.hum, Order.ADDED, _hum),
         draw=_hum_draw(0.3), edition=2),
    Form("mains_hum", "second_harmonic", C, "a, rad", 0.001, reading(r.hum_harmonic, Order.ADDED, _hum),
         draw=_hum_draw(0.0), edition=2),
    Form("mains_hum", "bursts", R, "a, rad", 0.001, reading(r.hum_bursts, Order.ADDED, _hum),
         draw=_hum_draw(0.0), edition=2),
    Form("mains_hum", "wandering", R, "a, rad", 0.001, reading(r.hum_wandering, Order.ADDED, _hum),
         draw=_hum_draw(0.0), edition=2),
)  # fmt: skip


def _limit(p: float, e: Extra, c: TrueConditions) -> dict[str, float | Array]:
    """L = (1 − p) times the largest angle."""
    limit = (1.0 - p) * c.reach
    return {"limit": limit, "lower": e.get("lower", 1.0), "knee": e.get("knee", 0.1)}


_LIMITS = (
    Form("sensor_clipping", "hard", T, "1 − L/largest release", 0.05,
         reading(r.clipping, Order.LIMIT, _limit),
         limits=(1e-3, 0.8)),
    Form("sensor_clipping", "soft", C, "1 − L/largest release", 0.05,
         reading(r.soft_clipping, Order.LIMIT, _limit),
         draw=lambda g, _c: {"knee": g.uniform(0.03, 0.12)}, limits=(1e-3, 0.8)),
    Form("sensor_clipping", "upper_side", R, "1 − L/largest release", 0.05,
         reading(r.clipping, Order.LIMIT, _limit), draw=lambda _g, _c: {"lower": 0.0}, limits=(1e-3, 0.8)),
)  # fmt: skip

FORMS: tuple[Form, ...] = (*_SECOND_MODE, *_CURVES, *_STEPS, *_LINKAGE, *_DRIFTS, *_HUM, *_LIMITS)
