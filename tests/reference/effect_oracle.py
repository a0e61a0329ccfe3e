"""What the sensor would read with one effect of the vocabulary, written from its equation and solved by SciPy.

Nothing here is shared with the effects or the moment law. The linear rig under a sampled forcing is advanced
exactly (first-order hold); all else is integrated to 1e-11, stopping where friction reverses or the dead zone
ends, and starting again there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import exp, hypot, log, pi, sin, sqrt, tanh
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from tests.reference.linear_rig import response

AREA, LENGTH, WIDTH = 0.036, 0.625, 0.225  # m2, m, m: Table I
INERTIA, DAMPING = 0.1014, 0.018  # kg m2, N m s/rad
CN_BETA, CN_R, DENSITY = 0.4719, -0.1033, 1.204  # 1/rad, 1/rad, kg/m3
MEAN_SPEED = 15.0  # m/s, of the runs of the campaign
ROD_DAMPING_RATIO = 0.01

Parameters = Mapping[str, float]
Moment = Callable[[float, float, float], float]  # of time, angle and rate
NOTHING: dict[str, float] = {}


@dataclass(frozen=True)
class Setting:
    """One run: N m/rad, m/s, rad, s."""

    spring: float = 16.12
    speed: float = 20.0
    release: float = 0.3
    duration: float = 3.0
    sample_rate: float = 1000.0

    @property
    def times(self) -> np.ndarray:
        return np.arange(round(self.duration * self.sample_rate)) / self.sample_rate


def driven_reading(
    time: np.ndarray, values: np.ndarray, delay: float, run: Setting, *, held: bool
) -> np.ndarray:
    """The reading of the linear rig under a moment that acts ``delay`` s later than its stamps, rad.

    Every piece between two kinks of the delayed moment is integrated by itself.
    """
    stiffness = pressure(run.speed) * CN_BETA - run.spring
    damping = air_damping(run.speed) - DAMPING
    kinks = time + delay
    ends = np.unique(np.r_[0.0, kinks[(kinks > 0.0) & (kinks < run.times[-1])], run.times[-1]])
    state, found = np.array([run.release, 0.0]), np.full(run.times.size, np.nan)
    for start, end in pairwise(ends):
        middle = 0.5 * (start + end) - delay
        last = max(int(np.searchsorted(time, middle)) - 1, 0)

        def moment(t: float, last: int = last) -> float:
            return values[last] if held else float(np.interp(t - delay, time, values))

        def slope(t: float, y: np.ndarray, given: Callable[[float], float] = moment) -> list[float]:
            return [y[1], (stiffness * y[0] + damping * y[1] + given(t)) / INERTIA]

        piece = solve_ivp(slope, (start, end), state, "DOP853", dense_output=True, rtol=1e-11, atol=1e-13)
        within = (run.times >= start) & (run.times <= end)
        found[within], state = piece.sol(run.times[within])[0], piece.y[:, -1]
    return found


def pressure(speed: float) -> float:
    """½ρV²Al, N m."""
    return 0.5 * DENSITY * speed**2 * AREA * LENGTH


def air_damping(speed: float) -> float:
    """Ca, N m s/rad."""
    return 0.5 * DENSITY * speed * AREA * LENGTH**2 * CN_R


def reading(name: str, p: Parameters, run: Setting, *, own: float = 0.0) -> np.ndarray:
    """The reading without zero, noise and rounding, rad, at the run's sample times.

    `own` is what the run has drawn: the phase of a periodic effect, or how many standard deviations a number of the
    run lies from what is stated. Random moments have a function of their own.
    """
    if name in SENSOR:
        return SENSOR[name](reading("", NOTHING, run), p, run, own)
    if name == "coulomb_friction":
        if p.get("presliding", 0.0) > 0.0:
            return _with_presliding(p["friction_moment"], p["presliding"], run)
        return _with_friction(p, run)
    if name == "free_play":
        return _with_free_play(p["half_width"], run)
    if name == "rod_flexibility":
        return _two_masses(p, run)
    if name == "unsteady_aero_lag":
        return _with_lag(p["lag"], run)
    return _smooth(_total(name, p, run, own), run)


def under_moment(moment: np.ndarray, interval: float, run: Setting) -> np.ndarray:
    """The reading of the linear rig under a sampled moment in N m, linear between its samples, rad."""
    stiffness = run.spring - pressure(run.speed) * CN_BETA
    damping = DAMPING - air_damping(run.speed)
    assert interval * run.sample_rate == 1.0  # its samples are the sensor's
    return response(moment, interval, INERTIA, damping, stiffness, run.release)[: run.times.size]


def nominal(spring: float, speed: float, damping: float = DAMPING) -> Moment:
    """All moments of the nominal model on the right-hand side, N m."""
    ka, ca = pressure(speed) * CN_BETA, air_damping(speed)
    return lambda _, b, r: (ka - spring) * b + (ca - damping) * r


def _total(name: str, p: Parameters, run: Setting, own: float) -> Moment:
    """All moments of a rigid rig with a smooth law."""
    if name in BETWEEN_RUNS:
        return BETWEEN_RUNS[name](1.0 + p["spread"] * own, run)
    if name in OTHER_CONDITIONS:
        return OTHER_CONDITIONS[name](p, run)
    base = nominal(run.spring, run.speed)
    if name == "":
        return base
    added = ADDED[name](p, run, own)
    return lambda t, b, r: base(t, b, r) + added(t, b, r)


def _structural(p: Parameters, run: Setting, _phase: float) -> Moment:
    viscous = p["loss_factor"] * run.spring / sqrt(run.spring / INERTIA)
    return lambda _t, _b, r: -viscous * r


def _shedding(p: Parameters, run: Setting, phase: float) -> Moment:
    angular = 2.0 * pi * p["strouhal_number"] * run.speed / WIDTH
    return lambda t, _b, _r: p["amplitude"] * pressure(run.speed) * sin(angular * t + phase)


def _ka(run: Setting) -> float:
    return pressure(run.speed) * CN_BETA


def _other_spring(p: Parameters, run: Setting) -> Moment:
    hit = abs(p["spring_stiffness"] - run.spring) < 1e-6
    return nominal(run.spring * (1.0 + p["error"]) if hit else run.spring, run.speed)


# What an effect adds to the nominal moments.
ADDED: dict[str, Callable[[Parameters, Setting, float], Moment]] = {
    "quadratic_damping": lambda p, _run, _: lambda _t, _b, r: -p["coefficient"] * abs(r) * r,
    "structural_damping": _structural,
    "cubic_stiffness": lambda p, run, _: lambda _t, b, _r: -p["coefficient"] * run.spring * b**3,
    "asymmetric_stiffness": lambda p, run, _: lambda _t, b, _r: -p["coefficient"] * run.spring * b**2,
    "gravity_stiffness": lambda p, _run, _: lambda _t, b, _r: -p["stiffness"] * sin(b - p["rest_angle"]),
    "nonlinear_yaw_moment": lambda p, run, _: lambda _t, b, _r: _ka(run) * p["coefficient"] * b**3,
    "nonlinear_yaw_damping": lambda p, run, _: (
        lambda _t, b, r: air_damping(run.speed) * p["coefficient"] * b**2 * r
    ),
    "reynolds_dependence": lambda p, run, _: (
        lambda _t, b, _r: _ka(run) * p["per_e_fold"] * log(run.speed / MEAN_SPEED) * b
    ),
    "flow_misalignment": lambda p, run, _: lambda _t, _b, _r: _ka(run) * p["angle"],
    "vortex_shedding": _shedding,
}
# The nominal moments at another spring or wind than stated.
OTHER_CONDITIONS: dict[str, Callable[[Parameters, Setting], Moment]] = {
    "wind_speed_drift": lambda p, run: (
        lambda t, b, r: nominal(run.spring, run.speed * (1.0 + p["drift"] * t / run.duration))(t, b, r)
    ),
    "wind_speed_offset": lambda p, run: nominal(run.spring, run.speed + p["offset"]),
    "spring_miscalibration": _other_spring,
}
# The nominal moments where a number of the run is so many times as great as stated.
BETWEEN_RUNS: dict[str, Callable[[float, Setting], Moment]] = {
    "wind_speed_scatter": lambda factor, run: nominal(run.spring, run.speed * factor),
    "stiffness_scatter": lambda factor, run: nominal(run.spring * factor, run.speed),
    "damping_scatter": lambda factor, run: nominal(run.spring, run.speed, DAMPING * factor),
}


def _solve(
    derivative: Callable[[float, Any], Any],
    y0: Sequence[float],
    run: Setting,
    *,
    start: float = 0.0,
    events: Sequence[Any] = (),
) -> Any:
    return solve_ivp(
        derivative, (start, float(run.times[-1])), y0, method="DOP853", rtol=1e-11, atol=1e-14,
        max_step=0.02, events=events or None, dense_output=True,
    )  # fmt: skip


def _crossing(index: int, value: float, direction: float) -> Any:
    """An event that ends a leg where a state passes a value in a direction."""

    def event(_: float, y: np.ndarray) -> float:
        return float(y[index] - value)

    marked: Any = event
    marked.terminal, marked.direction = True, direction
    return marked


def _smooth(moment: Moment, run: Setting) -> np.ndarray:
    leg = _solve(lambda t, y: (y[1], moment(t, y[0], y[1]) / INERTIA), (run.release, 0.0), run)
    return np.asarray(leg.sol(run.times)[0])


def _with_lag(a: float, run: Setting) -> np.ndarray:
    """τ ẋ = β − x, the body held until the release; for a lead the mirror image of the lag |a|, 2β − x."""
    tau = abs(a) * LENGTH / run.speed
    ka = pressure(run.speed) * CN_BETA
    base = nominal(run.spring, run.speed)

    def derivative(t: float, y: np.ndarray) -> tuple[float, ...]:
        b, r, x = y
        seen = x if a > 0.0 else 2.0 * b - x
        return r, (base(t, b, r) + ka * (seen - b)) / INERTIA, (b - x) / tau

    return np.asarray(_solve(derivative, (run.release, 0.0, run.release), run).sol(run.times)[0])


def _two_masses(p: Parameters, run: Setting) -> np.ndarray:
    """Spring's end (angle e) and body (angle b) as two masses; the sensor reads e."""
    upper, lower = INERTIA * p["inertia_share"], INERTIA * (1.0 - p["inertia_share"])
    rod = 1.0 / p["compliance"]
    viscous = 2.0 * ROD_DAMPING_RATIO * sqrt(rod * upper * lower / (upper + lower))
    ka, ca = pressure(run.speed) * CN_BETA, air_damping(run.speed)

    def derivative(_: float, y: np.ndarray) -> tuple[float, ...]:
        e, er, b, br = y
        twist = rod * (b - e) + viscous * (br - er)
        return er, (-run.spring * e - DAMPING * er + twist) / upper, br, (ka * b + ca * br - twist) / lower

    held = run.release * rod / (rod + run.spring)  # the body is held, the end hangs between rod and spring
    return np.asarray(_solve(derivative, (held, 0.0, run.release, 0.0), run).sol(run.times)[0])


def _sliding(p: Parameters, speed: float) -> float:
    """The moment that friction at a rate without its sign makes."""
    level = p["friction_moment"]
    if p.get("exponent", 0.0) > 0.0:
        level *= (speed / 2.0) ** p["exponent"]
    if p.get("saturation", 0.0) > 0.0:
        level *= tanh(speed / p["saturation"])
    return level * (1.0 + p.get("peak", 0.0) * exp(-((speed / p.get("peak_rate", 0.2)) ** 2)))


def _with_friction(p: Parameters, run: Setting) -> np.ndarray:
    """From reversal to reversal with a constant sign of the rate; at rest for good once friction holds."""
    base, limit = nominal(run.spring, run.speed), _sliding(p, 0.0)
    angle, start, at = np.empty(run.times.size), 0.0, run.release

    while True:
        pull = base(start, at, 0.0)
        here = run.times >= start
        if abs(pull) <= limit:
            angle[here] = at
            return angle
        sign = np.sign(pull)

        def slipping(t: float, y: np.ndarray, way: float = float(sign)) -> tuple[float, float]:
            return y[1], (base(t, y[0], y[1]) - way * _sliding(p, abs(y[1]))) / INERTIA

        leg = _solve(slipping, (at, 0.0), run, start=start, events=[_crossing(1, 0.0, -sign)])
        angle[here] = leg.sol(run.times[here])[0]
        if not leg.t_events[0].size:
            return angle
        start, at = float(leg.t_events[0][0]), float(leg.y_events[0][0][0])


def _with_presliding(limit: float, reach: float, run: Setting) -> np.ndarray:
    """Dahl's friction −Tc z/zs, ż = β̇ − |β̇| z/zs, from reversal to reversal."""
    base = nominal(run.spring, run.speed)
    angle, start, y = np.empty(run.times.size), 0.0, (run.release, 0.0, 0.0)

    while True:
        way = 1.0 if base(start, y[0], 0.0) > limit * y[2] / reach else -1.0

        def yielding(t: float, y: np.ndarray, way: float = way) -> tuple[float, ...]:
            acceleration = (base(t, y[0], y[1]) - limit * y[2] / reach) / INERTIA
            return y[1], acceleration, y[1] - way * y[1] * y[2] / reach

        leg = _solve(yielding, y, run, start=start, events=[_crossing(1, 0.0, -way)])
        here = run.times >= start
        angle[here] = leg.sol(run.times[here])[0]
        if not leg.t_events[0].size:
            return angle
        start = float(leg.t_events[0][0])
        y = (float(leg.y_events[0][0][0]), 0.0, float(leg.y_events[0][0][2]))


def _with_free_play(half: float, run: Setting) -> np.ndarray:
    """From edge to edge of the dead zone, with the law of each zone linear."""
    without = nominal(0.0, run.speed)
    angle, start, y = np.empty(run.times.size), 0.0, (run.release, 0.0)
    zone = 1 if run.release > half else -1 if run.release < -half else 0

    while True:
        leave = (
            [_crossing(0, zone * half, -zone)] if zone else [_crossing(0, half, 1), _crossing(0, -half, -1)]
        )

        def within(t: float, y: np.ndarray, zone: int = zone) -> tuple[float, float]:
            spring = run.spring * (y[0] - zone * half) if zone else 0.0
            return y[1], (without(t, y[0], y[1]) - spring) / INERTIA

        leg = _solve(within, y, run, start=start, events=leave)
        here = run.times >= start
        angle[here] = leg.sol(run.times[here])[0]
        left = [i for i, times in enumerate(leg.t_events) if times.size]
        if not left:
            return angle
        start, y = float(leg.t_events[left[0]][0]), tuple(leg.y_events[left[0]][0])
        zone = 0 if zone else (1, -1)[left[0]]


def _play(angle: np.ndarray, p: Parameters, run: Setting, _phase: float) -> np.ndarray:
    """The play operator on a path 16 times finer than the samples, from a slider the release has pushed out."""
    fine = np.linspace(0.0, run.times[-1], 16 * (run.times.size - 1) + 1)
    leg = _solve(
        lambda t, y: (y[1], nominal(run.spring, run.speed)(t, y[0], y[1]) / INERTIA), (run.release, 0.0), run
    )
    path, w = leg.sol(fine)[0], p["half_width"]
    slider = np.empty_like(path)
    at = path[0] - w * np.sign(path[0])
    for i, b in enumerate(path):
        at = min(max(at, b - w), b + w)
        slider[i] = at
    del angle
    return np.asarray(slider[::16])


SENSOR: dict[str, Callable[[np.ndarray, Parameters, Setting, float], np.ndarray]] = {
    "sensor_nonlinearity": lambda b, p, _run, _phase: b + p["coefficient"] * b**3,
    "sensor_quantisation": lambda b, p, _run, _phase: p["step"] * np.floor(b / p["step"] + 0.5),
    "sensor_hysteresis": _play,
    "sensor_drift": lambda b, p, run, _phase: b + p["drift"] * run.times / run.duration,
    "mains_hum": lambda b, p, run, phase: (
        b + p["amplitude"] * np.sin(2.0 * pi * p["frequency"] * run.times + phase)
    ),
    "sensor_clipping": lambda b, p, _run, _phase: np.minimum(np.maximum(b, -p["limit"]), p["limit"]),
}

#: Random moments, which are compared under the moment that they draw.
RANDOM = ("buffeting", "ambient_vibration")
#: The effects that are solved here; the others are compared with the reference simulator.
SOLVED = {
    *SENSOR, *ADDED, *OTHER_CONDITIONS, *BETWEEN_RUNS, "coulomb_friction", "free_play", "rod_flexibility",
    "unsteady_aero_lag", *RANDOM,
}  # fmt: skip


def fitted_phase(residual: np.ndarray, frequency: float, run: Setting) -> tuple[float, float]:
    """Amplitude and phase of a sine of known frequency in a residual, by least squares."""
    argument = 2.0 * pi * frequency * run.times
    sine, cosine = np.linalg.lstsq(
        np.column_stack([np.sin(argument), np.cos(argument)]), residual, rcond=None
    )[0]
    return hypot(sine, cosine), float(np.arctan2(cosine, sine))
