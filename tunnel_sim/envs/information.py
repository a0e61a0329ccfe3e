"""The information of a run on Cnβ and Cnr, sample by sample, from the sensitivities along its motion.

docs/reference/envs/free-decay.md has the equations. In each sample interval the homogeneous part of a
sensitivity is propagated exactly; its drive is integrated by Simpson's rule, with the middle value from the
cubic through both ends. Source: S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory
(1993), ch. 3.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.arguments import EnvError, Number, checked_names
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Body

DYNAMIC = 6  # Izz, Cr, angle, rate, Cnβ, Cnr; the zero's sensitivity is one


def propagator(a: Array, k: Array, duration: float | Array) -> tuple[Array, Array, Array, Array]:
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
"""The reward is the information about these; it would be infinite from the start if they were known exactly."""
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
        yaw_inertia, mechanical_damping: shares of Izz and Cr; known from wind-off runs with the spring.
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


@dataclass(frozen=True, eq=False)
class _Step:
    """The linear maps of one step, at one wind speed for each run.

    In each sample interval a sensitivity gets a kick to its value and a kick to its rate.

    Args:
        sums: map from angles and rates at both ends of an interval to the kicks per unit by the angle and by
            its rate, shape (runs, 4, 4).
        push: kicks by a unit moment, shape (runs, 2 samples).
        shares: shares of the sensitivities in the three kinds of kicks, shape (runs, 3, DYNAMIC).
        response: map from the sensitivities at the start, their rates, and the kicks to the sensitivities at
            the samples and the end, and their rate at the end, shape (runs, samples + 2, 2 samples + 2).
    """

    sums: Array
    push: Array
    shares: Array
    response: Array

    @classmethod
    def of(cls, runs: Array, wind_speed: Array, samples: int, interval: float) -> _Step:
        """The maps; ``runs`` as in `Information.start`, ``wind_speed`` in m/s, shape (runs,)."""
        stiffness, damping, by_angle, by_rate, air_stiffness, air_damping, inverse = runs
        a = 0.5 * (damping - air_damping * wind_speed)
        k = stiffness - air_stiffness * wind_speed**2
        count = len(wind_speed)
        at = np.concatenate(([0.5 * interval], interval * np.arange(samples + 1)))
        # the last entry of every run is the zero for responses to later kicks
        solution = np.zeros((count, 4 * len(at) + 1))
        parts = solution[:, :-1].reshape(count, 4, len(at))
        parts[:, 0], parts[:, 1], parts[:, 2], parts[:, 3] = propagator(a[:, None], k[:, None], at)
        kicks = np.ones((count, 1, 5))
        kicks[:, 0, :4] = solution[:, [2 + len(at), len(at), 2 + 3 * len(at), 3 * len(at)]]
        made = np.matmul(kicks, _weights(interval))[:, 0]
        push = np.repeat(made[:, 16:], samples, axis=1)
        shares = np.zeros((count, 3, DYNAMIC))
        shares[:, 0, 0], shares[:, 1, 0], shares[:, 2, 0] = (
            inverse * k,
            2.0 * inverse * a,
            -(inverse**2),
        )  # −β̈/Izz
        shares[:, 1, 1] = -inverse
        shares[:, 0, 4], shares[:, 1, 5] = by_angle * wind_speed**2, by_rate * wind_speed
        return cls(made[:, :16].reshape(count, 4, 4), push, shares, solution[:, _places(samples)])


@functools.cache
def _weights(interval: float) -> Array:
    """`_Step.sums`, row by row, and `_Step.push` of value and rate, by the sine and its rate in an interval.

    Rows: the sine after a whole and a half interval, its rate after them, and 1. Columns of ``sums``: the angle at
    both ends, and its rate. Shape (5, 18).
    """
    h, found = interval, np.zeros((5, 18))
    w = h / 6.0
    for row, (first, middle) in enumerate(((0, 1), (2, 3))):
        by_angle, by_rate = found[:, 4 * row : 4 * row + 4], found[:, 8 + 4 * row : 12 + 4 * row]
        by_angle[first, 0] = by_rate[first, 2] = found[first, 16 + row] = w
        by_angle[middle] = 4.0 * w * np.array([0.5, 0.5, 0.125 * h, -0.125 * h])
        by_rate[middle] = 4.0 * w * np.array([-1.5 / h, 1.5 / h, -0.25, -0.25])
        found[middle, 16 + row] = 4.0 * w
        if row:
            by_angle[4, 1] = by_rate[4, 3] = found[4, 17] = w
    return found


@functools.cache
def _places(samples: int) -> NDArray[np.intp]:
    """Places of the entries of `_Step.response` among the solutions of `_Step.of`."""
    width = samples + 2
    row = np.append(np.arange(samples + 1), samples)[:, None]  # intervals from the start
    of_rate = np.append(np.zeros(samples + 1, dtype=np.intp), 1)[:, None]
    lag = row - 1 - np.arange(samples)  # intervals from the kick
    places = [(2 * of_rate + part) * width + 1 + row for part in (0, 1)]
    places += [np.where(lag >= 0, (2 * of_rate + part) * width + 1 + lag, 4 * width) for part in (0, 1)]
    return np.concatenate(places, axis=1)


class Information:
    """The Fisher information of many runs in progress, and the sensitivities behind it; ``row`` is a run's index.

    Args:
        samples: number of samples in one step.
        interval: interval between samples, s.
        variance: variance of a reading, rad².
    """

    def __init__(self, count: int, samples: int, interval: float, variance: float, prior: Prior) -> None:
        self._samples, self._interval, self._variance, self._prior = samples, interval, variance, prior
        self._runs = np.ones((7, count))
        self._x = np.zeros((2, count, DYNAMIC))  # sensitivity of the angle, and its rate
        self._speed = np.full(count, np.nan)  # wind speeds for which the matrices of `_Step` are valid
        self._step = _Step.of(np.zeros((7, count)), np.zeros(count), samples, interval)
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
            self._speed = wind_speed.copy()
            self._step = _Step.of(self._runs, wind_speed, self._samples, self._interval)
        step, count, samples = self._step, len(wind_speed), self._samples
        drive = np.empty((count, 4, samples))
        drive[:, 0], drive[:, 1], drive[:, 2], drive[:, 3] = (
            angle[:, :-1],
            angle[:, 1:],
            rate[:, :-1],
            rate[:, 1:],
        )
        sums = np.matmul(step.sums, drive)  # kicks to value and rate by the angle, then by its rate
        kicks = np.empty((count, 2 * samples, 3))
        kicks[:, :, :2] = sums.reshape(count, 2, 2 * samples).transpose(0, 2, 1)
        kicks[:, :, 2] = step.push * moment[:, None]
        given = np.zeros((count, 2 * samples + 2, DYNAMIC))
        given[:, 0], given[:, 1] = self._x
        given[:, 2:] = np.matmul(kicks, step.shares)
        found = np.matmul(step.response, given)
        self._x = np.stack((found[:, samples], found[:, samples + 1]))
        of_reading = np.ones((count, samples, DYNAMIC + 1))  # the sensitivity to the zero remains 1
        of_reading[:, :, :4], of_reading[:, :, 5:] = found[:, :samples, :4], found[:, :samples, 4:]
        of_reading *= self._scale[:, None]
        self.scaled += np.matmul(of_reading.transpose(0, 2, 1), of_reading) / self._variance
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
    """½ log det of information, shape (n, m, m), about the last two unknowns: shape (n,), nats; else NaN."""
    try:
        root = np.linalg.cholesky(information)
    except np.linalg.LinAlgError:
        if len(information) == 1:
            return np.full(1, np.nan)
        return np.concatenate([half_log_det(one[None]) for one in information])
    return np.asarray(np.log(root[:, -2, -2] * root[:, -1, -1]))
