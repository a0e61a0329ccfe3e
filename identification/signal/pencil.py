"""The matrix pencil: poles of a damped oscillation from the shift of a Hankel matrix, and their covariance.

The Hankel matrix of a decay, with the mean of each row removed, has rank two. A shift by one value maps its
column space onto itself, and the eigenvalues of this 2×2 map are the exponentials of the poles. The two leading
singular vectors of a long record are found by orthogonal iteration with products by FFT. Sources: Hua & Sarkar,
IEEE Trans. Acoust. Speech Signal Process. 38 (1990) 814–824, doi 10.1109/29.56027 (perturbation, best length);
Juang & Pappa, J. Guid. Control Dyn. 8 (1985) 620–627, doi 10.2514/3.20031 (rank reduction).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.fft import irfft, next_fast_len, rfft

from identification.signal.free_decay import Decay
from tunnel_sim.vocabulary.record import Array

_LENGTH = 0.35  # rows over blocks: a third is best at light damping, and more hardly helps elsewhere
_LEAST_BLOCKS = 8
_DENSE = 64  # values up to which a full decomposition is faster than the iteration, which noise alone slows
_MAX_SWEEPS = 60
_SETTLED = 1e-10  # change of the subspace in a sweep


@dataclass(frozen=True, eq=False)
class PencilDecay:
    """A decay and its sensitivity to the noise.

    Args:
        weights: first-order change of (a, k) per rad of each value, shape (2, n).
    """

    decay: Decay
    weights: Array


def pencil_decay(values: Array, interval: float, omega: float) -> PencilDecay | None:
    """The decay of uniformly spaced values; None where there are too few, or their poles are not those of a decay.

    Args:
        values: readings or block means of them, offset included, shape (n,), rad.
        interval: between them, s; well below half a period.
        omega: an approximate angular frequency to start the iteration, rad/s.
    """
    if values.size < _LEAST_BLOCKS:
        return None
    rows = max(3, round(_LENGTH * values.size))
    left, sizes, right = _leading_pair(values - values.mean(), rows, omega * interval)
    if not sizes[1] > 1e-12 * sizes[0] > 0.0:
        return None
    upper, lower = left[:-1], left[1:]
    solver = np.linalg.pinv(upper)
    poles, vectors = np.linalg.eig(solver @ lower)
    # Two real poles are an overdamped decay; a pole at or below zero is not a decay.
    if np.any((np.abs(poles.imag) == 0.0) & (poles.real <= 0.0)) or np.linalg.cond(vectors) > 1e8:
        return None
    exponents = np.log(poles.astype(np.complex128)) / interval
    vectors = vectors.astype(np.complex128)
    duals = np.linalg.inv(vectors) @ solver
    images = right.astype(np.complex128) @ (vectors / sizes[:, None])
    gradients = []
    for pole, dual, image in zip(poles, duals, images.T, strict=True):
        # To first order δλ = Σᵢⱼ q(i) e(i + j) v(j) with the noise e: q is the shift's residual on the dual vector;
        # the mean of v is removed, like that of the rows.
        q = np.zeros(dual.size + 1, dtype=np.complex128)
        q[1:] += dual
        q[:-1] -= pole * dual
        gradients.append(np.convolve(q, image - image.mean()) / (pole * interval))
    stiffness = exponents[0] * exponents[1]
    slope = np.array(
        [
            -0.5 * (gradients[0] + gradients[1]),
            exponents[1] * gradients[0] + exponents[0] * gradients[1],
        ]
    )
    decay = Decay(float(-0.5 * (exponents[0] + exponents[1]).real), float(stiffness.real))
    return PencilDecay(decay, np.ascontiguousarray(slope.real))


def _leading_pair(values: Array, rows: int, angle: float) -> tuple[Array, Array, Array]:
    """Left vectors (rows, 2), singular values (2,), right vectors (columns, 2) of the row-centred Hankel matrix."""
    columns = values.size - rows + 1
    if values.size <= _DENSE:
        hankel = sliding_window_view(values, columns)
        vectors, sizes, turn = np.linalg.svd(hankel - hankel.mean(axis=1, keepdims=True), full_matrices=False)
        return vectors[:, :2], sizes[:2], turn[:2].T
    size = next_fast_len(values.size, real=True)
    spectrum = rfft(values, size)[:, None]

    def times(block: Array, count: int) -> Array:
        return np.asarray(irfft(spectrum * rfft(block, size, axis=0).conj(), size, axis=0)[:count])

    steps = angle * np.arange(columns)[:, None]
    right = np.hstack((np.cos(steps), np.sin(steps)))
    right = np.linalg.qr(right - right.mean(axis=0))[0]
    for _ in range(_MAX_SWEEPS):
        left = np.linalg.qr(times(right, rows))[0]
        image = times(left, columns)
        image -= image.mean(axis=0)
        before = right
        right = np.linalg.qr(image)[0]
        if np.linalg.norm(right - before @ (before.T @ right)) < _SETTLED:
            break
    vectors, sizes, turn = np.linalg.svd(image, full_matrices=False)
    return left @ turn.T, sizes, vectors
