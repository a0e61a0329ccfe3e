"""Identification of one run: start, least squares, noise, standard deviations, windows.

One test for every method says whether one damped oscillation explains a record. On a record of little noise a
method's own motion misses the record by the error of the method alone, so its residual does not judge the
record. The least-squares motion nearest to the method's decay is tested instead, by `noise.noise_level`. The
false-alarm rate is `identification.policy.MISFIT_RATE`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.estimate import (
    NoiseLevel,
    Quantity,
    RunEstimate,
    Status,
    WindowEstimate,
    by_severity,
)
from identification.policy import FEW_CYCLES, LEAST_ENERGY
from identification.signal.decay_fit import (
    ANGLE,
    ANGULAR_RATE,
    RATE,
    STIFFNESS,
    ZERO,
    DecayFit,
    Reading,
    RunFit,
    fit_run,
)
from identification.signal.free_decay import Decay
from identification.signal.frequency import starting_decay, thinned_reading
from identification.signal.noise import Residual, eighth_of_a_cycle, noise_level
from identification.signal.windows import fit_windows, modal_quantities
from identification.statistics import determined, inverse, widened_covariance
from tunnel_sim.vocabulary.campaign import Run, SensorProperties
from tunnel_sim.vocabulary.record import Array

NO_WINDOWS = 10**6
"""As periods in a window: longer than any record, so that a run has none."""
_UNKNOWNS = 5
_NEAR = 1e-6  # relative tolerance of the fit to block means that gives the start


@dataclass(frozen=True, eq=False)
class FittedRun:
    """A run and its fit.

    Args:
        fit: None where the run could not be identified; the estimate's status says why.
        noise: what the fit's residual says of the noise; None where the fit is.
        estimate: the run's own result.
    """

    reading: Reading
    fit: RunFit | None
    noise: NoiseLevel | None
    estimate: RunEstimate


def identify_run(run: Run, sensor: SensorProperties, *, cycles_per_window: int | None = None) -> FittedRun:
    """Identify ωn, ζ, the initial state and the sensor's zero of one run by maximum likelihood.

    Args:
        run: the run; its wind and spring are not used.
        cycles_per_window: periods in each of its windows; where None three, or one in a short record.
    """
    reading = Reading.from_record(run.record)
    start = starting_decay(run.record)
    if start is None:
        return _failed(run, reading, Status.NO_OSCILLATION)
    fit = fit_from(run, reading, start)
    if fit is None:
        return _failed(run, reading, Status.NOT_CONVERGED)
    fitted = fit.runs[0]
    noise, failure = noise_and_failure(reading, fitted, fit.zero, sensor)
    if failure is not None:
        return _failed(run, reading, failure)
    variance = noise.std**2 * noise.slow_ratio
    covariance = decay_covariance_of(fitted) * variance
    windows = fit_windows(reading, fitted.decay, fit.zero, noise, cycles=cycles_per_window)
    estimate = describe_run(
        run, reading, fitted, fit.zero, covariance, variance, noise=noise, windows=windows
    )
    found = fitted if estimate.identified else None
    return FittedRun(reading, found, noise, estimate)


def fit_from(run: Run, reading: Reading, start: Decay) -> DecayFit | None:
    """The least-squares fit of a run by itself.

    Returns:
        The fit; None where it does not converge to a decay of positive stiffness.
    """
    fit = fit_run(reading, _near(run, start))
    return fit if fit.converged and fit.runs[0].decay.stiffness > 0.0 else None


def _near(run: Run, start: Decay) -> Decay:
    # Block means lead most of the way to the optimum at a twentieth of the cost; the fit itself uses all samples.
    if start.omega_d == 0.0:
        return start
    thin = thinned_reading(run.record, start.omega_d / (2.0 * np.pi))
    if thin.time.size > run.record.time_s.size // 4:
        return start
    fit = fit_run(thin, start, tolerance=_NEAR)
    return fit.runs[0].decay if fit.converged else start


def residuals_of(
    readings: Sequence[Reading], runs: Sequence[RunFit], zero: float, unknowns: int
) -> list[Residual]:
    """The residuals of fitted runs, with what is needed to test them.

    Args:
        zero: the sensor's, rad.
        unknowns: number of parameters fitted to each run's own data.
    """
    return [
        Residual(
            values=run.residual,
            block=eighth_of_a_cycle(
                _pace(reading, run), float(reading.time[-1] - reading.time[0]) / (reading.time.size - 1)
            ),
            unknowns=unknowns,
            peak=float(np.abs(reading.yaw - zero).max()),
        )
        for reading, run in zip(readings, runs, strict=True)
    ]


def _pace(reading: Reading, run: RunFit) -> float:
    """ωn, or of a body without a spring its root-mean-square rate over that of its angle, rad/s."""
    if run.decay.stiffness != 0.0:
        return float(np.sqrt(abs(run.decay.stiffness)))
    motion = reading.yaw - run.residual
    rate, angle = float(np.std(np.gradient(motion, reading.time))), float(np.std(motion))
    return max(rate, 1e-300) / max(angle, 1e-300)


def decay_covariance_of(fitted: RunFit) -> Array:
    """Covariance of (a, k) per noise variance, at the optimum of the least squares.

    Returns:
        Shape (2, 2); times the noise variance in rad² it is in 1/s and 1/s².
    """
    return inverse(fitted.information)[np.ix_([RATE, STIFFNESS], [RATE, STIFFNESS])]


def noise_and_failure(
    reading: Reading, fitted: RunFit, zero: float, sensor: SensorProperties
) -> tuple[NoiseLevel, Status | None]:
    """The noise level from the residual of one run's fit, and whether the run shows a decay at all.

    Args:
        zero: its sensor zero, rad.

    Returns:
        The noise level, and the status of the failure, None if there is none.
    """
    noise = noise_level(residuals_of([reading], [fitted], zero, _UNKNOWNS), sensor)
    motion = reading.yaw - zero - fitted.residual
    if float(motion @ motion) < LEAST_ENERGY * max(noise.std, noise.residual_std) ** 2:
        return noise, Status.NO_OSCILLATION
    return noise, None if determined(fitted.information) else Status.NOT_DETERMINED


def describe_run(
    run: Run,
    reading: Reading,
    fitted: RunFit,
    zero: float,
    covariance: Array,
    noise_variance: float,
    *,
    noise: NoiseLevel | None = None,
    windows: tuple[WindowEstimate, ...] = (),
) -> RunEstimate:
    """The result of one run from its decay, whatever the method.

    The initial state and the zero are those that fit the decay best; their uncertainty is that of the reading
    and that of the decay.

    Args:
        zero: its sensor zero, rad.
        covariance: of (a, k), shape (2, 2), in 1/s and 1/s².
        noise_variance: of one sample of the reading, rad².
        noise: the level behind the standard deviations; None where the method does not use it.

    Returns:
        The estimate with the statuses that follow from its noise, its length and its spring; only NOT_DETERMINED
        where the method's covariance is not positive definite.
    """
    if not determined(covariance):
        return RunEstimate(run.id, (Status.NOT_DETERMINED,))
    rest, decay = [ZERO, ANGLE, ANGULAR_RATE], [RATE, STIFFNESS]
    own = inverse(fitted.information[np.ix_(rest, rest)])
    move = own @ fitted.information[np.ix_(rest, decay)]
    deviations = np.sqrt(np.diag(own * noise_variance + move @ covariance @ move.T))
    held = not run.unrestrained
    omega_n, zeta = modal_quantities(fitted.decay, covariance) if held else (None, None)
    statuses = set()
    if noise is not None and noise.departs:
        statuses.add(Status.MODEL_DEPARTS)
    if noise is not None and noise.disagrees:
        statuses.add(Status.NOISE_DISAGREES)
    if held and fitted.decay.omega_d * float(reading.time[-1]) < 2.0 * np.pi * FEW_CYCLES:
        statuses.add(Status.FEW_CYCLES)
    if run.spring_stiffness is None:
        statuses.add(Status.NO_STIFFNESS)
    return RunEstimate(
        id=run.id,
        statuses=by_severity(statuses),
        omega_n=omega_n,
        zeta=zeta,
        initial_angle=Quantity(fitted.angle, float(deviations[1]), "rad"),
        initial_rate=Quantity(fitted.rate, float(deviations[2]), "rad/s"),
        sensor_zero=Quantity(zero, float(deviations[0]), "rad") if held else None,
        noise=noise,
        windows=windows,
    )


def _failed(run: Run, reading: Reading, status: Status) -> FittedRun:
    return FittedRun(reading, None, None, RunEstimate(run.id, (status,)))


@dataclass(frozen=True, eq=False)
class ResidualCheck:
    """The verdict of the least-squares residual of a run.

    Args:
        covariance: of (a, k) by least squares, widened where the model departs, shape (2, 2), in 1/s and 1/s².
    """

    noise: NoiseLevel
    covariance: Array

    def widened(self, covariance: Array) -> Array:
        """A method's covariance of (a, k), raised to that of least squares where the model departs.

        Args:
            covariance: the method's own, shape (2, 2), in 1/s and 1/s².

        Returns:
            Shape (2, 2); no standard deviation is smaller than that of the widened least squares.
        """
        if not self.noise.departs:
            return covariance
        return widened_covariance(covariance, np.sqrt(self.covariance.diagonal()))


def residual_check(run: Run, decay: Decay, sensor: SensorProperties) -> ResidualCheck | None:
    """Fit a run by least squares, starting from a method's decay, and test the residual.

    Returns:
        The verdict; None where the least squares do not converge to a decay that the record determines.
    """
    reading = Reading.from_record(run.record)
    fit = fit_from(run, reading, decay)
    if fit is None:
        return None
    noise, failure = noise_and_failure(reading, fit.runs[0], fit.zero, sensor)
    if failure is not None:
        return None
    covariance = decay_covariance_of(fit.runs[0]) * (noise.std**2 * noise.slow_ratio)
    return ResidualCheck(noise, covariance)
