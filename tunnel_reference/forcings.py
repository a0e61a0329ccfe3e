"""Random moments as time series: flat, Dryden, von Kármán and octave-band spectra, and wandering vortices."""

from __future__ import annotations

import numpy as np

from tunnel_reference.conditions import WIDTH, Array, Conditions

RATE = 1000.0


def _length(conditions: Conditions) -> int:
    """Number of points in a series that covers a run."""
    return round(conditions.duration * RATE) + 2


def _shaped(rng: np.random.Generator, n: int, power: Array) -> Array:
    """Gaussian noise of unit variance whose power spectrum over rfft bins is proportional to ``power``."""
    spectrum = np.sqrt(power) * (rng.standard_normal(power.size) + 1j * rng.standard_normal(power.size))
    spectrum[0] = 0.0
    series = np.fft.irfft(spectrum, n)
    expected = np.sqrt(2.0 * np.sum(power[1:]) * 2.0) / n
    return np.asarray(series / expected, dtype=np.float64)


def turbulence(kind: str, conditions: Conditions, *, seed: int, scale: float) -> Array:
    """Series of unit variance for every run (zero with the wind off), shape (runs, n).

    Args:
        kind: ``band`` (flat up to ``scale`` Hz), ``dryden`` or ``von_karman`` (integral length ``scale`` m),
            ``octave`` (a band of one octave about ``scale`` Hz).
        conditions: speeds and duration.
        scale: Hz or m, depending on ``kind``.
    """
    n = 2 ** int(np.ceil(np.log2(_length(conditions))))
    frequency = np.fft.rfftfreq(n, 1.0 / RATE)
    rng = np.random.default_rng(seed)
    out = np.zeros((conditions.runs, n))
    for run in np.flatnonzero(conditions.wind_on):
        reduced = frequency * scale / conditions.wind_speed[run]
        if kind == "band":
            power = (frequency < scale).astype(np.float64)
        elif kind == "octave":
            power = ((frequency > scale / 1.414) & (frequency < scale * 1.414)).astype(np.float64)
        elif kind == "dryden":
            power = 1.0 / (1.0 + (2.0 * np.pi * reduced) ** 2)
        else:
            power = 1.0 / (1.0 + 70.8 * reduced**2) ** (5.0 / 6.0)
        out[run] = _shaped(rng, n, power)
    return out[:, : _length(conditions)]


def wandering_vortex(conditions: Conditions, *, seed: int, strouhal: float, wander: float) -> Array:
    """The sine of a phase that advances at St V/width, with a random walk of ``wander`` rad/√s; shape (runs, n)."""
    rng = np.random.default_rng(seed)
    n = _length(conditions)
    frequency = strouhal * conditions.true_speed[:, None] / WIDTH
    walk = np.cumsum(rng.standard_normal((conditions.runs, n)), axis=1) * wander / np.sqrt(RATE)
    start = rng.uniform(0.0, 2.0 * np.pi, (conditions.runs, 1))
    wave = np.sin(2.0 * np.pi * frequency * np.arange(n) / RATE + start + walk)
    return np.asarray(wave * conditions.wind_on[:, None])
