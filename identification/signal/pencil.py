"""The matrix pencil: poles of a damped oscillation from the shift of a Hankel matrix, and their covariance.

Block means y of a decay are a sum of two exponentials λ₁ⁱ, λ₂ⁱ and a constant. Their Hankel matrix,
with the mean of each row removed, has rank two. A shift by one block maps its column space onto itself, and this
2×2 map has the eigenvalues λ. The two leading singular vectors of a long record are found by orthogonal iteration
with products by FFT, so the cost grows as n log n.

To first order δλ = qᴴ E v is linear in the noise's Hankel matrix E, so a convolution of q with v gives the
weight of every block mean in δλ, and with it the covariance. Source: Hua & Sarkar, IEEE Trans. Acoust.
Speech Signal Process. 38 (1990) 814–824, doi 10.1109/29.56027, which has the perturbation and the best pencil
length; the rank reduction and the name ERA for it: Juang & Pappa, J. Guid. Control Dyn. 8 (1985) 620–627,
doi 10.2514/3.20031.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from identification.signal.free_decay import Decay
from tunnel_sim.vocabulary.record import Array

_LENGTH = 0.35  # rows over blocks: a third is best at light damping, and more hardly helps elsewhere
_LEAST_BLOCKS = 8
_DENSE = 64  # values up to which a full decomposition is faster than the iteration, which noise alone slows
_MAX_SWEEPS = 60
_SETTLED = 1e-10  # change of the subspace in a sweep

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class PencilDecay:
    """A decay and its sensitivity to the noise.

    Args:
        weights: first-order change of (a, k) per rad of each value, shape (2, n).
    """

    decay: Decay
    weights: Array


def pencil_decay(values: Array, interval: float, omega: float) -> PencilDecay | None:
    """The decay of uniformly spaced values.

    Args:
        values: readings or block means of them, offset included, shape (n,), rad.
        interval: between them, s; well below half a period.
        omega: an approximate angular frequency to start the iteration, rad/s.

    Returns:
        The decay; None where there are too few values or their poles are not those of a decay.
    """
    if values.size < _LEAST_BLOCKS:
        return None
    rows = max(3, round(_LENGTH * values.size))
    found = _leading_pair(values - values.mean(), rows, omega * interval)
    if found is None:
        return None
    left, sizes, right = found
    upper, lower = left[:-1], left[1:]
    solver = np.linalg.pinv(upper)
    poles, vectors = np.linalg.eig(solver @ lower)
    exponents = _exponents(poles, interval)
    if exponents is None or np.linalg.cond(vectors) > 1e8:
        return None
    vectors = vectors.astype(np.complex128)
    duals = np.linalg.inv(vectors) @ solver
    images = right.astype(np.complex128) @ (vectors / sizes[:, None])
    gradients = [_gradient(poles[i], duals[i], images[:, i]) / (poles[i] * interval) for i in (0, 1)]
    stiffness = exponents[0] * exponents[1]
    slope = np.array(
        [
            -0.5 * (gradients[0] + gradients[1]),
            exponents[1] * gradients[0] + exponents[0] * gradients[1],
        ]
    )
    decay = Decay(float(-0.5 * (exponents[0] + exponents[1]).real), float(stiffness.real))
    return PencilDecay(decay, np.ascontiguousarray(slope.real))


def _exponents(poles: Complex, interval: float) -> Complex | None:
    # Two real poles are an overdamped decay; a pole at or below zero is not a decay.
    if np.any((np.abs(poles.imag) == 0.0) & (poles.real <= 0.0)):
        return None
    return np.asarray(np.log(poles.astype(np.complex128)) / interval)


def _leading_pair(values: Array, rows: int, angle: float) -> tuple[Array, Array, Array] | None:
    # Left vectors (rows, 2), singular values (2,), right vectors (columns, 2) of the row-centred Hankel matrix.
    columns = values.size - rows + 1
    if values.size <= _DENSE:
        hankel = sliding_window_view(values, columns)
        vectors, sizes, turn = np.linalg.svd(hankel - hankel.mean(axis=1, keepdims=True), full_matrices=False)
        found = vectors[:, :2], sizes[:2], turn[:2].T
    else:
        found = _iterated_pair(values, rows, columns, angle)
    sizes = found[1]
    return found if sizes[1] > 1e-12 * sizes[0] > 0.0 else None


def _iterated_pair(values: Array, rows: int, columns: int, angle: float) -> tuple[Array, Array, Array]:
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


def _gradient(pole: complex, dual: Complex, right: Complex) -> Complex:
    # δλ = Σᵢⱼ q(i) e(i + j) v(j): q is the shift's residual on the dual vector; the mean of v is removed, like
    # that of the rows.
    q = np.zeros(dual.size + 1, dtype=np.complex128)
    q[1:] += dual
    q[:-1] -= pole * dual
    return np.asarray(np.convolve(q, right - right.mean()))
