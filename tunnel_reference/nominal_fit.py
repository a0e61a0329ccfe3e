"""Small joint fits of the nominal model by Gauss–Newton: damped sinusoids in closed form, and driven runs.

They scale effects by the residual after the fit. They are not estimators of the project.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tunnel_reference.driven_inputs import linear_response
from tunnel_reference.true_conditions import FRONTAL_AREA, REFERENCE_LENGTH, Array, TrueConditions

_ITERATIONS = 12
_TOLERANCE = 1e-6
_STEP = np.array([1e-5, 1e-5, 1e-4, 1e-4])  # of a finite difference
_CLOSE = 1e-3  # of a noise variance: negligible fall of the residual power


@dataclass(frozen=True, eq=False)
class NominalFit:
    """The nominal model fitted to a campaign.

    Args:
        parameters: Izz, Cr, Cnβ, Cnr, shape (4,).
        zero: the sensor's zero, rad.
        residual_power: mean squared residual per run, rad², shape (runs,).
        residual: shape (runs, n), rad.
    """

    parameters: Array
    zero: float
    residual_power: Array
    residual: Array


@np.errstate(over="ignore", invalid="ignore")  # a step to a diverging motion is rejected
def fit_nominal(c: TrueConditions, readings: Array) -> NominalFit:
    """Fit Izz, Cr, Cnβ, Cnr, the zero and the initial state of every run to the readings.

    Args:
        c: conditions; the fit uses the stated stiffness and speed, and starts from the true coefficients.
        readings: shape (n, runs), rad; n may be less than the number of samples in a run.

    Returns:
        The fit; its residuals are noise where the nominal model holds.
    """
    y = np.ascontiguousarray(readings.T)
    time = c.time[: y.shape[1]]
    p = np.array([c.yaw_inertia, c.mechanical_damping, c.cn_beta, c.cn_r])
    scale = np.array([1e-3, 1e-3, 1e-2, 1e-2])
    best = np.inf
    step: NDArray[np.float64] = np.zeros(4)
    kept: tuple[Array, float, Array, Array] | None = None
    for _ in range(_ITERATIONS):
        # σ and ωd per run, shape (R,), and their gradients with respect to the four coefficients, shape (R, 4)
        inertia, damping, cn_beta, cn_r = p
        moment = 0.5 * c.air_density * c.wind_speed**2 * FRONTAL_AREA * REFERENCE_LENGTH
        lever = 0.5 * c.air_density * c.wind_speed * FRONTAL_AREA * REFERENCE_LENGTH**2
        sigma = (damping - lever * cn_r) / (2.0 * inertia)
        square = (c.spring_stiffness - moment * cn_beta) / inertia
        omega = np.sqrt(np.maximum(square - sigma**2, 0.25))
        ones = np.ones_like(sigma)
        d_sigma = np.stack([-sigma / inertia, ones / (2 * inertia), 0 * ones, -lever / (2 * inertia)], axis=1)
        d_square = np.stack([-square / inertia, 0 * ones, -moment / inertia, 0 * ones], axis=1)
        d_omega = (d_square / 2.0 - sigma[:, None] * d_sigma) / omega[:, None]
        decay = np.exp(-sigma[:, None] * time)
        phase = omega[:, None] * time
        cosine, sine = decay * np.cos(phase), decay * np.sin(phase)  # shape (R, n)
        # Amplitudes a, b per run and the common zero for given rates, by linear least squares.
        basis = np.stack([cosine, sine], axis=1)
        gram = basis @ basis.transpose(0, 2, 1)
        sums = basis.sum(axis=2)
        right = np.einsum("rkn,rn->rk", basis, y)
        reduce = np.linalg.solve(gram, np.stack([right, sums], axis=2))
        fitted, levels = reduce[:, :, 0], reduce[:, :, 1]
        numerator = y.sum() - np.einsum("rk,rk->", sums, fitted)
        zero = float(numerator / (y.size - np.einsum("rk,rk->", sums, levels)))
        ab = fitted - zero * levels
        a, b = ab[:, 0], ab[:, 1]
        model = a[:, None] * cosine + b[:, None] * sine
        residual = y - model - zero
        power = np.einsum("rn,rn->r", residual, residual) / y.shape[1]
        cost = float(power.sum())
        if not cost < best:
            step = step / 4.0
            p = p - 3.0 * step
            if np.max(np.abs(step / scale)) < _TOLERANCE:
                break
            continue
        improved = best - cost
        best, kept = cost, (p, zero, power, residual)
        quadrature = b[:, None] * cosine - a[:, None] * sine
        columns = np.stack([cosine, sine, -time * model, time * quadrature], axis=1)
        step = _newton(columns, residual, d_sigma, d_omega)
        if np.max(np.abs(step / scale)) < _TOLERANCE or improved < 1e-7 * cost:
            break
        p = p + step
    if kept is None:
        raise ValueError("the readings must be finite")
    return NominalFit(*kept)


def _newton(columns: Array, residual: Array, d_sigma: Array, d_omega: Array) -> Array:
    """The Gauss–Newton step of the four shared parameters, with initial states and zero projected out.

    ``columns`` has shape (R, 4, n): the basis of the initial state, and the derivatives with respect to σ and ωd.
    """
    runs, _, n = columns.shape
    gram = columns @ columns.transpose(0, 2, 1)
    sums = columns.sum(axis=2)
    right = np.einsum("rkn,rn->rk", columns, residual)
    # Unknowns: the four parameters, then the zero; initial states are eliminated run by run.
    shape = np.zeros((runs, 2, 5))
    shape[:, 0, :4], shape[:, 1, :4] = d_sigma, d_omega
    moment = np.zeros((5, 5))
    load = np.zeros(5)
    for r in range(runs):
        t = shape[r]
        cross = gram[r][:2, 2:] @ t
        cross[:, 4] += sums[r, :2]
        full = t.T @ gram[r][2:, 2:] @ t
        full[4, :] += sums[r, 2:] @ t
        full[:, 4] += t.T @ sums[r, 2:]
        full[4, 4] += n
        target = t.T @ right[r, 2:]
        target[4] += residual[r].sum()
        solved = np.linalg.solve(gram[r][:2, :2], np.column_stack([cross, right[r, :2]]))
        moment += full - cross.T @ solved[:, :5]
        load += target - cross.T @ solved[:, 5]
    diagonal = np.sqrt(np.maximum(np.diag(moment), 1e-30))
    scaled = moment / np.outer(diagonal, diagonal)
    answer = np.linalg.lstsq(scaled, load / diagonal, rcond=1e-11)[0] / diagonal
    return np.asarray(answer[:4], dtype=np.float64)


def fit_driven(c: TrueConditions, readings: Array) -> NominalFit:
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
            # the free motion fitted so far, continued at the changed rates
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


def _free_motion(c: TrueConditions, p: Array, time: Array) -> Array:
    """Orthonormal free motions of every run, shape (runs, samples, 2)."""
    flow = 0.5 * c.air_density * c.wind_speed * FRONTAL_AREA * REFERENCE_LENGTH
    sigma = (p[1] - flow * REFERENCE_LENGTH * p[3]) / (2.0 * p[0])
    omega = np.sqrt(np.maximum((c.spring_stiffness - flow * c.wind_speed * p[2]) / p[0] - sigma**2, 0.25))
    wave = np.exp((-sigma + 1j * omega)[:, None] * time)
    return np.asarray(np.linalg.qr(np.stack([wave.real, wave.imag], axis=2))[0])
