"""Laws of the sensor outside the known families."""

from __future__ import annotations

import numpy as np

from tunnel_reference.conditions import Array
from tunnel_reference.readings import Params, Reading


def gain_change(r: Reading, p: Params) -> Array:
    """Multiplies by 1 + g after t0."""
    return r.value * (1.0 + p["gain"] * (r.conditions.time[:, None] > p["when"]))


def zero_step(r: Reading, p: Params) -> Array:
    """Adds d after t0, in the runs where d is not zero."""
    return r.value + p["step"] * (r.conditions.time[:, None] > p["when"])


def wandering_zero(r: Reading, p: Params) -> Array:
    """Adds a random walk of the sensor's zero, of standard deviation d over one run."""
    steps = r.rng.standard_normal(r.value.shape) / np.sqrt(r.value.shape[0])
    return np.asarray(r.value + p["size"] * np.cumsum(steps, axis=0))


def clock_jitter(r: Reading, p: Params) -> Array:
    """Samples at random times about the stated ones: y + β̇ ε."""
    return r.value + r.motion.rate * p["jitter"] * r.rng.standard_normal(r.value.shape)


def motion_noise(r: Reading, p: Params) -> Array:
    """Noise of standard deviation n |β| (a worn track)."""
    noise = p["level"] * np.abs(r.motion.angle) * r.rng.standard_normal(r.value.shape)
    return np.asarray(r.value + noise)


def amplitude_zero(r: Reading, p: Params) -> Array:
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


def held_samples(r: Reading, p: Params) -> Array:
    """At random times the reading is held for ``length`` seconds."""
    n, runs = r.value.shape
    out = r.value.copy()
    length = int(p["length"][0] * r.conditions.sample_rate)
    for run in range(runs):
        starts = np.flatnonzero(r.rng.random(n) < p["rate"][run] / r.conditions.sample_rate)
        for start in starts:
            out[start : start + length, run] = out[start, run]
    return out


def spikes(r: Reading, p: Params) -> Array:
    """Errors of standard deviation ``size`` in single samples, ``rate`` per second."""
    hit = r.rng.random(r.value.shape) < p["rate"] / r.conditions.sample_rate
    return np.asarray(r.value + hit * p["size"] * r.rng.standard_normal(r.value.shape))
