"""Identification of one run: start, least squares, noise, standard deviations, windows.

Every method uses the same test of whether one damped oscillation explains a record. With little noise, a
method's own motion would fail it by the error of the method alone. The test therefore uses the least-squares
motion nearest to the method's decay, in `noise.noise_level`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.estimate import NoiseLevel, RunEstimate, Status, WindowEstimate, by_severity
from identification.policy import (
    FEW_CYCLES,
    GROSS_MISFIT,
    LEAST_ENERGY,
    LEAST_WINDOW_ENERGY,
    MISFIT_DEVIATIONS,
)
from identification.show.quantity import Quantity
from identification.signal.colour import Autoregression
from identification.signal.decay_fit import DecayFit, Reading, fit_decays, fit_run
from identification.signal.free_decay import Decay, envelope_amplitude
from identification.signal.frequency import starting_decay, thinned_reading
from identification.signal.noise import ReadingNoise, Residual, noise_of, samples_in_cycle, slow_power
from identification.signal.run_unknowns import ANGLE, ANGULAR_RATE, RATE, STIFFNESS, ZERO, RunFit
from identification.statistics import determined, eliminate, inner, inverse, widened_covariance
from tunnel_sim.vocabulary.campaign import Run, SensorProperties
from tunnel_sim.vocabulary.record import Array, Record

CYCLES = 3
_LEAST_WINDOWS = 4
# A steady change over n windows is n − 1 standard deviations of their successive differences; 3.29 are required.
_LEAST_TO_SEE_CHANGE = 5
_LEAST_SAMPLES = 16
# relative tolerance of a window's fit; the next Gauss–Newton step would be a thousand times smaller
_TOLERANCE = 1e-5
NO_WINDOWS = 10**6
"""Cycles per window longer than any record, so that a run has no windows."""
_UNKNOWNS = 5
_NEAR = 1e-6  # relative tolerance of the fit to block means that gives the start


@dataclass(frozen=True, eq=False)
class Gained:
    """Decay rate, stiffness and gain of the input of a run; a free decay has a gain of zero.

    Args:
        coefficients: a (1/s), k (1/s²) and g (rad/s² per unit of the input), shape (3,).
        weight: their information, the other unknowns eliminated, shape (3, 3); rows of zeros for a k known to
            be 0, and for a g that is k or a known number.
        offset: for a body without a spring, the constant moment added to the input, in the unit of the input.
    """

    coefficients: Array
    weight: Array
    offset: Quantity | None = None

    @classmethod
    def of(cls, coefficients: Array, covariance: Array, sought: Sequence[int] = (0, 1)) -> Gained:
        """From the covariance of the fitted coefficients, at their places in (a, k, g).

        Args:
            coefficients: (a, k, g), shape (3,), in SI units.
            covariance: covariance of the fitted coefficients, shape (s, s), in the products of their units.
        """
        weight = np.zeros((3, 3))
        weight[np.ix_(sought, sought)] = inverse(covariance)
        return cls(coefficients, weight)

    @property
    def deviations(self) -> Array:
        """Standard deviations of the coefficients, shape (3,), in their units; 0 where the weight has no row."""
        known = np.flatnonzero(self.weight.diagonal() > 0.0)
        found = np.zeros(3)
        found[known] = np.sqrt(inverse(self.weight[np.ix_(known, known)]).diagonal())
        return found


@dataclass(frozen=True, eq=False)
class FittedRun:
    """A run and its fit.

    Args:
        fit: the fit; None if the run could not be identified; the estimate's status says why.
        gained: decay rate, stiffness and gain from the fit; None if ``fit`` is None.
    """

    reading: Reading
    fit: RunFit | None
    noise: NoiseLevel | None
    estimate: RunEstimate
    gained: Gained | None = None

    @classmethod
    def failed(cls, run: Run, reading: Reading, status: Status) -> FittedRun:
        """A run without a result, and the reason."""
        return FittedRun(reading, None, None, RunEstimate(run.id, (status,)))


def identify_run(run: Run, sensor: SensorProperties, *, cycles_per_window: int | None = None) -> FittedRun:
    """Identify ωn, ζ, the initial state and the zero of one run by maximum likelihood, for any spring.

    Args:
        run: the run, with its input if it is driven; stiffness and gain are not used, except that a body
            without a spring has k = 0.
        cycles_per_window: periods in each window of a free decay; None: three, or one in a short record.
    """
    reading = Reading.from_run(run, sensor.derivative)
    forcing = reading.forcing
    if reading.time.size < forcing.least_samples:
        return FittedRun.failed(run, reading, Status.NOT_DETERMINED)
    start = forcing.start(run.record, starting_decay)
    if start is None:
        return FittedRun.failed(run, reading, Status.NO_OSCILLATION)
    fit = fit_from(run, reading, start)
    if fit is None:
        return FittedRun.failed(run, reading, Status.NOT_CONVERGED)
    fitted = forcing.alone(fit.runs[0])
    if fitted is None:
        return FittedRun.failed(run, reading, Status.NOT_DETERMINED)
    zero = forcing.level(reading.yaw, fit.zero)
    noise, failure = noise_and_failure(reading, fitted, zero, sensor)
    if failure is not None:
        return FittedRun.failed(run, reading, failure)
    level, variance = noise.level, noise.variance
    covariance = decay_covariance_of(fitted) * variance
    windows = (
        () if forcing.driven else fit_windows(reading, fitted.decay, zero, level, cycles=cycles_per_window)
    )
    estimate = describe_run(run, reading, fitted, zero, covariance, variance, noise=level, windows=windows)
    if not estimate.identified:
        return FittedRun(reading, None, level, estimate)
    return FittedRun(reading, fitted, level, estimate, _gained(run, reading, fit, variance))


def _gained(run: Run, reading: Reading, fit: DecayFit, variance: float) -> Gained:
    sought, fitted = reading.forcing.sought, fit.runs[0]
    weight = np.zeros((3, 3))
    size = len(sought)
    weight[np.ix_(sought, sought)] = eliminate(fit.normal, np.zeros(size + 1), size)[0] / variance
    coefficients = np.array([fitted.decay.rate, fitted.decay.stiffness, fitted.gain])
    offset = None
    if run.drive is not None and run.unrestrained:  # the constant acceleration over the gain
        slope = np.array([0.0, -fit.zero / fitted.gain**2, 1.0 / fitted.gain])
        std = float(np.sqrt(slope @ inverse(fit.normal) @ slope * variance))
        offset = Quantity(fit.zero / fitted.gain, std, run.drive.kind.unit)
    return Gained(coefficients, weight, offset)


def fit_from(run: Run, reading: Reading, start: Array) -> DecayFit | None:
    """The least-squares fit of a run by itself; None where it finds no motion that its body can have.

    Args:
        start: (a, k, g), shape (3,), in SI units.
    """
    forcing, decay = reading.forcing, Decay(float(start[0]), float(start[1]))
    if not forcing.driven and decay.omega_d > 0.0:
        # Block means come close to the optimum at a twentieth of the cost; the final fit uses all samples.
        thin = thinned_reading(run.record, decay.omega_d / (2.0 * np.pi))
        if thin.time.size <= run.record.time_s.size // 4:
            near = fit_run(thin, decay, tolerance=_NEAR)
            if near.converged:
                start = np.array([near.runs[0].decay.rate, near.runs[0].decay.stiffness])
    fit = fit_decays([reading], [forcing.link], start[forcing.sought])
    return fit if fit.converged and forcing.admits(fit.runs[0].decay, reading.time) else None


def residuals_of(
    readings: Sequence[Reading], runs: Sequence[RunFit], zero: float, unknowns: int
) -> list[Residual]:
    """The residuals of fitted runs, with the data needed to test them.

    Args:
        zero: the sensor's zero, rad.
        unknowns: number of parameters fitted to each run's own data.
    """
    residuals = []
    for reading, run in zip(readings, runs, strict=True):
        omega = float(np.sqrt(abs(run.decay.stiffness)))
        if omega == 0.0:  # a body without a spring: rms rate over rms angle
            motion = reading.yaw - run.residual
            rate, angle = float(np.std(np.gradient(motion, reading.time))), float(np.std(motion))
            omega = max(rate, 1e-300) / max(angle, 1e-300)
        interval = float(reading.time[-1] - reading.time[0]) / (reading.time.size - 1)
        peak = float(np.abs(reading.yaw - reading.forcing.level(reading.yaw, zero)).max())
        residuals.append(Residual(run.residual, samples_in_cycle(omega, interval), unknowns, peak))
    return residuals


def decay_covariance_of(fitted: RunFit) -> Array:
    """Covariance of (a, k) at the optimum of the least squares, shape (2, 2), over the noise variance in rad²."""
    return inverse(fitted.information)[np.ix_([RATE, STIFFNESS], [RATE, STIFFNESS])]


def noise_and_failure(
    reading: Reading, fitted: RunFit, zero: float, sensor: SensorProperties
) -> tuple[ReadingNoise, Status | None]:
    """The noise from the residual of one run's fit, and the status of a failure; None if there is none.

    Args:
        zero: sensor zero of the run, rad.
    """
    noise = noise_of(residuals_of([reading], [fitted], zero, _UNKNOWNS), sensor)
    motion = reading.yaw - zero - fitted.residual
    if float(inner(motion, motion)) < LEAST_ENERGY * max(noise.level.std, noise.level.residual_std) ** 2:
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

    The initial state and the zero fit the decay best; their uncertainty combines the reading's and the decay's.
    The only status is NOT_DETERMINED, for a covariance that is not positive definite.

    Args:
        zero: sensor zero of the run, rad.
        covariance: covariance of (a, k), shape (2, 2), in 1/s and 1/s².
        noise_variance: noise variance of one sample of the reading, rad².
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
        if omega_n and zeta and windows:
            departing = _departing_windows(reading, fitted, zero, noise, omega_n, windows)
            if departing:
                statuses.add(Status.FREQUENCY_CHANGES)
                omega_n = _spanning(omega_n, [window.omega_n for window in departing])
                zeta = _spanning(zeta, [window.zeta for window in departing])
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


def _departing_windows(
    reading: Reading,
    fitted: RunFit,
    zero: float,
    noise: NoiseLevel,
    omega_n: Quantity,
    windows: tuple[WindowEstimate, ...],
) -> tuple[WindowEstimate, ...]:
    """Windows of a run with a frequency that changes too much for a single oscillation to describe the run.

    The fit then loses phase against the motion, and mistakes this for damping. A random moment leaves as large
    a residual, but the frequencies of its windows scatter: their successive differences measure this scatter.

    Returns:
        The windows, of single cycles if the run has few others. None if one oscillation describes the motion,
        or if the frequencies change along the run, and differ from the run's own, by no more than such a
        scatter.
    """
    # slower than a cycle, the residual is a drift of the centre, which does not affect the fit's phase
    residual = fitted.residual - _mean_over_a_cycle(fitted.residual, reading, fitted.decay)
    missed = max(float(np.mean(residual**2)) - noise.std**2, 0.0)
    if missed <= GROSS_MISFIT * float(np.var(reading.yaw)):
        return ()
    if len(windows) < _LEAST_TO_SEE_CHANGE:
        windows = fit_windows(reading, fitted.decay, zero, noise, cycles=1)
    found = np.array([window.omega_n.value for window in windows])
    if found.size < 2:
        return ()
    noisy = float(np.mean([window.omega_n.known_std**2 for window in windows]))
    variance = noisy + 0.5 * float(np.mean(np.diff(found) ** 2))
    along = abs(found[-1] - found[0]) / np.sqrt(2.0 * variance)
    away = abs(found.mean() - omega_n.value) / np.sqrt(variance / found.size + omega_n.known_std**2)
    return windows if max(along, away) > MISFIT_DEVIATIONS else ()


def _mean_over_a_cycle(residual: Array, reading: Reading, decay: Decay) -> Array:
    """The running mean of a residual over about one cycle, shape (n,), rad; zero if a cycle has few samples."""
    step = float(reading.time[-1]) / (reading.time.size - 1)
    size = round(2.0 * np.pi / max(decay.omega_d * step, 2.0 * np.pi / residual.size))
    if not 2 <= size < residual.size // 2:
        return np.zeros_like(residual)
    total = np.concatenate([[0.0], np.cumsum(residual)])
    place = np.arange(residual.size)
    first, last = np.maximum(place - size // 2, 0), np.minimum(place - size // 2 + size, residual.size)
    return np.asarray((total[last] - total[first]) / (last - first))


def _spanning(value: Quantity, windows: Sequence[Quantity]) -> Quantity:
    """A quantity of the run with a standard deviation that includes its distance from the windows' values."""
    away = np.array([window.value for window in windows]) - value.value
    return Quantity(value.value, float(np.hypot(value.known_std, np.sqrt(np.mean(away**2)))), value.unit)


@dataclass(frozen=True, eq=False)
class ResidualCheck:
    """The verdict of the least-squares residual of a run.

    Args:
        covariance: covariance of (a, k) by least squares, widened if the model departs, shape (2, 2), in 1/s
            and 1/s².
        colour: colour of the noise; None if it is white.
    """

    noise: NoiseLevel
    covariance: Array
    colour: Autoregression | None = None

    @property
    def noise_std(self) -> float:
        """Standard deviation of white noise with the power at the frequency of the motion, rad."""
        return self.noise.std * float(np.sqrt(self.noise.slow_ratio))

    def widened(self, covariance: Array) -> Array:
        """A covariance of (a, k), shape (2, 2), raised to the least squares' covariance if the model departs."""
        if not self.noise.departs:
            return covariance
        return widened_covariance(covariance, np.sqrt(self.covariance.diagonal()))


def residual_check(run: Run, decay: Decay, sensor: SensorProperties) -> ResidualCheck | None:
    """Fit a run by least squares, starting from a method's decay, and test the residual.

    None if the least squares do not converge to a decay that the record determines.
    """
    reading = Reading.from_record(run.record)
    fit = fit_from(run, reading, np.array([decay.rate, decay.stiffness]))
    if fit is None:
        return None
    noise, failure = noise_and_failure(reading, fit.runs[0], fit.zero, sensor)
    if failure is not None:
        return None
    covariance = decay_covariance_of(fit.runs[0]) * noise.variance
    return ResidualCheck(noise.level, covariance, noise.colours[0] if noise.colours else None)


def fit_windows(
    reading: Reading, run: Decay, zero: float, noise: NoiseLevel, *, cycles: int | None = None
) -> tuple[WindowEstimate, ...]:
    """Fit a decay to each window of a few cycles of a run separately, as in the paper's Table III.

    Each window lasts ``cycles`` periods of its own fitted frequency and the next starts where it ends. The
    sensor's zero is common to them: the zero of the whole run or, where one decay does not fit the whole run, the
    median of the windows' own. The series ends with the record, or where the oscillation is below the noise; a
    window that one decay does not describe even roughly is skipped.

    Args:
        zero: sensor zero of the run, rad.
        cycles: periods in a window; None: three, or one if the record is too short for four such windows.
    """
    if cycles is None:
        cycles = CYCLES if _LEAST_WINDOWS * _length(run, CYCLES) <= float(reading.time[-1]) else 1
    if noise.departs:
        run = _start_at(reading, 0, run, cycles)
        own = [fit.zero for _, fit in _series(reading, run, None, noise, cycles)]
        zero = float(np.median(own)) if own else zero
    return tuple(window for window, _ in _series(reading, run, zero, noise, cycles))


def _series(
    reading: Reading, decay: Decay, zero: float | None, noise: NoiseLevel, cycles: int
) -> list[tuple[WindowEstimate, DecayFit]]:
    series: list[tuple[WindowEstimate, DecayFit]] = []
    interval = float(reading.time[-1]) / (reading.time.size - 1)
    begin = 0
    while True:
        # Fitted with the expected frequency, and again where the fitted frequency changes the length of the window.
        count = 0
        for _ in range(2):
            length = _length(decay, cycles) / interval
            if not _LEAST_SAMPLES <= length < reading.time.size - begin + 0.5:
                return series
            if count and abs(length - count) <= 0.01 * count:
                break
            count = round(length)
            part = slice(begin, begin + count)
            stretch = Reading(reading.time[part] - reading.time[begin], reading.yaw[part])
            fit = fit_run(stretch, decay, zero=zero, tolerance=_TOLERANCE)
            if not fit.runs:
                return series
            decay = fit.runs[0].decay
        motion = reading.yaw[part] - fit.zero - fit.runs[0].residual
        if float(inner(motion, motion)) < LEAST_WINDOW_ENERGY * noise.std**2:
            return series
        window = _window_estimate(reading.time[part], fit.runs[0], noise, cycles) if fit.converged else None
        if window is not None:
            series.append((window, fit))
        begin += count
        if window is None and begin < reading.time.size:
            decay = _start_at(reading, begin, decay, cycles)


def _start_at(reading: Reading, begin: int, decay: Decay, cycles: int) -> Decay:
    # Where one decay does not fit the preceding windows, its values may be far from the next window's.
    part = slice(begin, int(np.searchsorted(reading.time, reading.time[begin] + _length(decay, cycles))))
    if part.stop - part.start < _LEAST_SAMPLES or part.stop >= reading.time.size:
        return decay
    return starting_decay(Record(reading.time[part], reading.yaw[part])) or decay


def _length(decay: Decay, cycles: int) -> float:
    return cycles * 2.0 * np.pi / decay.omega_d if decay.omega_d > 0.0 else np.inf


def _window_estimate(time: Array, run: RunFit, noise: NoiseLevel, cycles: int) -> WindowEstimate | None:
    count = time.size
    interval = float(time[-1] - time[0]) / (count - 1)
    duration = count * interval
    decay = run.decay
    if not decay.stiffness > 0.0:  # a stretch that only creeps
        return None
    amplitude = envelope_amplitude(decay, run.angle, run.rate) * np.exp(-0.5 * decay.rate * duration)
    residual = Residual(run.residual, samples_in_cycle(decay.omega_n, interval), 4, 0.0)
    power, blocks = slow_power(residual.values, residual.block)
    least = noise.std**2 if noise.departs else noise.std**2 * noise.slow_ratio
    variance = max(least, power / max(blocks - residual.unknowns, 1))
    if not np.isfinite(amplitude) or 0.5 * count * amplitude**2 < LEAST_WINDOW_ENERGY * variance:
        return None
    order = [RATE, STIFFNESS, ANGLE, ANGULAR_RATE]
    information = run.information[np.ix_(order, order)]
    if not determined(information):
        return None
    covariance = inverse(information) * variance
    omega_n, zeta = modal_quantities(decay, covariance[:2, :2])
    # At mid-window the amplitude hardly depends on the damping: white noise gives A √(2/N).
    return WindowEstimate(
        start_s=float(time[0]),
        duration_s=duration,
        amplitude=Quantity(float(amplitude), float(np.sqrt(2.0 * variance / count)), "rad"),
        omega_n=omega_n,
        zeta=zeta,
        cycles=cycles,
    )


def modal_quantities(decay: Decay, covariance: Array) -> tuple[Quantity, Quantity]:
    """ωn in rad/s and ζ with their standard deviations, of a decay of positive stiffness.

    Args:
        covariance: covariance of (a, k), shape (2, 2), in 1/s and 1/s².
    """
    omega, zeta = decay.omega_n, decay.zeta
    slope = np.array([1.0 / omega, -0.5 * zeta / omega**2])
    omega_std = float(np.sqrt(covariance[1, 1])) / (2.0 * omega)
    zeta_std = float(np.sqrt(slope @ covariance @ slope))
    return Quantity(omega, omega_std, "rad/s"), Quantity(zeta, zeta_std, "1")
