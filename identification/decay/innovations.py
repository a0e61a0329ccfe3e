"""The likelihood of a decay that a random moment drives: steady Kalman filter as a recursive filter.

State (β, β̇) with β̈ + 2aβ̇ + kβ = w(t); w is white with ⟨w(t)w(t′)⟩ = q δ(t − t′), or of corner frequency fb,
ẇ = −2πfb (w − white), with the same q at low frequency; the reading adds white noise of variance R. In
discrete time the reading obeys D(z) y = C(z) e: D is the characteristic polynomial of the motion, and C and
the variance of the innovations e follow by spectral factorisation of R D(z)D(1/z) + γ(z), γ the covariance of
the driven part. So innovations are one call of a recursive filter over the record, with no loop in Python.

The initial state and the sensor's zero are unknown and enter linearly: their responses are filtered like the
reading and fitted to it by least squares. The covariance that the steady filter assumes for the initial state
then has no influence. Where q is 0, C is D and the innovations are output error's residual. Sources: Maine &
Iliff, SIAM J. Appl. Math. 41 (1981) 558–579, doi 10.1137/0141046; Åström, Automatica 16 (1980) 551–574, doi
10.1016/0005-1098(80)90078-3; Jategaonkar, Flight Vehicle System Identification, 2nd ed. (2015), ch. 5, doi
10.2514/4.102790.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from identification.decay.damped_oscillation import Decay, response_rows
from tunnel_sim.vocabulary.record import Array

_GREATEST = 1e60  # of a growth or a variance over one interval: beyond it no filter is formed


@dataclass(frozen=True)
class Driven:
    """A decay and the random moment that drives it.

    Args:
        intensity: q, spectral intensity of the moment per inertia, rad²/s³; 0 where there is none.
        corner: fb, Hz, of the moment's spectrum; None where it is white.
    """

    decay: Decay
    intensity: float
    corner: float | None = None

    @property
    def intensity_at_resonance(self) -> float:
        """The moment's spectral intensity at ωn, which the motion shows best: q/(1 + (ωn/2πfb)²), rad²/s³."""
        if self.corner is None:
            return self.intensity
        return self.intensity / (1.0 + self.decay.stiffness / (2.0 * np.pi * self.corner) ** 2)


@dataclass(frozen=True, eq=False)
class Innovations:
    """The prediction errors of a model.

    Args:
        values: shape (n,), rad.
        variance: their expected variance, rad².
        cost: −2 ln L up to a constant, dimensionless.
    """

    values: Array
    variance: float
    cost: float


def innovations(values: Array, interval: float, model: Driven, noise_variance: float) -> Innovations | None:
    """One-step prediction errors, with the initial state and the zero at their best.

    Args:
        values: readings or block means, shape (n,), rad.
        interval: between them, s.
        noise_variance: R, of one value, rad².

    Returns:
        The innovations; None where the model is out of range.
    """
    time = interval * np.arange(values.size, dtype=np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        motion = response_rows(time, model.decay)[:2]
    columns = np.vstack((values, motion, np.ones_like(time), *_started_by_moment(time, model)))
    if not np.isfinite(columns).all():
        return None
    variance = noise_variance
    if model.intensity > 0.0:
        from scipy.signal import lfilter  # only here: slow to load

        factors = _factored(interval, model, noise_variance)
        if factors is None:
            return None
        motion_polynomial, filter_polynomial, variance = factors
        columns = lfilter(motion_polynomial, filter_polynomial, columns, axis=1)
    lengths = np.linalg.norm(columns[1:], axis=1, keepdims=True)
    if not (np.isfinite(columns[0]).all() and lengths.min() > 0.0 and lengths.max() < np.inf):
        return None
    regressors = columns[1:] / lengths
    gram = regressors @ regressors.T
    try:
        solution = np.linalg.solve(gram, regressors @ columns[0])
    except np.linalg.LinAlgError:
        return None
    left = columns[0] - solution @ regressors
    return Innovations(left, variance, float(left.size * np.log(variance) + left @ left / variance))


def _started_by_moment(time: Array, model: Driven) -> tuple[Array, ...]:
    # A moment that is not white has an unknown initial value. Its response is e^(−ct) less a free motion, which is
    # among the columns already.
    if model.corner is None or model.intensity == 0.0:
        return ()
    return (np.exp(-2.0 * np.pi * model.corner * time),)


def _factored(interval: float, model: Driven, noise_variance: float) -> tuple[Array, Array, float] | None:
    # D, C and the innovations' variance.
    transition, disturbance = _discrete(interval, model)
    if not max(np.abs(transition).max(), np.abs(disturbance).max()) < _GREATEST:
        return None
    size = transition.shape[0]
    characteristic = np.real(np.poly(transition))
    # D(z) y = Σ mᵢ w(t−1−i) with mᵢ the first row of Φⁱ + d₁Φⁱ⁻¹ + … + dᵢ (Faddeev and LeVerrier).
    matrix, rows = np.eye(size), []
    for i in range(size):
        rows.append(matrix[0])
        matrix = transition @ matrix + characteristic[i + 1] * np.eye(size)
    moving = np.array(rows)
    covariance = moving @ disturbance @ moving.T
    gammas = [float(np.trace(covariance, offset=j)) for j in range(size)] + [0.0]
    own = np.correlate(characteristic, characteristic, "full")[size:]
    lags = noise_variance * own + np.array(gammas)
    roots = np.roots(np.concatenate((lags[:0:-1], lags)))
    stable = roots[np.argsort(np.abs(roots))[:size]]
    if not np.isfinite(roots).all() or roots.size != 2 * size or np.abs(stable).max() >= 1.0:
        return None
    filtering = np.real(np.poly(stable))
    variance = float(lags[0] / (filtering @ filtering))
    return (characteristic, filtering, variance) if variance > 0.0 else None


def _discrete(interval: float, model: Driven) -> tuple[Array, Array]:
    # Transition and covariance of the disturbance over one interval (Van Loan, IEEE Trans. Automat. Contr. 23
    # (1978) 395–404, doi 10.1109/TAC.1978.1101743).
    a, k = model.decay.rate, model.decay.stiffness
    if model.corner is None:
        dynamics = np.array([[0.0, 1.0], [-k, -2.0 * a]])
        drive = np.diag([0.0, model.intensity])
    else:
        c = 2.0 * np.pi * model.corner
        dynamics = np.array([[0.0, 1.0, 0.0], [-k, -2.0 * a, 1.0], [0.0, 0.0, -c]])
        drive = np.diag([0.0, 0.0, model.intensity * c**2])
    size = dynamics.shape[0]
    block = np.zeros((2 * size, 2 * size))
    block[:size, :size], block[:size, size:], block[size:, size:] = -dynamics, drive, dynamics.T
    exponential = expm(block * interval)
    transition = exponential[size:, size:].T
    disturbance = transition @ exponential[:size, size:]
    return transition, 0.5 * (disturbance + disturbance.T)
