"""How long an integration step may be; no other module decides it.

With the classical Runge–Kutta method of order 4 and steps h, the amplitude of an undamped oscillation of
angular frequency ω falls by (ωh)⁶/144 per step, and its phase lags by (ωh)⁵/120: a spurious damping ratio of
(ωh)⁵/144 and a relative frequency error of −(ωh)⁴/120. The phase angle per step is limited for the body on
its spring (`FREQUENCY_ERROR`), for a flexible rod's own mode to half a radian, and for any mode to
`_UNSTABLE`.

Fits predict thousands of runs: their steps are longer (`fit_substeps`) and make up for their own error
(`compensated`). What is reported is predicted once more in shorter steps (`report_substeps`). Steps are only
divided by whole numbers, so that a sample interval remains a whole number of steps.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from math import ceil, exp, inf, isfinite, log, pi, sqrt

from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import aerodynamic_damping, aerodynamic_stiffness
from tunnel_sim.vocabulary.rig import Rig

#: Greatest relative error of the body's frequency due to integration; the damping ratio is then wrong by 9e-8.
FREQUENCY_ERROR = 1e-6
#: Phase angle of the body's oscillation per step that causes this error, rad.
BODY_TURN = (120.0 * FREQUENCY_ERROR) ** 0.25
#: Greatest phase angle of the rod's own mode per step, rad.
ROD_TURN = 0.5
#: Greatest number by which a step is divided: a run then takes hundreds of times the usual time and memory.
MOST_SUBSTEPS = 320
USUAL_RATE = 1000.0  # steps per second where no faster motion asks for more
#: Shortest step, s; by a rounding less than `MOST_SUBSTEPS` of the usual one.
LEAST_STEP = 0.999 / (USUAL_RATE * MOST_SUBSTEPS)

#: Longest step of what is reported, s.
REPORT_STEP = 2e-3

_FIT_STEP = 8.75e-3  # s: a body at the 2 Hz to which the fits scale time turns by `_FIT_BODY_TURN`
_FIT_BODY_TURN = 0.11  # rad: once `compensated`, some 1e-6 rad over 10 s
_FIT_MOST_STRIDE = 3  # block means per step
#: Parameters of moments that a long step of a fit does not follow: kinks, and a spring that is not linear.
_ROUGH = ("friction_moment", "free_play", "gravity_stiffness")
_FIT_KINKED_TURN = 0.055  # rad: where the spring has a kink, which leaves an error of second order
_FIT_SHORTEST = 2e-4  # s, however stiff the rod
_FIT_MOST_TURN = pi  # rad from one block mean to the next: no record shows a faster oscillation
_REPORT_ROD_TURN = 0.25  # rad
_REPORT_SHORTEST = 1e-4  # s
_UNSTABLE = 2.5  # rad per step; the method diverges beyond 2.8
_LARGEST = 700.0  # logarithm of nearly the largest float
_MOST_CONTACT_SUBSTEPS = 40
_LEAST_RANGE = 1e-6  # rad: a shorter presliding range does not shorten the steps further


def whole_steps(sample_rate: float) -> float:
    """The longest step, s, at most 1/`USUAL_RATE`, that divides the sample interval of a rate in Hz."""
    return 1.0 / (sample_rate * max(1, ceil(USUAL_RATE / sample_rate)))


def fit_substeps(run: RunSettings, interval: float) -> int:
    """How many steps the fits take from one block mean to the next.

    A fit may try a body that turns more than half a turn between block means. Such a body is not followed: the
    steps are too long for it, and its motion decays at once or grows without bound.

    Args:
        interval: between block means, s.
    """
    body = sqrt(run.spring_stiffness / run.yaw_inertia)
    turn = _FIT_KINKED_TURN if run.parameters.get("free_play") else _FIT_BODY_TURN
    longest = min(_FIT_STEP, turn / min(max(body, 1e-9), _FIT_MOST_TURN / interval))
    if run.rod_twist is not None:
        rod = run.rod_twist.free_frequency(run.yaw_inertia)
        longest = min(longest, max(ROD_TURN / rod, _FIT_SHORTEST))
    return ceil(interval / longest)


def fit_stride(rig: Rig, run: RunSettings, interval: float) -> int:
    """How many block means one step of a fit covers; the motion between its ends is cubic.

    The rod is rigid. 1 where a moment has a kink, is sampled, or is not mostly linear.

    Args:
        interval: between block means, s.
    """
    if run.series or run.program or any(run.parameters.get(name) for name in _ROUGH):
        return 1
    turn = max(body_rate(rig, run) * interval, 1e-9)
    return max(1, min(_FIT_MOST_STRIDE, int(_FIT_BODY_TURN / turn)))


def compensated(law: Mapping[str, float], wind_speed: float, step: float) -> tuple[dict[str, float], float]:
    """The moment law and the step with which the method's leading errors in a linear oscillation vanish.

    Per step h the method turns a root λ by λh − (λh)⁵/120 + (λh)⁶/144. For an oscillation that decays slowly, at
    the rate σ, this is ωh (1 − (ωh)⁴/120): the step is made longer by that share. The decay is then
    σ (1 − (ωh)⁴/30) + ω (ωh)⁵/144, and the damper makes up for both. What is left is of the order (ωh)⁵.

    Args:
        wind_speed: m/s.
        step: h, s.
    """
    inertia = law["yaw_inertia"]
    flow = {name: law[name] for name in ("air_density", "frontal_area", "reference_length")}
    stiffness = law["spring_stiffness"] - aerodynamic_stiffness(law["cn_beta"], wind_speed=wind_speed, **flow)
    damping = law["mechanical_damping"] - aerodynamic_damping(law["cn_r"], wind_speed=wind_speed, **flow)
    rate = sqrt(max(0.0, stiffness) / inertia)
    turn = min(rate * step, _FIT_BODY_TURN)  # a body too fast for the steps is not followed
    more = damping * turn**4 / 30.0 - inertia * rate * turn**5 / 72.0
    return {**law, "mechanical_damping": law["mechanical_damping"] + more}, step * (1.0 + turn**4 / 120.0)


def report_substeps(run: RunSettings, interval: float) -> int:
    """How many steps the prediction that is reported takes from one block mean to the next.

    Args:
        interval: between block means, s.
    """
    longest = REPORT_STEP
    if run.rod_twist is not None:
        rod = run.rod_twist.free_frequency(run.yaw_inertia)
        longest = min(REPORT_STEP, max(_REPORT_ROD_TURN / rod, _REPORT_SHORTEST))
    return ceil(interval / longest - 1e-9)


def for_rod(run: RunSettings) -> RunSettings:
    """The run with steps short enough for its rod's own oscillation; unchanged if the rod is rigid."""
    return _divided(run, min(MOST_SUBSTEPS, _substeps(_rod_rate(run) * run.timestep, ROD_TURN)))


def for_contact(run: RunSettings) -> RunSettings:
    """The run with steps in which the motion after a reversal covers at most half the presliding range."""
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
    """The run with steps short enough for its fastest motion; refused where they are below `LEAST_STEP`."""
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
    """The fastest rate of the body on its spring, rad/s, with or without wind, at the slopes of the release."""
    inertia, law = run.yaw_inertia, run.parameters
    angle = abs(run.release_angle)
    # stiffness of spring and gravity at the release
    steeper = _slope(run, "stiffness_cubic", 3.0, angle, 0.2)
    steeper += _slope(run, "stiffness_quadratic", 2.0, angle, 0.2)
    spring = run.spring_stiffness * (1.0 + steeper) + abs(law.get("gravity_stiffness", 0.0))
    swing = angle * sqrt(spring / inertia) + abs(run.release_rate)
    damping = run.mechanical_damping + abs(law.get("loss_factor", 0.0)) * sqrt(run.spring_stiffness * inertia)
    damping += _slope(run, "quadratic_damping", 2.0, swing, 2.0)
    still = _largest_root(spring, damping, inertia)
    wind = run.series.get("wind_speed")
    fastest = max(wind.values) if wind is not None else run.wind_speed
    if fastest == 0.0:
        return still
    flow = rig.body.flow(run.air_density, fastest)
    air = aerodynamic_stiffness(run.derivatives.cn_beta, **flow)
    steeper = air * _slope(run, "moment_cubic", 3.0, angle, 0.2)
    exponent = law.get("damping_quadratic_exponent", 0.0)
    thicker = law.get("damping_quadratic", 0.0) * _power(angle, 2.0, exponent, 0.2)
    loss = damping - aerodynamic_damping(run.derivatives.cn_r, **flow) * (1.0 + thicker)
    stiffness = (spring - air, spring - air - steeper, spring - air + steeper)
    return max(still, *(_largest_root(one, loss, inertia) for one in stiffness))


def _slope(run: RunSettings, name: str, textbook: float, x: float, reference: float) -> float:
    """Magnitude of the slope at x of a power term."""
    coefficient = abs(run.parameters.get(name, 0.0))
    if coefficient == 0.0 or x == 0.0:
        return 0.0
    # the aerodynamic factor multiplies the angle itself, which adds one to the exponent
    beside = 1.0 if name == "moment_cubic" else 0.0
    given = run.parameters.get(f"{name}_exponent", 0.0)
    exponent = (given or textbook - beside) + beside
    return coefficient * exponent * _power(x, textbook, exponent, reference) / x


def _power(x: float, textbook: float, exponent: float, reference: float) -> float:
    """X to a power, scaled to agree with the textbook power at the reference; exponent 0: textbook power."""
    if x == 0.0:
        return 0.0
    return exp(min(_LARGEST, textbook * log(reference) + (exponent or textbook) * log(x / reference)))


def _largest_root(stiffness: float, damping: float, inertia: float) -> float:
    """Magnitude of the larger root of I s² + C s + K, rad/s."""
    half, square = abs(damping) / (2.0 * inertia), stiffness / inertia
    inside = half * half - square
    return half + sqrt(inside) if inside > 0.0 else sqrt(square)


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
    what, rate = ("the rod's own oscillation", rod) if by_rod else ("the body's motion on its spring", body)
    remedy = "give a larger compliance (0 for a rigid rod) or an inertia_share further from 0 and 1"
    if not by_rod:
        remedy = "check spring_stiffness (N m/rad), yaw_inertia (kg m2) and damping"
    return TunnelError(
        f"{what} at {rate / (2.0 * pi):.4g} Hz is too fast for steps of {run.timestep:g} s", remedy=remedy
    )
