"""Least squares of runs with an input, exact between its samples: a single run, or several together.

A run has the decay rate a, the stiffness k and the gain g of its input per unit inertia, (a, k, g) = L φ + c, and
three unknowns of its own: initial angle, initial rate, and the sensor's zero. A body without a spring has k = 0,
and its zero cannot be separated from its initial angle: its third unknown is instead a constant acceleration, from
a moment added to the input. With a spring, such a moment shifts the zero. The method is Levenberg and
Marquardt's, with exact derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from identification.estimate import Quantity, RunEstimate, Status
from identification.signal.decay_fit import Reading, RunFit
from identification.signal.driven import driven_rows, driven_start
from identification.signal.free_decay import Decay, response_rows, sensitivity_weights
from identification.signal.run_fit import FittedRun, decay_covariance_of, describe_run, noise_and_failure
from identification.statistics import determined, eliminate, inner, inverse, scaled_solve
from tunnel_sim.vocabulary.campaign import Run, SensorProperties
from tunnel_sim.vocabulary.drive import Drive
from tunnel_sim.vocabulary.record import Array

_MOST_STEPS = 60
_LEAST_SAMPLES = 4  # per unknown; with fewer the residual does not show the noise
_SETTLED = 1e-10  # relative fall of the sum of squares in a step that ends the iteration
_POOR = 0.5  # share of the expected fall of the sum of squares, below which a step was too long
_SHORTER = 0.3  # damping after such a step
_OWN = 3  # unknowns of each run: zero or constant acceleration, initial angle, initial rate
_GROWTH = 5.0  # logarithm of the growth over the record, beyond which a start overflows


@dataclass(frozen=True, eq=False)
class InputFit:
    """Runs at the optimum.

    Args:
        parameters: φ, shape (p,).
        own: zero (rad; without a spring the constant acceleration, rad/s²), initial angle (rad) and rate (rad/s) of
            each run, shape (r, 3).
        residuals: reading less model, by run, rad.
        normal: information of φ, of the common zero where there is one, and then of the runs' own unknowns, shape
            (m, m).
        converged: whether the last step reduced the sum of squares negligibly.
    """

    parameters: Array
    own: Array
    residuals: list[Array]
    normal: Array
    converged: bool


@dataclass(frozen=True, eq=False)
class Gained:
    """Decay rate, stiffness and gain of a driven run.

    Args:
        coefficients: a (1/s), k (1/s²) and g (rad/s² per unit of the input), shape (3,).
        weight: their information, the other unknowns eliminated, shape (3, 3); rows of zeros for a k known to be 0,
            and for a g that is k or a known number.
        offset: for a body without a spring, the constant moment added to the input, in the unit of the input.
    """

    coefficients: Array
    weight: Array
    offset: Quantity | None = None

    @property
    def deviations(self) -> Array:
        """Standard deviations of the coefficients, shape (3,), in their units; 0 where the weight has no row."""
        known = np.flatnonzero(self.weight.diagonal() > 0.0)
        found = np.zeros(3)
        found[known] = np.sqrt(inverse(self.weight[np.ix_(known, known)]).diagonal())
        return found


@dataclass(frozen=True, eq=False)
class DrivenRun(FittedRun):
    """A driven run and its fit.

    Args:
        gained: decay rate, stiffness and gain from the fit.
    """

    gained: Gained


def driven_run(run: Run, sensor: SensorProperties) -> FittedRun:
    """Identify a driven run by itself.

    Args:
        run: with its input; stiffness and gain are not used, except that a body without a spring has k = 0.

    Returns:
        A `DrivenRun`, or a run without a fit whose status says why.
    """
    reading = Reading.from_record(run.record)
    drive, drifts = run.drive, run.unrestrained
    assert drive is not None
    places, link = own_unknowns(run)
    if reading.time.size < _LEAST_SAMPLES * (len(places) + _OWN):
        return _failed(run, reading, Status.NOT_DETERMINED)
    derivative = sensor.derivative
    start = driven_start(reading.time, reading.yaw, drive.values, sprung=not drifts, derivative=derivative)
    if start is None or not (drifts or start[1] > 0.0):
        return _failed(run, reading, Status.NO_OSCILLATION)
    steps = np.diff(reading.time)
    rate = max(start[0], -_GROWTH / float(reading.time[-1] - reading.time[0])) if drifts else start[0]
    began = np.array([rate, *start[1:]])[places]
    found = fit_with_inputs([run], [link], began, own_zeros=True, derivative=derivative)
    coefficients = link @ found.parameters + constant_gain(run)
    # a record shows no resonance above half its sample rate
    fastest = np.pi / float(steps.min())
    if not found.converged or not (drifts or 0.0 < coefficients[1] < fastest**2):
        return _failed(run, reading, Status.NOT_CONVERGED)
    if not determined(found.normal):
        return _failed(run, reading, Status.NOT_DETERMINED)
    # In the order of free runs: the gain eliminated, and a row for k where it is known.
    size, kept = len(places), sum(place < 2 for place in places)
    order = [*range(kept), *range(size, size + _OWN), *range(kept, size)]
    normal = found.normal[np.ix_(order, order)]
    if size > kept:
        normal = eliminate(normal, np.zeros(len(order)), kept + _OWN)[0]
    information, at = np.eye(2 + _OWN), [*range(kept), 2, 3, 4]
    information[np.ix_(at, at)] = normal
    decay = Decay(float(coefficients[0]), float(coefficients[1]))
    angle, rate = found.own[0, 1:].tolist()
    fit = RunFit(decay, angle, rate, found.residuals[0], information, np.zeros(2 + _OWN))
    zero = float(reading.yaw.mean()) if drifts else float(found.own[0, 0])
    noise, failure = noise_and_failure(reading, fit, zero, sensor)
    if failure is not None:
        return _failed(run, reading, failure)
    variance = noise.std**2 * noise.slow_ratio
    estimate = describe_run(
        run, reading, fit, zero, decay_covariance_of(fit) * variance, variance, noise=noise
    )
    weight = np.zeros((3, 3))
    weight[np.ix_(places, places)] = eliminate(found.normal, np.zeros(len(found.normal)), len(places))[0]
    offset = None
    if drifts:  # the constant acceleration, over the gain
        gain, constant = float(found.parameters[1]), float(found.own[0, 0])
        slope = np.array([0.0, -constant / gain**2, 1.0 / gain, 0.0, 0.0])
        std = float(np.sqrt(slope @ inverse(found.normal) @ slope * variance))
        offset = Quantity(constant / gain, std, drive.kind.unit)
    gained = Gained(coefficients, weight / variance, offset)
    return DrivenRun(reading, fit if estimate.identified else None, noise, estimate, gained)


def own_unknowns(run: Run) -> tuple[list[int], Array]:
    """The unknowns of a driven run by itself.

    Returns:
        Their places in (a, k, g), and the link L with which (a, k, g) = L φ + c, shape (3, unknowns).
    """
    if run.unrestrained:
        return [0, 2], np.eye(3)[:, [0, 2]]
    known = run.known_gain
    if known is None:
        return [0, 1, 2], np.eye(3)
    link = np.eye(3)[:, :2]
    link[2, 1] = known.per_stiffness
    return [0, 1], link


def constant_gain(run: Run) -> Array:
    """The part c of (a, k, g) that depends on no unknown, shape (3,): a known gain, rad/s² per unit."""
    known = run.known_gain
    return np.array([0.0, 0.0, 0.0 if known is None else known.constant])


def input_response(reading: Reading, drive: Drive, decay: Decay, derivative: int) -> Array:
    """The response to an input of unit gain at the times of a reading, shape (n,), exact between the samples.

    Args:
        derivative: 0 for the angle, 1 for its rate.
    """
    held = drive.held
    of_decay = decay.rate, decay.stiffness
    rows = driven_rows(reading.time, drive.values, *of_decay, held=held, derivative=derivative)
    return np.asarray(rows[0], np.float64)


def _failed(run: Run, reading: Reading, status: Status) -> FittedRun:
    return FittedRun(reading, None, None, RunEstimate(run.id, (status,)))


def fit_with_inputs(
    runs: Sequence[Run], links: Sequence[Array], start: Array, *, own_zeros: bool, derivative: int = 0
) -> InputFit:
    """Fit runs together.

    Args:
        runs: driven or free.
        links: one per run, shape (3, p): (a, k, g) = L φ + c, with c of the run (`constant_gain`).
        start: of φ, shape (p,), SI.
        own_zeros: whether every run has its own zero; needed where one has no spring.
        derivative: 0 where the readings are angles, 1 where they are rates.

    Returns:
        The fit; ``converged`` is False where a start overflows or the steps do not converge.
    """
    parameters, own = start.astype(np.float64), np.zeros((len(runs), _OWN))
    for i, (run, link) in enumerate(zip(runs, links, strict=True)):
        with np.errstate(all="ignore"):  # a distant start may overflow
            residual, jacobian = linearised(run, link, parameters, own[i], derivative)
        if not (np.isfinite(residual).all() and np.isfinite(jacobian).all()):
            return InputFit(parameters, own, [], np.zeros((0, 0)), False)
        own[i] = np.linalg.lstsq(jacobian[:, -_OWN:], residual, rcond=None)[0]
    if not own_zeros:
        own[:, 0] = own[:, 0].mean()
    damping, converged = 1e-9, False
    equations = partial(normal_equations, runs, links, own_zeros=own_zeros, derivative=derivative)
    residuals, normal, gradient = equations(parameters, own)
    cost = sum(float(inner(r, r)) for r in residuals)
    for _ in range(_MOST_STEPS):
        try:
            step = scaled_solve(normal + damping * np.diag(np.diag(normal)), gradient)
        except np.linalg.LinAlgError:
            break
        size = parameters.size
        moved, moved_own = parameters + step[:size], own.copy()
        if own_zeros:
            moved_own += step[size:].reshape(-1, _OWN)
        else:
            moved_own[:, 0] += step[size]
            moved_own[:, 1:] += step[size + 1 :].reshape(-1, _OWN - 1)
        with np.errstate(all="ignore"):  # a distant trial may overflow; it is then rejected
            trial = equations(moved, moved_own)
            after = sum(float(inner(r, r)) for r in trial[0])
        if np.isfinite(after) and after <= cost:
            converged = cost - after <= _SETTLED * cost
            # with large residuals the step is too long, and the fit would oscillate without damping
            short = cost - after < _POOR * float(step @ (2.0 * gradient - normal @ step))
            damping = max(3.0 * damping, _SHORTER) if short else damping / 10.0
            parameters, own, cost = moved, moved_own, after
            residuals, normal, gradient = trial
        else:
            damping = max(10.0 * damping, 1e-6)
            converged = damping > 1e6
        if converged:
            break
    return InputFit(parameters, own, residuals, normal, converged)


def normal_equations(
    runs: Sequence[Run],
    links: Sequence[Array],
    parameters: Array,
    own: Array,
    *,
    own_zeros: bool,
    derivative: int = 0,
    filters: Sequence[tuple[Array, Array]] | None = None,
) -> tuple[list[Array], Array, Array]:
    """Residuals, information and score of φ, the common zero where there is one, and the runs' own unknowns.

    Args:
        links: one per run, shape (3, p): (a, k, g) = L φ + c.
        parameters: φ, shape (p,), SI.
        own: of each run as in `InputFit`, shape (r, 3).
        own_zeros: whether every run has its own zero.
        derivative: 0 where the readings are angles, 1 where they are rates.
        filters: numerator and denominator per run, shape (3,) each, of a recursive filter that whitens its noise;
            None where the noise is white.

    Returns:
        Residuals in rad; JᵀJ, shape (m, m); Jᵀ residual, shape (m,).
    """
    shared = parameters.size + (not own_zeros)
    width = _OWN if own_zeros else _OWN - 1
    normal = np.zeros((shared + width * len(runs),) * 2)
    gradient, residuals = np.zeros(len(normal)), []
    for i, (run, link) in enumerate(zip(runs, links, strict=True)):
        residual, jacobian = linearised(run, link, parameters, own[i], derivative)
        if filters is not None:
            from scipy.signal import lfilter  # only here: slow to load

            residual, jacobian = (lfilter(*filters[i], values, axis=0) for values in (residual, jacobian))
        places = np.r_[np.arange(shared), shared + width * i + np.arange(width)]
        normal[np.ix_(places, places)] += jacobian.T @ jacobian
        gradient[places] += inner(jacobian.T, residual)
        residuals.append(residual)
    return residuals, normal, gradient


def linearised(
    run: Run, link: Array, parameters: Array, own: Array, derivative: int = 0
) -> tuple[Array, Array]:
    """Residual and Jacobian of one run.

    Args:
        link: (a, k, g) = L φ + c, shape (3, p).
        parameters: φ, shape (p,), SI.
        own: zero (rad) or constant acceleration (rad/s²), initial angle (rad) and rate (rad/s), shape (3,).
        derivative: 0 where the readings are angles; 1 where they are rates. Zero and initial state are then rates
            too, since the rates of free motion obey the equation of its angles.

    Returns:
        Residual in rad, shape (n,), and derivatives of the model with respect to φ and ``own``, shape (n, p + 3).
    """
    time = run.record.time_s - run.record.time_s[0]
    rate, stiffness, gain = (float(value) for value in link @ parameters + constant_gain(run))
    constant, angle, initial = own.tolist()
    decay = Decay(rate, stiffness)
    rows = response_rows(time, decay)
    local = np.zeros((3, time.size))
    local[:2] = sensitivity_weights(decay, angle, initial) @ rows
    ones = np.ones(time.size)
    rest = (
        driven_rows(time, ones, rate, stiffness, held=True) if run.unrestrained else np.outer([1, 0, 0], ones)
    )
    model = constant * rest[0] + angle * rows[0] + initial * rows[1]
    local[:2] += constant * rest[1:]
    if run.drive is not None:
        held = run.drive.held
        driven = driven_rows(time, run.drive.values, rate, stiffness, held=held, derivative=derivative)
        model = model + gain * driven[0]
        local[:2] += gain * driven[1:]
        local[2] = driven[0]
    jacobian = np.column_stack([local.T @ link, rest[0], rows[0], rows[1]])
    return run.record.yaw_rad - model, jacobian
