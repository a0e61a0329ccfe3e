"""Laws of moments and of the sensor that belong to no known family.

Moments are in N m on the right-hand side of Izz β̈ = …; ``rows`` are the runs that a law applies to, ``p`` its
parameters by run.
"""

from __future__ import annotations

import numpy as np

from tunnel_reference.conditions import Array
from tunnel_reference.integrator import Params, Rows, Stage
from tunnel_reference.readings import Params as ReadingParams
from tunnel_reference.readings import Reading


def stop(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−k max(|θ| − θs, 0) sgn θ: rubber stops on both sides, or (``one_sided``) on the positive side only."""
    t = s.theta[rows]
    lower = np.where(p["one_sided"] > 0.0, 0.0, np.maximum(-t - p["place"], 0.0))
    s.top[rows] -= p["stiffness"] * (np.maximum(t - p["place"], 0.0) - lower)


def ripple(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−M sin(nθ): cogging of a motor or a magnetic bearing."""
    s.top[rows] -= p["moment"] * np.sin(p["number"] * s.theta[rows])


def dashpot(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−c exp(−(θ/w)²) θ̇: a damper that acts near the middle only."""
    s.top[rows] -= p["coefficient"] * np.exp(-((s.theta[rows] / p["width"]) ** 2)) * s.omega[rows]


def widening_damping(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−c (θ/0.1)² θ̇: damping that grows away from the middle, with the wind off too."""
    s.top[rows] -= p["coefficient"] * (s.theta[rows] / 0.1) ** 2 * s.omega[rows]


def one_way_damping(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−c max(θ̇, 0): a damper that acts in one direction."""
    s.top[rows] -= p["coefficient"] * np.maximum(s.omega[rows], 0.0)


def bouc_wen(s: Stage, rows: Rows, p: Params, x: Array, dx: Array) -> None:
    """−k z with ż = θ̇ − |θ̇| |z| z/zs²: a hysteresis loop that saturates softly (Wen 1976)."""
    omega = s.omega[rows]
    s.top[rows] -= p["stiffness"] * x[0]
    dx[0] = omega - np.abs(omega) * np.abs(x[0]) * x[0] / p["slide"] ** 2


def stall(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−M q/q₂₀ tanh((|β| − βs)/w)₊ sgn β: a yaw moment that breaks away beyond an angle; M per 20 m/s."""
    beta = s.beta[rows]
    beyond = np.maximum(np.tanh((np.abs(beta) - p["place"]) / p["width"]), 0.0)
    s.body[rows] -= p["moment"] * p["pressure"] * beyond * np.sign(beta)


def wake(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """+M q/q₂₀ (β/w) exp(½ − β²/2w²): the air's moment departs from its line near zero yaw."""
    t = s.beta[rows] / p["width"]
    s.body[rows] += p["moment"] * p["pressure"] * t * np.exp(0.5 - 0.5 * t * t)


def slip(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """+Kr e θ after t0: a clamp that slips, in every run."""
    s.top[rows] += s.stiffness[rows] * p["share"] * (s.time > p["when"]) * s.theta[rows]


def fading_friction(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Tc exp(−t/τ): a bearing that runs in during every run."""
    s.level[rows] += p["moment"] * np.exp(-s.time / p["time"])


def reading_ripple(r: Reading, p: ReadingParams) -> Array:
    """Adds a sin(n y): the windings of a potentiometer."""
    return np.asarray(r.value + p["size"] * np.sin(p["number"] * r.value))


def reading_kink(r: Reading, p: ReadingParams) -> Array:
    """Adds g |y|: another gain on one side."""
    return np.asarray(r.value + p["gain"] * np.abs(r.value))


def gain_change(r: Reading, p: ReadingParams) -> Array:
    """Multiplies by 1 + g after t0."""
    return r.value * (1.0 + p["gain"] * (r.conditions.time[:, None] > p["when"]))


def zero_step(r: Reading, p: ReadingParams) -> Array:
    """Adds d after t0, in the runs where d is not zero."""
    return r.value + p["step"] * (r.conditions.time[:, None] > p["when"])


def wandering_zero(r: Reading, p: ReadingParams) -> Array:
    """Adds a random walk of the sensor's zero, of standard deviation d over one run."""
    steps = r.rng.standard_normal(r.value.shape) / np.sqrt(r.value.shape[0])
    return np.asarray(r.value + p["size"] * np.cumsum(steps, axis=0))


def clock_jitter(r: Reading, p: ReadingParams) -> Array:
    """Samples at random times about the stated ones: y + β̇ ε."""
    return r.value + r.motion.rate * p["jitter"] * r.rng.standard_normal(r.value.shape)


def motion_noise(r: Reading, p: ReadingParams) -> Array:
    """Noise of standard deviation n |β| (a worn track)."""
    noise = p["level"] * np.abs(r.motion.angle) * r.rng.standard_normal(r.value.shape)
    return np.asarray(r.value + noise)


def amplitude_zero(r: Reading, p: ReadingParams) -> Array:
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


def held_samples(r: Reading, p: ReadingParams) -> Array:
    """At random times the reading is held for ``length`` seconds."""
    n, runs = r.value.shape
    out = r.value.copy()
    length = int(p["length"][0] * r.conditions.sample_rate)
    for run in range(runs):
        starts = np.flatnonzero(r.rng.random(n) < p["rate"][run] / r.conditions.sample_rate)
        for start in starts:
            out[start : start + length, run] = out[start, run]
    return out


def spikes(r: Reading, p: ReadingParams) -> Array:
    """Errors of standard deviation ``size`` in single samples, ``rate`` per second."""
    hit = r.rng.random(r.value.shape) < p["rate"] / r.conditions.sample_rate
    return np.asarray(r.value + hit * p["size"] * r.rng.standard_normal(r.value.shape))
