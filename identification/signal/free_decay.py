"""The free decay β̈ + 2aβ̇ + kβ = 0 and its sensitivities, in closed form for any damping.

With decay rate a = C/(2 Izz) [1/s], normalised stiffness k = K/Izz [1/s²] and Δ = k − a², the response is

    β(t) = β₀ u(t) + r₀ s(t),   s = e^{−at} S(t),   u = e^{−at} C(t) + a s,

where C = cos(√Δ t) and S = sin(√Δ t)/√Δ are entire functions of Δ: one formula covers under-, over- and
critical damping. All derivatives with respect to a and k are combinations of only two more functions,
w = e^{−at} ∂S/∂Δ and t s(t):

    ∂u/∂a = −2k w,   ∂u/∂k = a w − t s/2,   ∂s/∂a = −t s − 2a w,   ∂s/∂k = w.

Angles in rad, times in s. Near Δt² = 0 a power series replaces the quotients, so nothing is singular.
Source: the characteristic equation (6) of the paper; the derivatives were derived for this project.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial, sqrt

import numpy as np

from tunnel_sim.vocabulary.record import Array

# |Δt²| below which the series is used: eight terms leave 1e-19 at a quarter; the quotients lose one digit at most
# above it.
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
    """The four functions of time that make up a decay and its sensitivities.

    Args:
        time: times since the initial state, shape (n,), s.
        constant: whether a row of ones, the sensor's zero, comes last.

    Returns:
        Rows u [-], s [s], w [s³], t·s [s²], shape (4, n) or (5, n): unit-angle response, unit-rate response, and
        the two functions of the derivatives.
    """
    delta = decay.stiffness - decay.rate**2
    rows = np.empty((5 if constant else 4, time.size))
    rows[4:] = 1.0
    unit, sine, slope, ramp = rows[:4]
    cosine, sine[:] = _oscillating(time, decay.rate, delta) if delta >= 0.0 else _creeping(time, decay, delta)
    if delta != 0.0:
        np.multiply(time, cosine, out=slope)
        slope -= sine
        slope *= 0.5 / delta
    small = np.flatnonzero(np.abs(time) < sqrt(_SERIES_LIMIT / abs(delta))) if delta != 0.0 else slice(None)
    near = time[small]
    if near.size:
        decaying = np.exp(-decay.rate * near)
        x = delta * near**2
        series = _polynomials(x, _SERIES)
        sine[small] = decaying * near * series[0]
        slope[small] = decaying * near**3 * series[1]
    np.multiply(sine, decay.rate, out=unit)
    unit += cosine
    np.multiply(time, sine, out=ramp)
    return rows


def free_decay(time: Array, decay: Decay, angle: float, rate: float) -> Array:
    """Yaw angle of the free decay.

    Args:
        time: times since the initial state, shape (n,), s.
        angle: initial angle β₀, rad.
        rate: initial rate r₀, rad/s.

    Returns:
        β(t), shape (n,), rad.
    """
    rows = response_rows(time, decay)
    return np.asarray(angle * rows[0] + rate * rows[1])


def sensitivity_weights(decay: Decay, angle: float, rate: float) -> Array:
    """Weights of the rows of `response_rows` in ∂β/∂a and ∂β/∂k.

    Args:
        angle: initial angle β₀, rad.
        rate: initial rate r₀, rad/s.

    Returns:
        Shape (2, 4): ``sensitivity_weights(...) @ response_rows(...)`` is (∂β/∂a, ∂β/∂k),
        in rad s and rad s².
    """
    a, k = decay.rate, decay.stiffness
    return np.array(
        [
            [0.0, 0.0, -2.0 * (k * angle + a * rate), -rate],
            [0.0, 0.0, a * angle + rate, -0.5 * angle],
        ]
    )


def envelope_amplitude(decay: Decay, angle: float, rate: float) -> float:
    """Amplitude of the decaying oscillation at the time of its initial state.

    Args:
        angle: initial angle β₀, rad.
        rate: initial rate r₀, rad/s.

    Returns:
        √(β₀² + ((r₀ + aβ₀)/ωd)²), rad; |β₀| where the motion does not oscillate.
    """
    if decay.omega_d == 0.0:
        return abs(angle)
    return float(np.hypot(angle, (rate + decay.rate * angle) / decay.omega_d))


def _oscillating(time: Array, rate: float, delta: float) -> tuple[Array, Array]:
    omega = sqrt(delta)
    decaying = np.exp(-rate * time)
    phase = omega * time
    sine = decaying * np.sin(phase) / omega if omega > 0.0 else np.zeros_like(time)
    return decaying * np.cos(phase), sine


def _creeping(time: Array, decay: Decay, delta: float) -> tuple[Array, Array]:
    # Two real exponents. The root nearer to zero comes from the product of both, k, to keep its digits.
    mu = sqrt(-delta)
    far = decay.rate + (mu if decay.rate >= 0.0 else -mu)
    near = decay.stiffness / far
    fast, slow = np.exp(-far * time), np.exp(-near * time)
    return 0.5 * (slow + fast), (slow - fast) / (far - near)


def _polynomials(x: Array, coefficients: Array) -> Array:
    # Horner's rule for several at once; the coefficients start at the constant, shape (terms, polynomials).
    total = np.empty((coefficients.shape[1], x.size))
    total[:] = coefficients[-1, :, None]
    for coefficient in coefficients[-2::-1, :, None]:
        total *= x
        total += coefficient
    return total
