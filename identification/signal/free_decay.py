"""The free decay β̈ + 2aβ̇ + kβ = 0 and its sensitivities, in closed form for any damping; rad and s.

With a = C/(2 Izz) [1/s], k = K/Izz [1/s²] and Δ = k − a²: β(t) = β₀ u(t) + r₀ s(t), s = e^{−at} S(t), u = e^{−at}
C(t) + a s, where C = cos(√Δ t) and S = sin(√Δ t)/√Δ are entire functions of Δ. All derivatives with respect to a
and k combine only two more functions, w = e^{−at} ∂S/∂Δ and t s(t):

    ∂u/∂a = −2k w,   ∂u/∂k = a w − t s/2,   ∂s/∂a = −t s − 2a w,   ∂s/∂k = w.

Source: the characteristic equation (6) of the paper; the derivatives were derived for this project.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial, sqrt

import numpy as np

from tunnel_sim.vocabulary.record import Array

# |Δt²| below which the series is used: at 0.25 eight terms are accurate to 1e-19; above it the quotients lose
# at most one digit.
_SERIES_LIMIT = 0.25
_SERIES_TERMS = 8
_SERIES = np.array(
    [
        [(-1.0) ** n / factorial(2 * n + 1), -((-1.0) ** n) * (n + 1) / factorial(2 * n + 3)]
        for n in range(_SERIES_TERMS)
    ]
)  # of S/t and of (∂S/∂Δ)/t³ in Δt²


@dataclass(frozen=True)
class Decay:
    """The two parameters of a free decay.

    Args:
        rate: a = ζωn, 1/s; negative where the oscillation grows.
        stiffness: k = ωn², 1/s².
    """

    rate: float
    stiffness: float

    @property
    def omega_n(self) -> float:
        """Natural angular frequency ωn, rad/s; 0 where the stiffness is not positive."""
        return sqrt(max(self.stiffness, 0.0))

    @property
    def zeta(self) -> float:
        """Damping ratio ζ = a/ωn; needs a positive stiffness."""
        return self.rate / sqrt(self.stiffness)

    @property
    def omega_d(self) -> float:
        """Damped angular frequency, rad/s; 0 where the motion does not oscillate."""
        return sqrt(max(self.stiffness - self.rate**2, 0.0))

    @classmethod
    def from_modal(cls, omega_n: float, zeta: float) -> Decay:
        """From natural frequency ωn [rad/s] and damping ratio ζ."""
        return cls(zeta * omega_n, omega_n**2)


def response_rows(time: Array, decay: Decay, *, constant: bool = False) -> Array:
    """Unit-angle and unit-rate response of a decay, and the two functions of its sensitivities.

    Args:
        time: times since the initial state, shape (n,), s.
        constant: whether to append a row of ones, the sensor's zero.

    Returns:
        Rows u [-], s [s], w [s³], t·s [s²], shape (4, n) or (5, n).
    """
    delta = decay.stiffness - decay.rate**2
    rows = np.empty((5 if constant else 4, time.size))
    rows[4:] = 1.0
    unit, sine, slope, ramp = rows[:4]
    if delta >= 0.0:
        omega = sqrt(delta)
        decaying, phase = np.exp(-decay.rate * time), omega * time
        cosine = decaying * np.cos(phase)
        sine[:] = decaying * np.sin(phase) / omega if omega > 0.0 else 0.0
    else:  # two real exponents; the root nearer to zero is k over the other one, to keep its digits
        mu = sqrt(-delta)
        far = decay.rate + (mu if decay.rate >= 0.0 else -mu)
        near = decay.stiffness / far
        fast, slow = np.exp(-far * time), np.exp(-near * time)
        cosine = 0.5 * (slow + fast)
        sine[:] = (slow - fast) / (far - near)
    if delta != 0.0:
        np.multiply(time, cosine, out=slope)
        slope -= sine
        slope *= 0.5 / delta
    small = np.flatnonzero(np.abs(time) < sqrt(_SERIES_LIMIT / abs(delta))) if delta != 0.0 else slice(None)
    early = time[small]
    if early.size:  # near Δt² = 0 a power series replaces the quotients, so nothing is singular
        decaying = np.exp(-decay.rate * early)
        x = delta * early**2
        series = np.empty((2, x.size))
        series[:] = _SERIES[-1, :, None]
        for coefficient in _SERIES[-2::-1, :, None]:  # Horner's rule
            series *= x
            series += coefficient
        sine[small] = decaying * early * series[0]
        slope[small] = decaying * early**3 * series[1]
    np.multiply(sine, decay.rate, out=unit)
    unit += cosine
    np.multiply(time, sine, out=ramp)
    return rows


def free_decay(time: Array, decay: Decay, angle: float, rate: float) -> Array:
    """Yaw angle of the free decay, shape (n,), rad.

    Args:
        time: times since the initial state, shape (n,), s.
        angle: initial angle β₀, rad.
        rate: initial rate r₀, rad/s.
    """
    rows = response_rows(time, decay)
    return np.asarray(angle * rows[0] + rate * rows[1])


def sensitivity_weights(decay: Decay, angle: float, rate: float) -> Array:
    """Weights of the rows of `response_rows` in ∂β/∂a [rad s] and ∂β/∂k [rad s²], shape (2, 4).

    Arguments as in `free_decay`.
    """
    a, k = decay.rate, decay.stiffness
    return np.array(
        [
            [0.0, 0.0, -2.0 * (k * angle + a * rate), -rate],
            [0.0, 0.0, a * angle + rate, -0.5 * angle],
        ]
    )


def envelope_amplitude(decay: Decay, angle: float, rate: float) -> float:
    """√(β₀² + ((r₀ + aβ₀)/ωd)²), the envelope at the time of the initial state; |β₀| without an oscillation.

    In rad, with arguments as in `free_decay`.
    """
    if decay.omega_d == 0.0:
        return abs(angle)
    return float(np.hypot(angle, (rate + decay.rate * angle) / decay.omega_d))
