"""The information of a run on Cnβ and Cnr, sample by sample, from the sensitivities along its motion.

docs/reference/envs/free-decay.md has the equations. In each sample interval the homogeneous part of a
sensitivity is propagated exactly; its drive is integrated by Simpson's rule, with the middle value from the
cubic through both ends. Source: S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory
(1993), ch. 3.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.arguments import EnvError, Number, checked_names
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Body

DYNAMIC = 6  # Izz, Cr, angle, rate, Cnβ, Cnr; the zero's sensitivity is one


def propagator(a: Array, k: Array, duration: float) -> tuple[Array, Array, Array, Array]:
    """Exact solution of ẍ + 2a ẋ + k x = 0 after a time: x from (1, 0) and (0, 1), then ẋ; each of shape (n,).

    Args:
        a: shape (n,), 1/s.
        k: shape (n,), 1/s²; may be below a², or negative.
        duration: s.
    """
    omega = np.sqrt((k - a**2).astype(np.complex128))
    decay = np.exp(-a * duration)
    cosine = decay * np.cos(omega * duration).real
    sine = decay * duration * np.sinc(omega * duration / np.pi).real
    return cosine + a * sine, sine, -k * sine, cosine - a * sine


UNKNOWNS = (
    "yaw_inertia", "mechanical_damping", "release_angle", "release_rate", "sensor_zero", "cn_beta", "cn_r",
)  # fmt: skip
"""The order of rows and columns of the information matrix; the first five are eliminated."""

REWARDED = UNKNOWNS[5:]
"""The reward is the information about these, which is infinite from the start where they are known exactly."""
_PRIOR_UNITS = {
    "yaw_inertia": "shares of Izz",
    "mechanical_damping": "shares of Cr",
    "release_angle": "rad",
    "release_rate": "rad/s",
    "sensor_zero": "rad",
    "cn_beta": "1/rad",
    "cn_r": "1/rad",
}


@dataclass(frozen=True)
class Prior:
    """Prior knowledge of a run, as standard deviations; 0: known exactly, except for `REWARDED`.

    Args:
        yaw_inertia, mechanical_damping: as a share of Izz and Cr; known from wind-off runs with the spring.
        release_angle, sensor_zero: rad.
        release_rate: rad/s.
        cn_beta, cn_r: 1/rad, above 0.
    """

    yaw_inertia: float = 1e-4
    mechanical_damping: float = 1e-3
    release_angle: float = 0.01
    release_rate: float = 0.02
    sensor_zero: float = 0.01
    cn_beta: float = 0.5
    cn_r: float = 0.5

    @staticmethod
    def changed(changes: Mapping[str, float], where: str = "prior") -> Prior:
        """The prior with some of its standard deviations changed; ``where`` is for errors."""
        known = [item.name for item in fields(Prior)]
        for name, value in checked_names(changes, known, "prior", where).items():
            if name in REWARDED and value == 0:
                what = (
                    f"prior of {name} = {value!r}: the value is known exactly, so there is nothing to learn"
                )
                raise EnvError(what, where=where, remedy="give a number above 0, in 1/rad")
            Number(above=name in REWARDED, unit=_PRIOR_UNITS[name]).checked(value, f"prior of {name}", where)
        return replace(Prior(), **changes)

    def scales(self, run: RunSettings) -> Array:
        """The standard deviations in the units of the unknowns, shape (7,), in the order of `UNKNOWNS`."""
        own = {"yaw_inertia": run.yaw_inertia, "mechanical_damping": abs(run.mechanical_damping)}
        return np.array([getattr(self, name) * own.get(name, 1.0) for name in UNKNOWNS])


class Information:
    """The Fisher information of many runs in progress, and the sensitivities behind it; ``row`` is a run's index.

    Args:
        samples: number of samples in one step.
        interval: between samples, s.
        variance: of a reading, rad².
    """

    def __init__(self, count: int, samples: int, interval: float, variance: float, prior: Prior) -> None:
        self._samples, self._interval, self._variance, self._prior = samples, interval, variance, prior
        self._runs = np.ones((7, count))
        self._x = np.zeros((2, count, DYNAMIC))  # sensitivity of the angle, and its rate
        self._speed = np.full(count, np.nan)  # for which the propagators are valid
        self._propagator = np.zeros((6, count))
        self._decay = np.zeros((2, count))
        size = len(UNKNOWNS)
        self._scale = np.ones((count, size))  # the prior standard deviations are the units of the matrices
        self.scaled = np.tile(np.eye(size), (count, 1, 1))
        self.known = np.zeros(count)

    def start(self, row: int, run: RunSettings, body: Body) -> None:
        """Start a run with its physics without effects, and a body."""
        inertia = run.yaw_inertia
        stiffness = 0.5 * run.air_density * body.frontal_area * body.length / inertia
        damping = stiffness * body.length
        # Kr/Izz, Cr/Izz, then ½ρAl/Izz and ½ρAl²/Izz without and with their coefficients, and 1/Izz
        self._runs[:, row] = (
            run.spring_stiffness / inertia,
            run.mechanical_damping / inertia,
            stiffness,
            damping,
            stiffness * run.derivatives.cn_beta,
            damping * run.derivatives.cn_r,
            1.0 / inertia,
        )
        self._x[:, row] = 0.0
        self._x[0, row, 2] = self._x[1, row, 3] = 1.0
        self._speed[row] = np.nan
        self._scale[row] = self._prior.scales(run)
        self.scaled[row] = np.eye(len(UNKNOWNS))
        self.known[row] = 0.0

    def advance(self, angle: Array, rate: Array, wind_speed: Array, moment: Array) -> Array:
        """Add the samples of one step; the information gained about (Cnβ, Cnr), shape (runs,), nats.

        Args:
            angle, rate: at the samples and at the end of the step, shape (runs, samples + 1), rad and rad/s.
            wind_speed: mean over the step, shape (runs,), m/s.
            moment: applied by the operator, shape (runs,), N m.
        """
        if not np.array_equal(wind_speed, self._speed):
            stiffness, damping, _, _, air_stiffness, air_damping, _ = self._runs
            a = 0.5 * (damping - air_damping * wind_speed)
            k = stiffness - air_stiffness * wind_speed**2
            self._speed, self._decay = wind_speed.copy(), np.stack((a, k))
            whole = propagator(a, k, self._interval)
            half = propagator(a, k, 0.5 * self._interval)
            self._propagator = np.stack((*whole, half[1], half[3]))
        # Contribution of u to value and rate in each interval: kicks, shape (2, samples, runs, DYNAMIC).
        h = self._interval
        a, k = self._decay
        _, f01, _, f11, m01, m11 = self._propagator
        _, _, stiffness, damping, _, _, inverse = self._runs
        begin, end = angle[:, :-1], angle[:, 1:]
        rate0, rate1 = rate[:, :-1], rate[:, 1:]
        sums = np.empty(
            (2, 2, self._samples, len(wind_speed))
        )  # of value, rate; driven by the angle, its rate
        for drive, (u0, middle, u1) in enumerate(
            (
                (begin.T, (0.5 * (begin + end) + 0.125 * h * (rate0 - rate1)).T, end.T),
                (rate0.T, (1.5 * (end - begin) / h - 0.25 * (rate0 + rate1)).T, rate1.T),
            )
        ):
            sums[0, drive] = (h / 6.0) * (f01 * u0 + 4.0 * m01 * middle)
            sums[1, drive] = (h / 6.0) * (f11 * u0 + 4.0 * m11 * middle + u1)
        push = (h / 6.0) * np.stack((f01 + 4.0 * m01, f11 + 4.0 * m11 + 1.0)) * (moment * inverse)
        kicks = np.zeros((2, self._samples, len(wind_speed), DYNAMIC))
        by_angle, by_rate = sums[:, 0], sums[:, 1]
        kicks[..., 0] = inverse * (k * by_angle + 2.0 * a * by_rate - push[:, None])  # −β̈/Izz
        kicks[..., 1] = -inverse * by_rate
        kicks[..., 4] = stiffness * wind_speed**2 * by_angle
        kicks[..., 5] = damping * wind_speed * by_rate
        f00, f01, f10, f11 = (row[:, None] for row in self._propagator[:4])
        x, v = self._x
        out = np.ones((self._samples, len(self._speed), DYNAMIC + 1))  # the sensitivity to the zero remains 1
        for j in range(self._samples):
            out[j, :, :4], out[j, :, 5:] = x[:, :4], x[:, 4:]
            x, v = f00 * x + f01 * v + kicks[0, j], f10 * x + f11 * v + kicks[1, j]
        self._x = np.stack((x, v))
        of_reading = out.transpose(1, 2, 0)  # (runs, 7, samples)
        of_reading *= self._scale[:, :, None]
        self.scaled += np.matmul(of_reading, of_reading.transpose(0, 2, 1)) / self._variance
        before, self.known = self.known, half_log_det(self.scaled)
        return np.maximum(self.known - before, 0.0)

    def matrix(self, row: int) -> Array:
        """The Fisher information of one run, shape (7, 7), as `UNKNOWNS`; infinite where the prior is exact."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.scaled[row] / np.outer(self._scale[row], self._scale[row]))

    def snapshot(self, row: int) -> dict[str, Array]:
        """Copies of the state of a run in progress."""
        own = {"scale": self._scale[row], "scaled": self.scaled[row], "known": self.known[row]}
        own["sensitivities"] = self._x[:, row]
        return {name: np.array(value) for name, value in own.items()}

    def restore(self, row: int, run: RunSettings, body: Body, state: Mapping[str, Array]) -> None:
        """Restore a run from a snapshot."""
        self.start(row, run, body)
        self._x[:, row] = state["sensitivities"]
        self._scale[row], self.scaled[row] = state["scale"], state["scaled"]
        self.known[row] = state["known"]


def half_log_det(information: Array) -> Array:
    """½ log det of information, shape (n, m, m), about the last two unknowns: shape (n,), nats."""
    rest = information
    for _ in range(information.shape[-1] - 2):
        column = rest[:, 1:, 0]
        rest = rest[:, 1:, 1:] - column[:, :, None] * (column / rest[:, 0, 0, None])[:, None, :]
    determinant = rest[:, 0, 0] * rest[:, 1, 1] - rest[:, 0, 1] * rest[:, 1, 0]
    return np.asarray(0.5 * np.log(determinant))
