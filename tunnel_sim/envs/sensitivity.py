"""Sensitivities of the nominal model along the motion of many runs.

In the nominal model Izz β̈ + (Cr − Ca) β̇ + (Kr − Ka) β = M(t) the sensitivity x = ∂β/∂p to an unknown p obeys

    ẍ + 2a ẋ + k x = u(t),   2a = (Cr − Ca)/Izz,   k = (Kr − Ka)/Izz.

The motion itself drives it: u = ½ρV²Al β/Izz for Cnβ, ½ρVAl² β̇/Izz for Cnr, −β̇/Izz for Cr and −β̈/Izz for Izz.
For angle and rate at the release u = 0, and the initial values are (1, 0) and (0, 1). In each sample interval the
homogeneous part is propagated exactly; u is integrated by Simpson's rule, with its middle value from the cubic
through both ends. The wind speed is replaced by its mean over a control period. Where effects act that the nominal
model does not include, the motion is the real one, and the sensitivities are those of the nominal model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tunnel_sim.vocabulary.record import Array

DYNAMIC = 6  # Izz, Cr, angle, rate, Cnβ, Cnr; the zero's sensitivity is one


@dataclass(frozen=True)
class NominalRun:
    """The nominal model of one run.

    Args:
        spring_stiffness: Kr as stated, N m/rad.
        yaw_inertia: Izz, kg m².
        mechanical_damping: Cr, N m s/rad.
        cn_beta: Cnβ, 1/rad.
        cn_r: Cnr, 1/rad.
        air_density: ρ, kg/m³.
        frontal_area: A, m².
        reference_length: l, m.
    """

    spring_stiffness: float
    yaw_inertia: float
    mechanical_damping: float
    cn_beta: float
    cn_r: float
    air_density: float
    frontal_area: float
    reference_length: float

    def coefficients(self) -> tuple[float, ...]:
        """Kr/Izz, Cr/Izz, then ½ρAl/Izz and ½ρAl²/Izz without and with their coefficients, and 1/Izz."""
        inertia = self.yaw_inertia
        stiffness = 0.5 * self.air_density * self.frontal_area * self.reference_length / inertia
        damping = stiffness * self.reference_length
        return (
            self.spring_stiffness / inertia,
            self.mechanical_damping / inertia,
            stiffness,
            damping,
            stiffness * self.cn_beta,
            damping * self.cn_r,
            1.0 / inertia,
        )


class Sensitivities:
    """Sensitivities of many runs in progress.

    Args:
        samples: number of samples in one step.
        interval: between samples, s.
    """

    def __init__(self, count: int, samples: int, interval: float) -> None:
        self._samples = samples
        self._interval = interval
        self._runs = np.ones((7, count))
        self._x = np.zeros((2, count, DYNAMIC))  # value and rate
        self._speed = np.full(count, np.nan)  # for which the propagators hold
        self._propagator = np.zeros((6, count))
        self._decay = np.zeros((2, count))

    def start(self, row: int, run: NominalRun) -> None:
        """Start a run."""
        self._runs[:, row] = run.coefficients()
        self._x[:, row] = 0.0
        self._x[0, row, 2] = self._x[1, row, 3] = 1.0
        self._speed[row] = np.nan

    def snapshot(self, row: int) -> dict[str, Array]:
        """Copies of the state of a run; result and arguments as in `Information.snapshot`."""
        return {"sensitivities": self._x[:, row].copy()}

    def restore(self, row: int, run: NominalRun, state: Mapping[str, Array]) -> None:
        """Restore a run from a snapshot; arguments as in `Information.restore`."""
        self.start(row, run)
        self._x[:, row] = state["sensitivities"]

    def advance(self, angle: Array, rate: Array, wind_speed: Array, moment: Array) -> Array:
        """Propagate the sensitivities through one step; arguments as in `Information.advance`.

        Returns:
            Sensitivities of the readings at the samples, shape (runs, 7, samples), in the order of `UNKNOWNS`.
        """
        if not np.array_equal(wind_speed, self._speed):
            self._set_speed(wind_speed)
        kicks = self._kicks(angle, rate, wind_speed, moment)
        f00, f01, f10, f11 = (row[:, None] for row in self._propagator[:4])
        x, v = self._x
        out = np.ones((self._samples, len(self._speed), DYNAMIC + 1))  # the sensitivity to the zero remains 1
        for j in range(self._samples):
            out[j, :, :4], out[j, :, 5:] = x[:, :4], x[:, 4:]
            x, v = f00 * x + f01 * v + kicks[0, j], f10 * x + f11 * v + kicks[1, j]
        self._x = np.stack((x, v))
        return out.transpose(1, 2, 0)

    def _set_speed(self, speed: Array) -> None:
        stiffness, damping, _, _, air_stiffness, air_damping, _ = self._runs
        a = 0.5 * (damping - air_damping * speed)
        k = stiffness - air_stiffness * speed**2
        self._speed, self._decay = speed.copy(), np.stack((a, k))
        whole = propagator(a, k, self._interval)
        half = propagator(a, k, 0.5 * self._interval)
        self._propagator = np.stack((*whole, half[1], half[3]))

    def _kicks(self, angle: Array, rate: Array, speed: Array, moment: Array) -> Array:
        """What u adds to value and rate in each interval, shape (2, samples, runs, DYNAMIC)."""
        h = self._interval
        a, k = self._decay
        _, f01, _, f11, m01, m11 = self._propagator
        _, _, stiffness, damping, _, _, inverse = self._runs
        begin, end = angle[:, :-1], angle[:, 1:]
        rate0, rate1 = rate[:, :-1], rate[:, 1:]
        sums = np.empty((2, 2, self._samples, len(speed)))  # of value, rate; driven by the angle, its rate
        for drive, (u0, middle, u1) in enumerate(
            (
                (begin.T, (0.5 * (begin + end) + 0.125 * h * (rate0 - rate1)).T, end.T),
                (rate0.T, (1.5 * (end - begin) / h - 0.25 * (rate0 + rate1)).T, rate1.T),
            )
        ):
            sums[0, drive] = (h / 6.0) * (f01 * u0 + 4.0 * m01 * middle)
            sums[1, drive] = (h / 6.0) * (f11 * u0 + 4.0 * m11 * middle + u1)
        push = (h / 6.0) * np.stack((f01 + 4.0 * m01, f11 + 4.0 * m11 + 1.0)) * (moment * inverse)
        kicks = np.zeros((2, self._samples, len(speed), DYNAMIC))
        by_angle, by_rate = sums[:, 0], sums[:, 1]
        kicks[..., 0] = inverse * (k * by_angle + 2.0 * a * by_rate - push[:, None])  # −β̈/Izz
        kicks[..., 1] = -inverse * by_rate
        kicks[..., 4] = stiffness * speed**2 * by_angle
        kicks[..., 5] = damping * speed * by_rate
        return kicks


def propagator(a: Array, k: Array, duration: float) -> tuple[Array, Array, Array, Array]:
    """Exact solution of ẍ + 2a ẋ + k x = 0 after a time, from (x, ẋ) = (1, 0) and (0, 1).

    Args:
        a: shape (n,), 1/s.
        k: shape (n,), 1/s²; may be below a², or negative.
        duration: s.

    Returns:
        x from (1, 0), x from (0, 1), ẋ from (1, 0), ẋ from (0, 1), each of shape (n,).
    """
    omega = np.sqrt((k - a**2).astype(np.complex128))
    decay = np.exp(-a * duration)
    cosine = decay * np.cos(omega * duration).real
    sine = decay * duration * np.sinc(omega * duration / np.pi).real
    return cosine + a * sine, sine, -k * sine, cosine - a * sine
