"""The length of an integration step; no other module determines it.

With the classical Runge–Kutta method of order 4 and steps h, the amplitude of an undamped oscillation of
angular frequency ω falls by (ωh)⁶/144 per step, and its phase lags by (ωh)⁵/120: a spurious damping ratio of
(ωh)⁵/144 and a relative frequency error of −(ωh)⁴/120. The phase angle per step is limited for the body on
its spring (`FREQUENCY_ERROR`), for a flexible rod's own mode to half a radian, and for any mode to
`_UNSTABLE`.

Fits predict thousands of runs: their steps are longer (`fit_substeps`), with compensation for their error
(`compensated`). Reported results are predicted again with shorter steps (`report_substeps`). Steps are divided
only by whole numbers, so that a sample interval remains a whole number of steps.
"""

from __future__ import annotations

import dataclasses
from math import ceil, inf, isfinite, log, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import RunSettings, SettingsTable, column_places
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import aerodynamic_damping, aerodynamic_stiffness
from tunnel_sim.vocabulary.quantities import DurationPerRun, Hertz, Laws, RatePerRun, Seconds, SpeedPerRun
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Rig

#: Greatest relative error of the body's frequency due to integration; the damping ratio is then wrong by 9e-8.
FREQUENCY_ERROR = 1e-6
#: Phase angle of the body's oscillation per step that causes this error, rad.
BODY_TURN = (120.0 * FREQUENCY_ERROR) ** 0.25
#: Greatest phase angle of the rod's own mode per step, rad.
ROD_TURN = 0.5
#: Maximum number by which a step is divided: a run then takes hundreds of times the usual time and memory.
MOST_SUBSTEPS = 320
USUAL_RATE = 1000.0  # steps per second, unless a faster motion requires more
#: Shortest step, s; slightly less than `MOST_SUBSTEPS` of the usual one, for rounding.
LEAST_STEP = 0.999 / (USUAL_RATE * MOST_SUBSTEPS)

#: Longest step of reported results, s.
REPORT_STEP = 2e-3

_FIT_STEP = 8.75e-3  # s: a body at the 2 Hz to which the fits scale time turns by `_FIT_BODY_TURN`
_FIT_BODY_TURN = 0.11  # rad: once `compensated`, some 1e-6 rad over 10 s
_FIT_MOST_STRIDE = 3  # number of block means per step
#: Parameters of moments that a long step of a fit does not resolve: kinks, and a nonlinear spring.
_ROUGH = ("friction_moment", "friction_load", "free_play", "gravity_stiffness")
_FIT_KINKED_TURN = 0.055  # rad: for a spring with a kink, which causes an error of second order
_FIT_SHORTEST = 2e-4  # s, for any stiffness of the rod
_FIT_MOST_TURN = pi  # rad from one block mean to the next: no record shows a faster oscillation
_REPORT_ROD_TURN = 0.25  # rad
_REPORT_SHORTEST = 1e-4  # s
_REPORT_DELAYED = 4  # factor on the number of steps if the input is delayed
_UNSTABLE = 2.5  # rad per step; the method diverges beyond 2.8
_LARGEST = 700.0  # logarithm of nearly the largest float
_MOST_CONTACT_SUBSTEPS = 40
_LEAST_RANGE = 1e-6  # rad: a shorter presliding range does not shorten the steps further


def whole_steps(sample_rate: Hertz) -> Seconds:
    """The longest step, at most 1/`USUAL_RATE`, that divides the sample interval."""
    return 1.0 / (sample_rate * max(1, ceil(USUAL_RATE / sample_rate)))


def fit_substeps(runs: SettingsTable, interval: DurationPerRun) -> NDArray[np.int64]:
    """Number of steps of the fits from one block mean to the next, by run.

    A fit may try a body that turns more than half a turn between block means. The steps are too long to resolve
    such a body, and its motion decays at once or diverges.
    """
    body = np.sqrt(runs.spring_stiffness / runs["yaw_inertia"])
    turn = np.where(runs["free_play"] != 0.0, _FIT_KINKED_TURN, _FIT_BODY_TURN)
    longest = np.minimum(_FIT_STEP, turn / np.minimum(np.maximum(body, 1e-9), _FIT_MOST_TURN / interval))
    for place, rod in enumerate(runs.rod_twist):
        if rod is not None:
            fastest = rod.free_frequency(float(runs["yaw_inertia"][place]))
            longest[place] = min(longest[place], max(ROD_TURN / fastest, _FIT_SHORTEST))
    return np.ceil(interval / longest).astype(np.int64)


def input_substeps(least: int, interval: Seconds, drive: InputMoment) -> int:
    """The number of steps in an interval, at least a given one, that begin at the samples of an input if they can.

    Args:
        interval: interval between block ends.
        drive: drive of the run, without an actuator.
    """
    if not drive.interval:
        return least
    inside = max(1, round(interval / drive.interval))  # samples in an interval
    return inside * ceil(least / inside) if drive.on_steps(interval / inside) else least


def fit_stride(rig: Rig, runs: SettingsTable, interval: DurationPerRun) -> NDArray[np.int64]:
    """Number of block means in one step of a fit, by run; the motion between its ends is cubic.

    The rods are rigid. 1 if a moment has a kink, is sampled, or is not mostly linear.
    """
    turn = np.maximum(body_rates(rig, runs) * interval, 1e-9)
    turn[~np.isfinite(turn)] = np.inf
    stride = np.clip(np.floor(_FIT_BODY_TURN / turn), 1.0, _FIT_MOST_STRIDE).astype(np.int64)
    sampled = [bool(s or p) for s, p in zip(runs.series, runs.program, strict=True)]
    rough = np.any([runs[name] != 0.0 for name in _ROUGH], axis=0)
    return np.where(rough | sampled, 1, stride)


def compensated(law: Laws, wind_speed: SpeedPerRun, step: DurationPerRun) -> tuple[Laws, DurationPerRun]:
    """The moment laws and the steps with which the method's leading errors in a linear oscillation vanish.

    Per step h the method turns a root λ by λh − (λh)⁵/120 + (λh)⁶/144. For an oscillation that decays slowly, at
    the rate σ, this is ωh (1 − (ωh)⁴/120): the step is lengthened by that share. The decay is then
    σ (1 − (ωh)⁴/30) + ω (ωh)⁵/144, and the damper compensates for both. The residual error is of the order (ωh)⁵.
    """
    at = column_places()
    inertia, loss = law[:, at["yaw_inertia"]], law[:, at["mechanical_damping"]]
    flow = {name: law[:, at[name]] for name in ("air_density", "frontal_area", "reference_length")}
    flow["wind_speed"] = wind_speed
    air = aerodynamic_stiffness(law[:, at["cn_beta"]], **flow)
    damping = loss - aerodynamic_damping(law[:, at["cn_r"]], **flow)
    rate = np.sqrt(np.maximum(0.0, law[:, at["spring_stiffness"]] - air) / inertia)
    turn = np.minimum(rate * step, _FIT_BODY_TURN)  # a body too fast for the steps is not compensated
    found = law.copy()
    found[:, at["mechanical_damping"]] += damping * turn**4 / 30.0 - inertia * rate * turn**5 / 72.0
    return found, step * (1.0 + turn**4 / 120.0)


def report_substeps(run: RunSettings, interval: Seconds, block: int) -> int:
    """Number of steps of the reported prediction from one block mean to the next, after an interval.

    Args:
        block: number of samples in the interval. Steps end at the samples of an input; a delayed or changed
            input is given by its means over the steps, a method of second order.
    """
    longest = REPORT_STEP
    if run.rod_twist is not None:
        rod = run.rod_twist.free_frequency(run.yaw_inertia)
        longest = min(REPORT_STEP, max(_REPORT_ROD_TURN / rod, _REPORT_SHORTEST))
    steps = ceil(interval / longest - 1e-9)
    if run.drive is None:
        return steps
    return block * -(-steps // block) * (1 if run.drive.as_sampled else _REPORT_DELAYED)


def for_rod(run: RunSettings) -> RunSettings:
    """The run with steps short enough for its rod's own oscillation; unchanged if the rod is rigid."""
    return _divided(run, min(MOST_SUBSTEPS, _substeps(_rod_rate(run) * run.timestep, ROD_TURN)))


def for_contact(run: RunSettings) -> RunSettings:
    """The run with steps short enough for a rubbing contact.

    The motion after a reversal covers at most half the presliding range, and friction that depends on the rate
    changes the rate by at most half of the friction's range of rates.
    """
    law = run.parameters
    reach, friction, peak = (
        law.get(name, 0.0) for name in ("presliding", "friction_moment", "friction_peak")
    )
    if share := law.get("friction_load", 0.0):
        weight = sum(abs(law.get(name, 0.0)) for name in ("gravity_stiffness", "load_stiffness"))
        driven = run.drive.greatest[0] if run.drive is not None and run.drive.on_body else 0.0
        friction += share * max(weight, driven)
    names = ("friction_saturation", "friction_peak_rate")
    rates = [rate for name in names if (rate := law.get(name, 0.0)) > 0.0]
    if friction == 0.0 or (reach == 0.0 and not rates):
        return run
    share = run.rod_twist.inertia_share if run.rod_twist is not None else 1.0
    inertia = share * run.yaw_inertia
    longest = [0.5 * rate * inertia / (friction * (1.0 + peak)) for rate in rates]
    if reach != 0.0:
        swing = run.spring_stiffness * abs(run.release_angle)
        swing += sqrt(run.spring_stiffness * inertia) * abs(run.release_rate)
        acceleration = max(swing, friction) / inertia
        longest.append(sqrt(max(reach, _LEAST_RANGE) / acceleration))
    return _divided(run, min(_MOST_CONTACT_SUBSTEPS, max(1, ceil(run.timestep / min(longest)))))


def follow_fastest(rig: Rig, run: RunSettings) -> RunSettings:
    """The run with steps short enough for its fastest motion; refused if they are below `LEAST_STEP`."""
    body, rod = body_rate(rig, run), _rod_rate(run)
    number = max(_substeps(body * run.timestep, BODY_TURN), _substeps(rod * run.timestep, ROD_TURN))
    if number > 1 and run.timestep / number < LEAST_STEP:
        raise _too_fast(run, body, rod)
    return _divided(run, number)


def check_stable(rig: Rig, run: RunSettings) -> None:
    """Refuse steps with which the integration would diverge."""
    body, rod = body_rate(rig, run), _rod_rate(run)
    if max(body, rod) * run.timestep > _UNSTABLE:
        raise _too_fast(run, body, rod)


def body_rate(rig: Rig, run: RunSettings) -> float:
    """The rate of `body_rates` for one run, rad/s."""
    return float(body_rates(rig, run.table)[0])


def body_rates(rig: Rig, runs: SettingsTable) -> RatePerRun:
    """The fastest rate of every body on its spring, with or without wind, at the slopes of the release."""
    with np.errstate(over="ignore", invalid="ignore"):  # a fit may try a diverging law
        return _body_rates(rig, runs)


def _body_rates(rig: Rig, runs: SettingsTable) -> Array:
    inertia, angle = runs["yaw_inertia"], np.abs(runs["release_angle"])
    # stiffness of spring and gravity at the release
    steeper = _slope(runs, "stiffness_cubic", 3.0, angle, 0.2)
    steeper += _slope(runs, "stiffness_quadratic", 2.0, angle, 0.2)
    spring = runs.spring_stiffness * (1.0 + steeper) + np.abs(runs["gravity_stiffness"])
    swing = angle * np.sqrt(spring / inertia) + np.abs(runs["release_rate"])
    damping = runs["mechanical_damping"] + np.abs(runs["loss_factor"]) * np.sqrt(
        runs.spring_stiffness * inertia
    )
    damping += _slope(runs, "quadratic_damping", 2.0, swing, 2.0)
    still = _largest_root(spring, damping, inertia)
    given = [series.get("wind_speed") for series in runs.series]
    fastest = np.array(
        [max(one.values) if one else v for one, v in zip(given, runs.wind_speed.tolist(), strict=True)]
    )
    air, air_damping = runs.air(rig, fastest)
    steeper = air * _slope(runs, "moment_cubic", 3.0, angle, 0.2)
    thicker = runs["damping_quadratic"] * _power(angle, 2.0, runs["damping_quadratic_exponent"], 0.2)
    loss = damping - air_damping * (1.0 + thicker)
    stiffness = [spring - air]
    if steeper.any():
        stiffness += [spring - air - steeper, spring - air + steeper]
    windy = np.max([still, *(_largest_root(one, loss, inertia) for one in stiffness)], axis=0)
    return np.asarray(np.where(fastest == 0.0, still, windy), np.float64)


def _slope(runs: SettingsTable, name: str, textbook: float, x: Array, reference: float) -> Array:
    """Magnitude of the slope at x of a power term, by run."""
    coefficient = np.abs(runs[name])
    if not coefficient.any():
        return coefficient
    # the aerodynamic factor multiplies the angle itself, which adds one to the exponent
    beside = 1.0 if name == "moment_cubic" else 0.0
    given = runs[f"{name}_exponent"]
    exponent = np.where(given != 0.0, given, textbook - beside) + beside
    found = coefficient * exponent * _power(x, textbook, exponent, reference) / np.where(x > 0.0, x, 1.0)
    return np.where((coefficient == 0.0) | (x == 0.0), 0.0, found)


def _power(x: Array, textbook: float, exponent: Array, reference: float) -> Array:
    """X to a power, scaled to agree with the textbook power at the reference; exponent 0: textbook power."""
    power = np.where(exponent != 0.0, exponent, textbook)
    size = textbook * log(reference) + power * np.log(np.where(x > 0.0, x, reference) / reference)
    return np.where(x > 0.0, np.exp(np.minimum(_LARGEST, size)), 0.0)


def _largest_root(stiffness: Array, damping: Array, inertia: Array) -> Array:
    """Magnitude of the larger root of I s² + C s + K, rad/s."""
    half, square = np.abs(damping) / (2.0 * inertia), stiffness / inertia
    inside = half * half - square
    return np.where(
        inside > 0.0, half + np.sqrt(np.maximum(inside, 0.0)), np.sqrt(np.where(inside > 0.0, 0.0, square))
    )


def _rod_rate(run: RunSettings) -> float:
    """An upper bound on the frequency of the rod's own mode, rad/s; 0 for a rigid rod."""
    twist = run.rod_twist
    return 0.0 if twist is None else twist.frequency(run.yaw_inertia, run.spring_stiffness)


def _substeps(turn: float, allowed: float) -> float:
    return max(1, ceil(turn / allowed)) if isfinite(turn) else inf


def _divided(run: RunSettings, number: float) -> RunSettings:
    return run if number <= 1 else dataclasses.replace(run, timestep=run.timestep / number)


def _too_fast(run: RunSettings, body: float, rod: float) -> TunnelError:
    by_rod = rod / ROD_TURN > body / BODY_TURN
    what, rate = ("the oscillation of the rod", rod) if by_rod else ("the body's motion on its spring", body)
    remedy = "give a larger compliance (0 for a rigid rod) or an inertia_share further from 0 and 1"
    if not by_rod:
        remedy = "check spring_stiffness (N m/rad), yaw_inertia (kg m2) and damping"
    return TunnelError(
        f"{what} at {rate / (2.0 * pi):.4g} Hz is too fast for steps of {run.timestep:g} s", remedy=remedy
    )
