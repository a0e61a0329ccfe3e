"""The measured path of every run, and the reading that a further moment along it would cause.

The nominal model is linear, so that a missing moment m changes the reading by the response of the linear rig to
m(t), however large the gap is, provided that m is evaluated along the true motion. The measured motion is close to
it: the fitted motion and the smoothed residual together.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import linear_coefficients, resonance
from diagnosis.likelihood.run_data import RunData
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.record import Array

_WINDOW, _NARROW = 0.4, 0.2  # of a cycle; the first passes the third harmonic at half height
_LARGE = 30.0  # noise variances of a block mean: of a residual beyond, the smoothing may take nothing
_ROWS = 24  # per cycle, to which white residuals are averaged: the motion has no more than its third harmonic


@dataclass(frozen=True, eq=False)
class Path:
    """One run as a law sees it.

    Args:
        fit: whose residuals are to be explained.
    """

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
        """Time since the start of what is fitted, s, shape (n,)."""
        return np.asarray((np.arange(self.run.reading.size) + 0.5) * self.run.interval)

    @cached_property
    def _motion(self) -> tuple[Array, Array]:
        run = self.run
        residual = run.unscaled(self.fit.residuals[self.index])
        fitted = run.reading - residual - self.fit.zero(self.index)
        slope = np.gradient(fitted, run.interval)
        omega = self.omega
        if (
            run.derivative
        ):  # each derivative of an oscillation leads by a quarter cycle and is ω times as large
            angle, rate = ((-slope, fitted * omega**2), (-fitted, -slope))[run.derivative - 1]
            return angle / omega**2, rate / omega**2
        large = float(np.mean(self.fit.residuals[self.index] ** 2)) > _LARGE
        width = 2 * round(np.pi * (_NARROW if large else _WINDOW) / (omega * run.interval)) + 1
        if width < 5 or width > residual.size // 4:
            return fitted, slope
        from scipy.signal import savgol_filter  # only here: slow to load

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
        """Of the spring, stated or fitted where none is stated, N m/rad; the rig's at rest where no spring acts."""
        return self._stated.spring_stiffness or float(linear_coefficients(self.fit, self.index)[2])

    @property
    def still_omega(self) -> float:
        """√(Kr/Izz), rad/s, as the expressions of effects have it."""
        return float(np.sqrt(self.stiffness / self._stated.yaw_inertia))

    @cached_property
    def _stated(self) -> RunSettings:
        point = self.fit.point
        return self.fit.problem.stated(point.common, point.release[self.index], self.run)

    def _filter(self, interval: float) -> tuple[Array, Array]:
        """Numerator and denominator of the reading's response to a moment that is linear in between."""
        from scipy.signal import cont2discrete  # only here: slow to load

        numerator = np.array([1.0] + [0.0] * self.run.derivative)
        denominator = np.array(linear_coefficients(self.fit, self.index))
        found = cont2discrete((numerator, denominator), interval, "foh")
        return np.ravel(found[0]), found[1]

    def response(self, moment: Array) -> Array:
        """What a moment adds to the reading of the rig that was at rest.

        Args:
            moment: N m, shape (n, k).

        Returns:
            White residuals averaged in groups, shape (rows, k), in noise standard deviations.
        """
        from scipy.signal import lfilter  # only here: slow to load

        run = self.run
        if self._white:
            rows = self.rows(moment) / np.sqrt(run.noise_variance)
            return np.asarray(lfilter(*self._filter(self.group * run.interval), rows, axis=0))
        return self.seen(lfilter(*self._filter(run.interval), moment, axis=0))

    @property
    def _white(self) -> bool:
        return self.run.samples is None and self.run.taps.size == 1

    @cached_property
    def group(self) -> int:
        """Blocks averaged into a row."""
        return max(1, round(2.0 * np.pi / (self.omega * self.run.interval * _ROWS)))

    def seen(self, reading: Array) -> Array:
        """A change of the reading as rows.

        Args:
            reading: unit of the reading, shape (n, k).

        Returns:
            Shape (rows, k), in noise standard deviations.
        """
        run = self.run
        if run.samples is None:
            return self.rows(run.white(reading) / np.sqrt(run.noise_variance))
        count = run.samples.count[:, None]
        white = run.white(np.where(count > 0, reading, 0.0))
        return self.rows(white * np.sqrt(count / (run.block * run.noise_variance)))

    def rows(self, white: Array) -> Array:
        """Residuals averaged in groups.

        Args:
            white: in noise standard deviations, shape (n, k) or (n,).

        Returns:
            Of the same noise, shape (rows, k) or (rows,); an incomplete last group is left out.
        """
        count = white.shape[0] // self.group
        grouped = white[: count * self.group].reshape(count, self.group, *white.shape[1:])
        return np.asarray(grouped.sum(axis=1) / np.sqrt(self.group))

    @cached_property
    def residual(self) -> Array:
        """What is to be explained, shape (rows,)."""
        return self.rows(self.fit.residuals[self.index])

    @cached_property
    def release(self) -> Array:
        """Responses that the release and the run's own numbers absorb, orthonormal, shape (rows, own)."""
        inertia, damping, stiffness = linear_coefficients(self.fit, self.index)
        roots = np.roots([inertia, damping, stiffness]).astype(complex)
        waves = np.exp(np.outer(self.time - self.time[0], roots))
        free = np.column_stack([waves.sum(axis=1).real, (waves[:, 0] - waves[:, 1]).imag])
        if abs(roots[0].imag) < 1e-9:
            free = waves.real
        own = [self.fit.jacobian[self.index][1][:, 2:]]
        return np.linalg.qr(np.column_stack([self.seen(free), *map(self.rows, own)]))[0]

    @cached_property
    def nominal(self) -> Array:
        """Responses to a step of the model's common parameters, in their order, shape (rows, common).

        The moments of inertia, damping and air are those along the measured path, so that they hold however far the
        parameters move.
        """
        data, run = self.fit.problem.data, self.run
        inertia, damping, stiffness = linear_coefficients(self.fit, self.index)
        pressure = data.air_moment(run)
        lag = pressure * data.reference_length / run.wind_speed if run.wind_on else 0.0
        swing = (stiffness * self.angle + damping * self.rate) / inertia  # the angular acceleration, reversed
        moments = [-self.angle if data.normalised else swing, -self.rate]
        if data.wind_on:
            moments += [pressure * self.angle, lag * self.rate]
        columns = [self.response(np.column_stack(moments))]
        known = len(moments)
        columns.append(self.rows(self.fit.jacobian[self.index][0][:, known:]))
        return np.column_stack(columns)


def paths(fit: Fit) -> list[Path]:
    """The paths of all runs.

    Args:
        fit: whose residuals are to be explained.

    Returns:
        One per run, in order.
    """
    return [Path(fit, index) for index in range(len(fit.problem.data.runs))]
