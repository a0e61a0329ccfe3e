"""The input of the first network: three cycles of a free decay, as 100 numbers that depend on ζ alone.

From a zero crossing on, every free decay is an impulse response (paper, eq. 12): e^{−ζωn t} sin ωd t. With time in
units of t3, the time of three damped cycles, it no longer depends on ωn:

    y(τ) = e^{−6πκτ} sin 6πτ,   κ = ζ/√(1 − ζ²),   τ = t/t3 from 0 to 1.

Each of the 100 numbers is the mean over a hundredth of that axis. Their mean is removed, and they are divided by
the largest value of the first half cycle, so that they depend neither on the amplitude nor on the sensor's zero.
The largest value is that of a quartic through the points of the half cycle, which is less sensitive to noise than
their maximum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.vocabulary.record import Array

POINTS = 100
CYCLES = 3
_FIRST_HALF = 17  # points of the first half cycle: 100/6, rounded up
_QUARTIC = np.vander(np.linspace(-1.0, 1.0, _FIRST_HALF), 5)
_SMOOTHER = np.linalg.pinv(_QUARTIC)
_FINE = np.vander(np.linspace(-1.0, 1.0, 2001), 5) @ _SMOOTHER


@dataclass(frozen=True, eq=False)
class Shape:
    """A normalised response.

    Args:
        inputs: the network's, shape (100,).
        scale: divisor of the points, the amplitude, in the unit of the points.
        peak_weights: weights of the points in the scale, shape (100,).
    """

    inputs: Array
    scale: float
    peak_weights: Array

    def pull_back(self, gradient: Array) -> Array:
        """The gradient by the points, from that by the inputs; both of shape (100,)."""
        pulled = (gradient - self.peak_weights * float(gradient @ self.inputs)) / self.scale
        return np.asarray(pulled - pulled.mean())


def normalise(points: Array) -> Shape:
    """Remove the mean and scale the first half cycle's largest value to 1.

    Args:
        points: means over the hundredths of three cycles from a zero crossing on, the first half cycle positive,
            shape (100,).

    Returns:
        The shape; its scale is 0 or less where the first half cycle does not rise above the mean.
    """
    centred = points - points.mean()
    place = int(np.argmax(_FINE @ centred[:_FIRST_HALF]))
    weights = np.zeros(POINTS)
    weights[:_FIRST_HALF] = _FINE[place]
    scale = float(weights @ centred)
    return Shape(centred / scale if scale > 0.0 else centred, scale, weights)


def response_points(zeta: Array) -> Array:
    """The 100 points of impulse responses in closed form.

    Args:
        zeta: damping ratios, below 1, shape (n,).

    Returns:
        Points before normalisation, shape (n, 100).
    """
    ratio = np.asarray(zeta, dtype=np.float64)[:, None]
    pole = 2.0 * np.pi * CYCLES * (1j - ratio / np.sqrt(1.0 - ratio**2))
    integral = (np.exp(pole * np.linspace(0.0, 1.0, POINTS + 1)) / pole).imag
    return np.asarray(np.diff(integral, axis=1) * POINTS)


def network_inputs(zeta: Array) -> Array:
    """The first network's inputs for impulse responses.

    Args:
        zeta: damping ratios, below 1, shape (n,).

    Returns:
        Shape (n, 100).
    """
    return np.array([normalise(points).inputs for points in response_points(zeta)])


def cycles_time(zeta: Array, omega_n: Array) -> Array:
    """t3, the time of three damped cycles.

    Args:
        zeta: damping ratios, below 1, shape (n,).
        omega_n: natural frequencies, rad/s, shape (n,).

    Returns:
        Shape (n,), s.
    """
    return np.asarray(2.0 * np.pi * CYCLES / (omega_n * np.sqrt(1.0 - zeta**2)))
