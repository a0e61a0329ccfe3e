"""The nominal model fitted to driven runs, by Gauss–Newton on the linear rig's exact response to the input."""

from __future__ import annotations

import numpy as np

from tunnel_reference.conditions import FRONTAL_AREA, REFERENCE_LENGTH, Array, Conditions
from tunnel_reference.inputs import linear_response
from tunnel_reference.nominal_fit import NominalFit

_ITERATIONS = 12
_STEP = np.array([1e-5, 1e-5, 1e-4, 1e-4])  # of a difference
_CLOSE = 1e-3  # of a noise variance, below which the power may still fall


def fit_driven(c: Conditions, readings: Array) -> NominalFit:
    """Fit Izz, Cr, Cnβ, Cnr, the zero, an unknown gain and the initial state of every run to the readings.

    Args:
        c: conditions with an input; the fit uses the stated stiffness and speed, and starts from the truth.
        readings: shape (samples, runs), rad.

    Returns:
        The fit; its residuals are noise where the nominal model holds.

    Raises:
        ValueError: when the readings are not finite.
    """
    assert c.drive is not None
    if not np.all(np.isfinite(readings)):
        raise ValueError("the readings must be finite")
    y = np.ascontiguousarray(readings.T)
    time = np.arange(y.shape[1]) / c.sample_rate
    free_gain = c.drive.column == "drive" and not c.drive.stated
    p, gain, zero, best = (
        np.array([c.yaw_inertia, c.mechanical_damping, c.cn_beta, c.cn_r]),
        1.0,
        c.zero,
        np.inf,
    )
    step = np.zeros(6)
    kept: NominalFit | None = None
    for _ in range(_ITERATIONS):
        response = linear_response(c, p)
        modes = _free_motion(c, p, time)
        left = y - gain * response - zero
        own = np.einsum("rnk,rn->rk", modes, left)
        residual = left - np.einsum("rnk,rk->rn", modes, own)
        power = np.mean(residual**2, axis=1)
        if not float(power.mean()) < best:
            step /= 4.0
            p, gain, zero = p - 3.0 * step[:4], gain - 3.0 * step[4], zero - 3.0 * step[5]
            continue
        gained, best = best - float(power.mean()), float(power.mean())
        kept = NominalFit(p, zero, power, residual)
        if gained < _CLOSE * c.noise_power:
            break
        fitted = y - zero - residual
        columns = []
        for k in range(4):
            moved = p + _STEP * (np.arange(4) == k)
            changed = gain * linear_response(c, moved)
            free = _free_motion(c, moved, time)
            # the free motion fitted so far, carried on at the changed rates
            changed += np.einsum("rnk,rk->rn", free, np.einsum("rnk,rn->rk", free, fitted - gain * response))
            columns.append((changed - fitted) / _STEP[k])
        columns += [response if free_gain else np.zeros_like(response), np.ones_like(response)]
        reduced = [
            one - np.einsum("rnk,rk->rn", modes, np.einsum("rnk,rn->rk", modes, one)) for one in columns
        ]
        design = np.stack([one.ravel() for one in reduced])
        size = np.sqrt(np.maximum(np.einsum("kn,kn->k", design, design), 1e-300))
        normal = (design @ design.T) / np.outer(size, size)
        step = np.linalg.lstsq(normal, design @ residual.ravel() / size, rcond=1e-11)[0] / size
        p, gain, zero = p + step[:4], gain + step[4], zero + step[5]
    assert kept is not None
    return kept


def _free_motion(c: Conditions, p: Array, time: Array) -> Array:
    """Orthonormal free motions of every run, shape (runs, samples, 2)."""
    flow = 0.5 * c.air_density * c.wind_speed * FRONTAL_AREA * REFERENCE_LENGTH
    sigma = (p[1] - flow * REFERENCE_LENGTH * p[3]) / (2.0 * p[0])
    omega = np.sqrt(np.maximum((c.spring_stiffness - flow * c.wind_speed * p[2]) / p[0] - sigma**2, 0.25))
    wave = np.exp((-sigma + 1j * omega)[:, None] * time)
    return np.asarray(np.linalg.qr(np.stack([wave.real, wave.imag], axis=2))[0])
