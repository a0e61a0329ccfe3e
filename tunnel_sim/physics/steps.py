"""How long an integration step may be: the one place that decides it.

Runge and Kutta's method of order 4, in steps h, takes an undamped oscillation of ω as one whose amplitude falls
by (ωh)⁶/144 and whose phase lags by (ωh)⁵/120 in each step. That is a damping ratio of (ωh)⁵/144 that is not
there, and a frequency too low by (ωh)⁴/120 of itself. From these come the turns (ωh, rad) that a step may cover:

- of the body on its spring, with and without the wind: `FREQUENCY_ERROR` of the frequency;
- of a flexible rod's own mode: half a radian, 5e-4 of its frequency and 2.2e-4 of damping ratio beside its 1 %;
- for any mode: `_UNSTABLE`, beyond which the method diverges.

Fits predict thousands of runs and may err up to the noise of a block mean: their steps are longer
(`fit_substeps`). What is reported is predicted once more in steps of `REPORT_STEP` at most (`report_substeps`):
half those of a fit of a body below 14 rad/s, in which the method errs a sixteenth as much.

A step is only ever divided by a whole number, so that a sample interval remains a whole number of steps.
"""

from __future__ import annotations

import dataclasses
from math import ceil, exp, inf, isfinite, log, pi, sqrt

from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.aero import aerodynamic_damping, aerodynamic_stiffness
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.rig import Rig

#: Largest relative error of the body's frequency that the integration may make; of the damping ratio, 9e-8.
FREQUENCY_ERROR = 1e-6
#: Turn of the body's oscillation in one step that makes that error, rad.
BODY_TURN = (120.0 * FREQUENCY_ERROR) ** 0.25
#: Turn of the rod's own mode in one step, rad.
ROD_TURN = 0.5
#: Steps in place of one at the most: a run then takes hundreds of times as long as usual, and as much memory.
MOST_SUBSTEPS = 320
USUAL_RATE = 1000.0  # steps in a second where nothing asks for more
#: Shortest step, s; by a rounding less than `MOST_SUBSTEPS` of the usual one.
LEAST_STEP = 0.999 / (USUAL_RATE * MOST_SUBSTEPS)

#: Longest step of what is reported, s.
REPORT_STEP = 2e-3

_FIT_STEP = 4.001e-3  # s: no shorter than a block mean, whatever its last digit
_FIT_BODY_TURN = 0.055  # rad: some 1e-6 rad over 10 s
_FIT_SHORTEST = 2e-4  # s, however stiff the rod
_REPORT_ROD_TURN = 0.25  # rad
_REPORT_SHORTEST = 1e-4  # s
_UNSTABLE = 2.5  # rad in one step; the method diverges beyond 2.8
_LARGEST = 700.0  # logarithm near that of the largest number
_MOST_CONTACT_SUBSTEPS = 40
_LEAST_RANGE = 1e-6  # rad: for a shorter presliding range steps are not shortened further


def whole_steps(sample_rate: float) -> float:
    """The longest usual step that divides the sample interval.

    Args:
        sample_rate: Hz.

    Returns:
        At most one in `USUAL_RATE`, s.
    """
    return 1.0 / (sample_rate * max(1, ceil(USUAL_RATE / sample_rate)))


def fit_substeps(run: RunSettings, interval: float) -> int:
    """How many steps the fits take from one block mean to the next.

    Args:
        run: the run's physics, effects included.
        interval: between block means, s.

    Returns:
        One or more.
    """
    body = sqrt(run.spring_stiffness / run.yaw_inertia)
    longest = min(_FIT_STEP, _FIT_BODY_TURN / max(body, 1e-9))
    if run.rod_twist is not None:
        rod = run.rod_twist.free_frequency(run.yaw_inertia)
        longest = min(longest, max(ROD_TURN / rod, _FIT_SHORTEST))
    return ceil(interval / longest)


def report_substeps(run: RunSettings, interval: float) -> int:
    """How many steps the prediction that is reported takes from one block mean to the next.

    Args:
        run: the run's physics, effects included.
        interval: between block means, s.

    Returns:
        One or more.
    """
    longest = REPORT_STEP
    if run.rod_twist is not None:
        rod = run.rod_twist.free_frequency(run.yaw_inertia)
        longest = min(REPORT_STEP, max(_REPORT_ROD_TURN / rod, _REPORT_SHORTEST))
    return ceil(interval / longest - 1e-9)


def for_rod(run: RunSettings) -> RunSettings:
    """The run in steps short enough for its rod's own oscillation; for a rigid rod as it is.

    Args:
        run: with its rod.

    Returns:
        The run with its timestep divided by a whole number, `MOST_SUBSTEPS` at the most.
    """
    return _divided(run, min(MOST_SUBSTEPS, _substeps(_rod_rate(run) * run.timestep, ROD_TURN)))


def for_contact(run: RunSettings) -> RunSettings:
    """The run in steps in which, from a reversal on, the motion covers half the contact's presliding range.

    Args:
        run: with its friction.

    Returns:
        The run with its timestep divided by a whole number.
    """
    reach, friction = (run.parameters.get(name, 0.0) for name in ("presliding", "friction_moment"))
    if reach == 0.0:
        return run
    share = run.rod_twist.inertia_share if run.rod_twist is not None else 1.0
    inertia = share * run.yaw_inertia
    swing = run.spring_stiffness * abs(run.release_angle)
    swing += sqrt(run.spring_stiffness * inertia) * abs(run.release_rate)
    acceleration = max(swing, friction) / inertia
    step = sqrt(max(reach, _LEAST_RANGE) / acceleration)
    return _divided(run, min(_MOST_CONTACT_SUBSTEPS, max(1, ceil(run.timestep / step))))


def follow_fastest(rig: Rig, run: RunSettings) -> RunSettings:
    """The run in steps short enough for the fastest motion present, as it is where they are.

    Args:
        rig: gives the reference sizes.
        run: the run's physics, effects included.

    Returns:
        The run with its timestep divided by a whole number.

    Raises:
        TunnelError: when the steps would be shorter than `LEAST_STEP`.
    """
    body, rod = body_rate(rig, run), _rod_rate(run)
    number = max(_substeps(body * run.timestep, BODY_TURN), _substeps(rod * run.timestep, ROD_TURN))
    if number > 1 and run.timestep / number < LEAST_STEP:
        raise _too_fast(run, body, rod)
    return _divided(run, number)


def check_stable(rig: Rig, run: RunSettings) -> None:
    """Refuse steps in which the integration would diverge or damp a motion away.

    Args:
        rig: gives the reference sizes.
        run: the run's physics.

    Raises:
        TunnelError: when the steps are too long.
    """
    body, rod = body_rate(rig, run), _rod_rate(run)
    if max(body, rod) * run.timestep > _UNSTABLE:
        raise _too_fast(run, body, rod)


def body_rate(rig: Rig, run: RunSettings) -> float:
    """The fastest rate of the body on its spring: the larger of both roots' sizes, with or without the wind.

    Terms that stiffen or dampen with the angle count with their slope at the release.

    Args:
        rig: gives the reference sizes.
        run: the run's physics.

    Returns:
        rad/s.
    """
    inertia, law = run.yaw_inertia, run.parameters
    spring = _spring(run)
    swing = abs(run.release_angle) * sqrt(spring / inertia) + abs(run.release_rate)
    damping = run.mechanical_damping + abs(law.get("loss_factor", 0.0)) * sqrt(run.spring_stiffness * inertia)
    damping += _slope(run, "quadratic_damping", 2.0, swing, 2.0)
    still = _largest_root(spring, damping, inertia)
    wind = run.series.get("wind_speed")
    flow = {
        "air_density": run.air_density,
        "wind_speed": max(wind.values) if wind is not None else run.wind_speed,
        "frontal_area": rig.body.frontal_area,
        "reference_length": rig.body.length,
    }
    if flow["wind_speed"] == 0.0:
        return still
    angle = abs(run.release_angle)
    air = aerodynamic_stiffness(run.derivatives.cn_beta, **flow)
    steeper = air * _slope(run, "moment_cubic", 3.0, angle, 0.2)
    exponent = law.get("damping_quadratic_exponent", 0.0)
    thicker = law.get("damping_quadratic", 0.0) * _power(angle, 2.0, exponent, 0.2)
    loss = damping - aerodynamic_damping(run.derivatives.cn_r, **flow) * (1.0 + thicker)
    stiffness = (spring - air, spring - air - steeper, spring - air + steeper)
    return max(still, *(_largest_root(one, loss, inertia) for one in stiffness))


def _spring(run: RunSettings) -> float:
    """Stiffness of spring and gravity at the release, N m/rad."""
    angle = abs(run.release_angle)
    steeper = _slope(run, "stiffness_cubic", 3.0, angle, 0.2) + _slope(
        run, "stiffness_quadratic", 2.0, angle, 0.2
    )
    return run.spring_stiffness * (1.0 + steeper) + abs(run.parameters.get("gravity_stiffness", 0.0))


def _slope(run: RunSettings, name: str, textbook: float, x: float, reference: float) -> float:
    """Size of the slope at x of a term's coefficient times x to the term's power."""
    coefficient = abs(run.parameters.get(name, 0.0))
    if coefficient == 0.0 or x == 0.0:
        return 0.0
    # the air's factor is a power of the angle beside the angle itself: one more
    beside = 1.0 if name == "moment_cubic" else 0.0
    given = run.parameters.get(f"{name}_exponent", 0.0)
    exponent = (given or textbook - beside) + beside
    return coefficient * exponent * _power(x, textbook, exponent, reference) / x


def _power(x: float, textbook: float, exponent: float, reference: float) -> float:
    """X to a power that agrees with the textbook's at the reference; 0 is the textbook's."""
    if x == 0.0:
        return 0.0
    return exp(min(_LARGEST, textbook * log(reference) + (exponent or textbook) * log(x / reference)))


def _largest_root(stiffness: float, damping: float, inertia: float) -> float:
    """Size of the larger root of I s² + C s + K, rad/s."""
    half, square = abs(damping) / (2.0 * inertia), stiffness / inertia
    inside = half * half - square
    return half + sqrt(inside) if inside > 0.0 else sqrt(square)


def _rod_rate(run: RunSettings) -> float:
    """A bound from above on the rod's own frequency, rad/s; 0 for a rigid rod."""
    twist = run.rod_twist
    return 0.0 if twist is None else twist.frequency(run.yaw_inertia, run.spring_stiffness)


def _substeps(turn: float, allowed: float) -> float:
    return max(1, ceil(turn / allowed)) if isfinite(turn) else inf


def _divided(run: RunSettings, number: float) -> RunSettings:
    return run if number <= 1 else dataclasses.replace(run, timestep=run.timestep / number)


def _too_fast(run: RunSettings, body: float, rod: float) -> TunnelError:
    by_rod = rod / ROD_TURN > body / BODY_TURN
    what, rate = ("the rod's own oscillation", rod) if by_rod else ("the body's motion on its spring", body)
    remedy = "give a larger compliance (0 for a rigid rod) or an inertia_share further from 0 and 1"
    if not by_rod:
        remedy = "check spring_stiffness (N m/rad), yaw_inertia (kg m2) and damping"
    return TunnelError(
        f"{what} of {rate / (2.0 * pi):.4g} Hz is too fast for steps of {run.timestep:g} s", remedy=remedy
    )
