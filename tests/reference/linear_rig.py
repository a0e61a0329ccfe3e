"""The linear rig under a sampled moment: its complex mode from sample to sample, exactly as SciPy's lsim."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter


def response(
    moment: np.ndarray,
    interval: float,
    inertia: float,
    damping: float,
    stiffness: float,
    release: float = 0.0,
) -> np.ndarray:
    """The angle of an oscillating rig that is released at rest, shape (n,), rad.

    Args:
        moment: linear between its samples, shape (n,), N m.
        interval: between samples, s.
        inertia: kg m².
        damping: N m s/rad.
        stiffness: N m/rad.
        release: the first angle, rad.
    """
    rate = 0.5 * damping / inertia  # of the decay, 1/s
    omega = np.sqrt(stiffness / inertia - rate**2)
    first = complex(rate, omega) * release
    return np.asarray(_mode(moment / inertia, interval, complex(-rate, omega), first).imag / omega)


def response_of_a_loose_body(
    moment: np.ndarray, interval: float, inertia: float, damping: float
) -> np.ndarray:
    """The angle of a body that nothing holds, from rest at zero, shape (n,), rad; arguments as in `response`."""
    rate = _mode(moment / inertia, interval, -damping / inertia, 0.0)
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * interval * (moment[:-1] + moment[1:]))])
    return np.asarray((impulse - inertia * rate) / damping)


def _mode(given: np.ndarray, interval: float, pole: complex, first: complex) -> np.ndarray:
    """The solution of x' = pole x + given, linear between its samples."""
    step = np.exp(pole * interval)
    mean = (step - 1.0) / (pole * interval)
    pushed = ((step - mean) * given[:-1] + (mean - 1.0) * given[1:]) / pole
    return np.asarray(lfilter([1.0], [1.0, -step], np.concatenate([[first], pushed])))
