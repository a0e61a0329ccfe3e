"""The laws of the sensor: from the motion of the rod's upper end to the reading.

A law takes the reading so far (shape (samples, runs), rad) and returns the changed one, in the sequence given by
``Order``. Noise and the common zero are added after the laws of the angle; clipping and rounding come last.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from tunnel_reference.integrator import RodMotion
from tunnel_reference.true_conditions import Array, TrueConditions


class Order(IntEnum):
    """The position of a law in the sensor's chain."""

    LINKAGE = 0  # between rod and sensor
    CURVE = 1  # the sensor's characteristic
    ADDED = 2  # errors added to the reading
    NOISE = 3  # after zero and noise
    LIMIT = 4  # the converter's range
    ROUNDING = 5  # the converter's step; replaces the stated rounding
    LINE = 6  # after rounding: lost and held samples


@dataclass(frozen=True, eq=False)
class SensorSignal:
    """The readings of a campaign at some point of the sensor's chain.

    Args:
        value: shape (samples, runs), rad.
        motion: motion of the rod's upper end.
        rng: random numbers for the laws.
    """

    value: Array
    motion: RodMotion
    conditions: TrueConditions
    rng: np.random.Generator


Params = Mapping[str, Array]
ReadingLaw = Callable[[SensorSignal, Params], Array]


@dataclass(frozen=True, eq=False)
class ReadingTerm:
    """A sensor law with its parameters by run.

    Args:
        params: arrays of shape (runs,).
        of_input: whether the same change is made to the input as written.
    """

    law: ReadingLaw
    order: Order
    params: dict[str, Array]
    of_input: bool = False


def read_motion(
    conditions: TrueConditions, motion: RodMotion, terms: Sequence[ReadingTerm], rng: np.random.Generator
) -> Array:
    """The sensor's reading of a motion.

    Args:
        conditions: the campaign's noise, zero and resolution.
        motion: motion of the rod's upper end.
        rng: the noise is drawn before the laws draw, so that it does not depend on the effects.

    Returns:
        The reading, shape (samples, runs), rad.
    """
    white = rng.standard_normal(motion.angle.shape)
    if conditions.noise_tails > 0.0:  # of unit variance
        tails = conditions.noise_tails
        white = white * np.sqrt((tails - 2.0) / rng.chisquare(tails, white.shape))
    noise = conditions.noise_std * white
    if conditions.coloured_share > 0.0:
        n = noise.shape[0]  # the noise is mixed with noise of a first-order spectrum; the variance remains
        frequency = np.fft.rfftfreq(n, 1.0 / conditions.sample_rate)
        gain = 1.0 / np.sqrt(1.0 + (frequency / conditions.noise_corner) ** 2)
        gain /= np.sqrt(np.mean(gain**2))
        drawn = np.fft.rfft(conditions.noise_std * rng.standard_normal(noise.shape), axis=0)
        slow = np.fft.irfft(gain[:, None] * drawn, n, axis=0)
        share = conditions.coloured_share
        noise = np.sqrt(1.0 - share) * noise + np.sqrt(share) * slow
    if conditions.clock_jitter != 0.0:  # the motion at the true sample times
        n, interval = motion.angle.shape[0], 1.0 / conditions.sample_rate
        u = (conditions.time[:n] / interval - np.arange(n))[:, None]
        after = np.minimum(np.arange(n) + 1, n - 1)
        a, b = motion.angle, motion.angle[after]
        ra, rb = motion.rate * interval, motion.rate[after] * interval
        angle = _hermite(u, a, b, ra, rb)
        angle[-1] = motion.angle[-1] + u[-1] * ra[-1]
        motion = RodMotion(angle, motion.rate + u * (motion.rate[after] - motion.rate))
    value = motion.angle
    ordered = sorted(terms, key=lambda t: t.order)
    for term in (t for t in ordered if t.order < Order.NOISE):
        value = term.law(SensorSignal(value, motion, conditions, rng), term.params)
    value = value + conditions.zero + conditions.zero_shift + conditions.zero_deviation
    value = value + conditions.noise_scale * noise
    for term in (t for t in ordered if Order.NOISE <= t.order < Order.LINE):
        value = term.law(SensorSignal(value, motion, conditions, rng), term.params)
    if not any(t.order is Order.ROUNDING for t in ordered):
        value = np.round(value / conditions.resolution) * conditions.resolution
    for term in (t for t in ordered if t.order is Order.LINE):
        value = term.law(SensorSignal(value, motion, conditions, rng), term.params)
    return value


def _hermite(u: Array, a: Array, b: Array, ra: Array, rb: Array) -> Array:
    """The cubic from a to b at the share u of an interval; ra and rb are the rates times the interval."""
    return (
        (1 + 2 * u) * (1 - u) ** 2 * a
        + u * (1 - u) ** 2 * ra
        + u * u * (3 - 2 * u) * b
        + u * u * (u - 1) * rb
    )


# ---- linkage

_PLAY_STEPS = 8


def _fine_path(motion: RodMotion, interval: float) -> Array:
    """The angle at eight points per sample by cubic Hermite interpolation, shape (8 (n−1) + 1, runs)."""
    u = (np.arange(_PLAY_STEPS) / _PLAY_STEPS)[None, :, None]
    a, b = motion.angle[:-1, None], motion.angle[1:, None]
    ra, rb = motion.rate[:-1, None] * interval, motion.rate[1:, None] * interval
    inner = _hermite(u, a, b, ra, rb)
    return np.concatenate([inner.reshape(-1, motion.angle.shape[1]), motion.angle[-1:]])


def _play(path: Array, half: Array, start: Array) -> Array:
    """The play operator: the output moves only when pushed by the edges of the gap ±half."""
    out = np.empty_like(path)
    low, high = path - half, path + half
    now = path[0] + start * half
    for k in range(path.shape[0]):
        now = np.minimum(np.maximum(now, low[k]), high[k])
        out[k] = now
    return out


def backlash(r: SensorSignal, p: Params) -> Array:
    """Backlash ±w, starting at ``start`` (−1…1) of its gap."""
    path = _fine_path(r.motion, 1.0 / r.conditions.sample_rate)
    return r.value + (_play(path, p["half"], p["start"]) - path)[::_PLAY_STEPS]


def two_plays(r: SensorSignal, p: Params) -> Array:
    """The mean of backlash ±1.5w and ±0.5w: hysteresis with a rounded loop (Prandtl–Ishlinskii)."""
    path = _fine_path(r.motion, 1.0 / r.conditions.sample_rate)
    wide, narrow = (_play(path, f * p["half"], p["start"]) for f in (1.5, 0.5))
    return r.value + (0.5 * (wide + narrow) - path)[::_PLAY_STEPS]


def sliding_linkage(r: SensorSignal, p: Params) -> Array:
    """The reading lags by z with dz = dβ − |dβ| z/w: a linkage that deflects before it slides (Dahl)."""
    path = _fine_path(r.motion, 1.0 / r.conditions.sample_rate)
    z = -p["start"] * p["half"]
    out = np.empty_like(path)
    move = np.diff(path, axis=0, prepend=path[:1])
    for k in range(path.shape[0]):
        # Exact for a step in one direction.
        side = np.sign(move[k]) * p["half"]
        z = side + (z - side) * np.exp(-np.abs(move[k]) / p["half"])
        out[k] = z
    return r.value - out[::_PLAY_STEPS]


# ---- curve


def cubic_curve(r: SensorSignal, p: Params) -> Array:
    """Adds s y³."""
    return r.value + p["s"] * r.value**3


def sine_curve(r: SensorSignal, p: Params) -> Array:
    """sin(ky)/k for s < 0, sinh(ky)/k for s > 0, k = √(6|s|)."""
    k = np.sqrt(6.0 * np.abs(p["s"]))
    return np.where(p["s"] < 0.0, np.sin(k * r.value), np.sinh(k * r.value)) / k


def tangent_curve(r: SensorSignal, p: Params) -> Array:
    """tan(ky)/k for s > 0, arctan(ky)/k for s < 0, k = √(3|s|)."""
    k = np.sqrt(3.0 * np.abs(p["s"]))
    return np.where(p["s"] < 0.0, np.arctan(k * r.value), np.tan(k * r.value)) / k


def loaded_potentiometer(r: SensorSignal, p: Params) -> Array:
    """A loaded potentiometer of span 2π/3: u/(1 + ρ u (1 − u)) at u = ½ + y/span; unit slope, zero at 0."""
    span = 2.0 * np.pi / 3.0
    rho, u = p["s"], 0.5 + r.value / span
    middle = 0.5 / (1.0 + rho / 4.0)
    slope = 1.0 / (1.0 + rho / 4.0)
    return span * (u / (1.0 + rho * u * (1.0 - u)) - middle) / slope


# ---- added


def drift(r: SensorSignal, p: Params) -> Array:
    """Adds d (t/T)^n."""
    t = r.conditions.time / r.conditions.duration
    return r.value + p["drift"] * t[:, None] ** p["exponent"]


def settling_drift(r: SensorSignal, p: Params) -> Array:
    """Adds d (1 − e^(−t/τ))/(1 − e^(−T/τ)): warming up."""
    t = r.conditions.time[:, None]
    return r.value + p["drift"] * np.expm1(-t / p["time"]) / np.expm1(-r.conditions.duration / p["time"])


def hum(r: SensorSignal, p: Params) -> Array:
    """Adds a (sin(2πft + φ) + h sin(6πft + φ3))."""
    arg = 2.0 * np.pi * p["frequency"] * r.conditions.time[:, None]
    return r.value + p["amplitude"] * (
        np.sin(arg + p["phase"]) + p["third"] * np.sin(3.0 * arg + p["third_phase"])
    )


def hum_harmonic(r: SensorSignal, p: Params) -> Array:
    """Adds a sin(4πft + φ): hum from a rectifier or a lamp."""
    return r.value + p["amplitude"] * np.sin(
        4.0 * np.pi * p["frequency"] * r.conditions.time[:, None] + p["phase"]
    )


_WANDERS_EACH = 0.5  # s, between two steps of the mains' frequency


def hum_wandering(r: SensorSignal, p: Params) -> Array:
    """Hum whose frequency differs by run and wanders within it, and whose amplitude differs by run.

    The frequency is the run's own plus a random walk with steps of ``step`` (Hz) twice a second.
    """
    t = r.conditions.time
    out = np.array(r.value)
    for run in range(out.shape[1]):
        rng = np.random.default_rng([int(p["seed"][run]), run])
        each = _WANDERS_EACH * r.conditions.time_scale**-1
        knots = np.arange(int(t[-1] / each) + 3) * each
        own = p["frequency"][run] + p["apart"][run] * rng.standard_normal()
        frequency = own + p["step"][run] * np.cumsum(rng.standard_normal(knots.size))
        turns = np.concatenate([[0.0], np.cumsum(frequency[:-1] * each)])
        size = p["amplitude"][run] * np.exp(0.3 * rng.standard_normal())
        phase = 2.0 * np.pi * np.interp(t, knots, turns) + p["phase"][run]
        out[:, run] += size * np.sin(phase)
    return out


def hum_bursts(r: SensorSignal, p: Params) -> Array:
    """Hum with a slowly varying amplitude: a (1 + ½ sin(2π f2 t + φ2)) sin(2πft + φ)."""
    t = r.conditions.time[:, None]
    swell = 1.0 + 0.5 * np.sin(2.0 * np.pi * p["slow"] * t + p["third_phase"])
    return r.value + p["amplitude"] * swell * np.sin(2.0 * np.pi * p["frequency"] * t + p["phase"])


# ---- limit


def clipping(r: SensorSignal, p: Params) -> Array:
    """−L ≤ y ≤ L; no lower limit where ``lower`` is 0."""
    low = np.where(p["lower"] > 0.0, -p["limit"], -np.inf)
    return np.clip(r.value, low, p["limit"])


def soft_clipping(r: SensorSignal, p: Params) -> Array:
    """|y| is linear below (1 − k) L and approaches L exponentially above."""
    size = np.abs(r.value)
    knee = (1.0 - p["knee"]) * p["limit"]
    over = np.maximum(size - knee, 0.0)
    room = p["knee"] * p["limit"]
    return np.sign(r.value) * (np.minimum(size, knee) + room * (-np.expm1(-over / room)))


# ---- rounding


def coarse_rounding(r: SensorSignal, p: Params) -> Array:
    """Rounds to a multiple of a step."""
    return np.round(r.value / p["step"]) * p["step"]


def coarse_truncation(r: SensorSignal, p: Params) -> Array:
    """Rounds down to a multiple of a step."""
    return np.floor(r.value / p["step"]) * p["step"]


def uneven_rounding(r: SensorSignal, p: Params) -> Array:
    """Rounds to steps of alternating width: even and odd levels are a quarter step off their place."""
    level = np.round(r.value / p["step"])
    return p["step"] * (level + 0.25 * (np.mod(level, 2.0) - 0.5))
