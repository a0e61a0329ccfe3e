"""The measured path of every run, the response of the reading to a further moment along it, and bases of moments.

The nominal model is linear. However large the gap, a missing moment m therefore changes the reading by the
response of the linear rig to m(t), if m is evaluated along the true motion. The measured motion is close to it:
the fitted motion plus the smoothed residual.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import takewhile

import numpy as np
from scipy.interpolate import BSpline

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import linear_coefficients, resonance
from diagnosis.model.run_data import RunData
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.quantities import Angles, Rates, Times
from tunnel_sim.vocabulary.record import Array

_WINDOW, _NARROW = 0.4, 0.2  # share of a cycle; the first window passes the third harmonic at half height
_LARGE = 30.0  # noise variances of a block mean: larger residuals must not be smoothed away
_ROWS = 24  # rows per cycle to which white residuals are averaged: the motion has at most its third harmonic


@dataclass(frozen=True, eq=False)
class Path:
    """One run with its fit, in the form used by the laws; they explain the residuals of the fit."""

    fit: Fit
    index: int

    @property
    def run(self) -> RunData:
        """The run."""
        return self.fit.problem.data.runs[self.index]

    @cached_property
    def omega(self) -> float:
        """Angular frequency of its free motion, rad/s."""
        return 2.0 * np.pi * resonance(self.fit, self.index)

    @cached_property
    def time(self) -> Array:
        """Time since the start of the fitted part, s, shape (n,)."""
        return np.asarray((np.arange(self.run.reading.size) + 0.5) * self.run.interval)

    @cached_property
    def _fitted(self) -> tuple[Array, Array]:
        run, omega = self.run, self.omega
        fitted = run.reading - run.unscaled(self.fit.residuals[self.index]) - self.fit.zero(self.index)
        slope = np.gradient(fitted, run.interval)
        if not run.derivative:
            return fitted, slope
        # each derivative of an oscillation leads by a quarter cycle and is ω times as large
        angle, rate = ((-slope, fitted * omega**2), (-fitted, -slope))[run.derivative - 1]
        return angle / omega**2, rate / omega**2

    @property
    def fitted(self) -> Places:
        """The places of the fitted motion, free of errors of the reading.

        Along the measured path an error in proportion to the angle would equal the residual, whatever its
        cause: the release absorbs the rest.
        """
        angle, rate = self._fitted
        return Places(angle, rate, self.time, self.stiffness, self.speed)

    @cached_property
    def _motion(self) -> tuple[Array, Array]:
        run, omega = self.run, self.omega
        fitted, slope = self._fitted
        if run.derivative:
            return fitted, slope
        residual = run.unscaled(self.fit.residuals[self.index])
        large = float(np.mean(self.fit.residuals[self.index] ** 2)) > _LARGE
        width = 2 * round(np.pi * (_NARROW if large else _WINDOW) / (omega * run.interval)) + 1
        if width < 5 or width > residual.size // 4:
            return fitted, slope
        from scipy.signal import savgol_filter  # imported here because it is slow to load

        smooth = savgol_filter(residual, width, 3)
        smooth_slope = savgol_filter(residual, width, 3, deriv=1, delta=run.interval)
        return fitted + smooth, slope + smooth_slope

    @property
    def angle(self) -> Array:
        """Measured angle from the zero, smoothed, rad, shape (n,)."""
        return self._motion[0]

    @property
    def rate(self) -> Array:
        """Measured rate, smoothed, rad/s, shape (n,)."""
        return self._motion[1]

    @property
    def speed(self) -> float:
        """Wind speed, m/s."""
        return self.run.wind_speed

    @property
    def stiffness(self) -> float:
        """Stiffness of the spring, stated or fitted, N m/rad; without a spring, the rig's stiffness at rest."""
        return self._stated.spring_stiffness or float(linear_coefficients(self.fit, self.index)[2])

    @property
    def still_omega(self) -> float:
        """√(Kr/Izz), rad/s, as in the expressions of effects."""
        return float(np.sqrt(self.stiffness / self._stated.yaw_inertia))

    @cached_property
    def _stated(self) -> RunSettings:
        point = self.fit.point
        return self.fit.problem.stated(point.common, point.per_run[self.index], self.run)

    def _filter(self, interval: float) -> tuple[Array, Array]:
        """Numerator and denominator of the reading's response to a moment that is linear between samples."""
        from scipy.signal import cont2discrete  # imported here because it is slow to load

        numerator = np.array([1.0] + [0.0] * self.run.derivative)
        denominator = np.array(linear_coefficients(self.fit, self.index))
        found = cont2discrete((numerator, denominator), interval, "foh")
        return np.ravel(found[0]), found[1]

    def response(self, moment: Array) -> Array:
        """Response of the reading, from rest, to a moment, N m, shape (n, k), as `rows`."""
        from scipy.signal import lfilter  # imported here because it is slow to load

        run = self.run
        if run.plain:  # fewer values to filter
            rows = self.rows(moment) / run.noise.scale
            return np.asarray(lfilter(*self._filter(self.group * run.interval), rows, axis=0))
        return self.reading_rows(lfilter(*self._filter(run.interval), moment, axis=0))

    @cached_property
    def group(self) -> int:
        """Number of blocks averaged into a row."""
        return max(1, round(2.0 * np.pi / (self.omega * self.run.interval * _ROWS)))

    def reading_rows(self, reading: Array) -> Array:
        """A change of the reading, in its unit, shape (n, k), as `rows`."""
        return self.rows(self.run.scaled(reading))

    def rows(self, white: Array) -> Array:
        """White residuals, shape (n, k) or (n,), averaged in whole groups to rows of equal noise."""
        count = white.shape[0] // self.group
        grouped = white[: count * self.group].reshape(count, self.group, *white.shape[1:])
        return np.asarray(grouped.sum(axis=1) / np.sqrt(self.group))

    @cached_property
    def residual(self) -> Array:
        """The residual to be explained, shape (rows,)."""
        return self.rows(self.fit.residuals[self.index])

    @cached_property
    def release(self) -> Array:
        """Responses that the release and the run's own parameters absorb, orthonormal, shape (rows, own)."""
        inertia, damping, stiffness = linear_coefficients(self.fit, self.index)
        roots = np.roots([inertia, damping, stiffness]).astype(complex)
        waves = np.exp(np.outer(self.time - self.time[0], roots))
        free = np.column_stack([waves.sum(axis=1).real, (waves[:, 0] - waves[:, 1]).imag])
        if abs(roots[0].imag) < 1e-9:
            free = waves.real
        own = self.rows(self.fit.jacobian[self.index][1][:, 2:])
        return np.linalg.qr(np.column_stack([self.reading_rows(free), own]))[0]

    @cached_property
    def nominal(self) -> Array:
        """Responses to a step of the model's common parameters, shape (rows, common).

        The moments of inertia, damping and air come first. They are evaluated along the measured path, so they
        apply however far the parameters move.
        """
        data, run = self.fit.problem.data, self.run
        inertia, damping, stiffness = linear_coefficients(self.fit, self.index)
        pressure = data.air_moment(run)
        lag = data.air_damping(run)
        # the angular acceleration, with its sign reversed
        swing = (stiffness * self.angle + damping * self.rate) / inertia
        moments = {
            "yaw_inertia": swing,
            "stiffness": -self.angle,
            "added_stiffness": -self.angle,
            "mechanical_damping": -self.rate,
            "cn_beta": pressure * self.angle,
            "cn_r": lag * self.rate,
        }
        first = [moments[name] for name in takewhile(moments.__contains__, self.fit.problem.names)]
        others = self.rows(self.fit.jacobian[self.index][0][:, len(first) :])
        return np.column_stack([self.response(np.column_stack(first)), others])


def paths(fit: Fit) -> list[Path]:
    """The paths of all runs of the fit."""
    return [Path(fit, index) for index in range(len(fit.problem.data.runs))]


_FINE, _MEDIUM, _COARSE = 33, 15, 7  # number of splines over the range of the motion
_SLOW = 16  # number of splines over the time of a run
_PER_CYCLE = 6.0  # number of splines per cycle that follow a blow
_SETTLED = 0.02  # share of the greatest rate below which dry friction may be any moment


@dataclass(frozen=True, eq=False)
class Places:
    """Points for evaluating a basis, in place of a `Path`.

    Args:
        stiffness: of the spring, N m/rad.
        speed: of the wind, m/s.
    """

    angle: Angles
    rate: Rates
    time: Times
    stiffness: float
    speed: float


@dataclass(frozen=True)
class Ranges:
    """Ranges of the runs.

    Args:
        angle: greatest angle, rad.
        rate: greatest rate, rad/s.
        time: latest time, s.
        cycle: period of the motion, s.
        stiffness: median over the runs, N m/rad.
        speed: greatest wind speed, m/s; 1 where there is no wind.
    """

    angle: float
    rate: float
    time: float
    cycle: float
    stiffness: float
    speed: float


def ranges(runs: Sequence[Path]) -> Ranges:
    """The ranges of some runs."""
    return Ranges(
        angle=max(float(np.max(np.abs(path.angle))) for path in runs),
        rate=max(float(np.max(np.abs(path.rate))) for path in runs),
        time=max(float(path.time[-1]) for path in runs),
        cycle=float(np.median([2.0 * np.pi / path.omega for path in runs])),
        stiffness=float(np.median([path.stiffness for path in runs])),
        speed=max(max(path.speed for path in runs), 1.0),
    )


def _splines(values: Array, low: float, high: float, count: int) -> Array:
    """Cubic B-splines on even knots, shape (n, count); values outside the range are moved to its end."""
    inner = np.linspace(low, high, count - 2)
    knots = np.concatenate([[low] * 3, inner, [high] * 3])
    return np.asarray(BSpline.design_matrix(np.clip(values, low, high), knots, 3).toarray())


def _times(one: Array, other: Array) -> Array:
    """Products of each column of one set with each column of the other."""
    return np.asarray((one[:, :, None] * other[:, None, :]).reshape(one.shape[0], -1))


Motion = Path | Places
Basis = Callable[[Motion, Ranges], Array]


def _spring(at: Motion, r: Ranges) -> float:
    """Deviation of the run's spring from the median, a share."""
    return at.stiffness / r.stiffness - 1.0


def _of_angle(at: Motion, r: Ranges, count: int) -> Array:
    return _splines(at.angle, -r.angle, r.angle, count)


def _of_rate(at: Motion, r: Ranges, count: int) -> Array:
    return _splines(at.rate, -r.rate, r.rate, count)


def _of_both(at: Motion, r: Ranges) -> Array:
    return _times(_of_angle(at, r, _COARSE), _of_rate(at, r, _COARSE))


def _wide(values: Array, reach: float) -> Array:
    """Wide splines, for a law to use before narrow ones; without them the prior would favour rough laws."""
    found = [_splines(values, -reach, reach, count) * (_FINE / count) for count in (_MEDIUM, _COARSE)]
    return np.column_stack(found)


def _rate_shapes(at: Motion, r: Ranges) -> Array:
    u = at.rate / r.rate
    return np.column_stack([u, np.tanh(u / _SETTLED), np.abs(u)])


def angle(at: Motion, r: Ranges) -> Array:
    """Moments of the angle alone, equal for all springs or in proportion to the spring."""
    wide = _wide(at.angle, r.angle)
    return np.column_stack([_of_angle(at, r, _FINE), wide, _spring(at, r) * wide])


def rate(at: Motion, r: Ranges) -> Array:
    """Moments of the rate alone."""
    wide = _wide(at.rate, r.rate)
    return np.column_stack([_of_rate(at, r, _FINE), _rate_shapes(at, r), wide, _spring(at, r) * wide])


def state(at: Motion, r: Ranges) -> Array:
    """Moments of angle and rate."""
    shaped = _times(_of_angle(at, r, 21), _rate_shapes(at, r))
    return np.column_stack([angle(at, r), rate(at, r), shaped, _of_both(at, r)])


def wind(at: Motion, r: Ranges) -> Array:
    """Moments of angle and rate in proportion to dynamic pressure; of the rate also to the wind speed."""
    share = at.speed / r.speed
    still = [
        share * _of_angle(at, r, _FINE),
        _of_both(at, r) * share,
        _times(_of_angle(at, r, _COARSE), _rate_shapes(at, r)[:, :1]),
    ]
    return np.column_stack(still) * share


def time(at: Motion, r: Ranges) -> Array:
    """Moments that vary in time, equal in all runs: alone, or as a stiffness, damping or friction."""
    slow = _splines(at.time, 0.0, r.time, _SLOW)
    fine = _splines(at.time, 0.0, r.time, max(4, round(_PER_CYCLE * r.time / r.cycle)))
    stiffness = at.angle / r.angle * np.array([[1.0], [_spring(at, r)], [(at.speed / r.speed) ** 2]])
    share = np.column_stack([*stiffness, at.rate / r.rate, _rate_shapes(at, r)[:, 1]])
    return np.column_stack([fine, _times(slow, share)])


def reading(at: Motion, r: Ranges) -> Array:
    """Errors of the reading, as shares of the greatest angle: of angle, rate and time, equal in all runs."""
    columns = [
        _of_angle(at, r, 2 * _FINE),
        _of_rate(at, r, _MEDIUM),
        _of_both(at, r),
        _splines(at.time, 0.0, r.time, 4 * _SLOW),
        _splines(at.time, 0.0, r.time, _SLOW) * (at.angle / r.angle)[:, None],
    ]
    return np.column_stack(columns)


def event(at: Motion, r: Ranges) -> Array:
    """Moments that vary in time, different from run to run."""
    first, last = float(at.time[0]), float(at.time[-1])
    return _splines(at.time, first, last, max(4, round(_PER_CYCLE * (last - first) / r.cycle)))


def between(at: Motion, r: Ranges) -> Array:
    """A steady moment, stiffness and damping that differ from run to run."""
    return np.column_stack([np.ones(at.angle.size), at.angle / r.angle, at.rate / r.rate])


def wander(at: Motion, r: Ranges) -> Array:
    """A zero that wanders or jumps differently in each run: steps that add up to a random walk."""
    knots = np.linspace(at.time[0], at.time[-1], max(4, round(_PER_CYCLE * r.time / r.cycle)))[1:-1]
    return np.asarray((at.time[:, None] > knots[None, :]).astype(np.float64))


#: Kinds with one law for all runs, which predicts a held-out run; simpler kinds first.
COMMON: Mapping[str, Basis] = {
    "angle": angle, "rate": rate, "wind": wind, "state": state, "time": time, "reading": reading,
}  # fmt: skip

#: Kinds that differ from run to run, so that only short gaps in a run can be predicted.
SINGLE: Mapping[str, Basis] = {"between": between, "wander": wander, "event": event}

#: Kinds that are errors of the reading; the others are moments.
OF_READING = frozenset({"reading", "wander"})
