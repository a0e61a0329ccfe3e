"""A table of windows, such as the paper's Table III, and its simulation, for the page on the paper's own gap.

The table has damping ratio and natural frequency of one wind-on run, three cycles at a time. In the linear model
both columns are constant; `docs.studies.window_rivals` compares causes of their drift. The paper does not name the
run behind its table: `RigState` is an inference, see `tunnel_lab.paper.networks.infer_springs`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, radians

import numpy as np
from scipy.interpolate import CubicSpline

from identification.datasets import WindowRow, paper_derivatives
from identification.signal.decay_fit import Reading, fit_run
from identification.signal.free_decay import Decay
from tunnel_sim.effects import Effect, EffectChain
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.physics.steps import REPORT_STEP
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import AeroDerivatives, aerodynamic_damping, aerodynamic_stiffness
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Rig

CYCLES = 3
_POINTS = 100  # number of points per window, as for the paper's first network
_RATE = 250.0  # Hz of the simulated reading
_TREND = 2  # degree of the smooth trend; its residual is the table's scatter


@dataclass(frozen=True)
class RigState:
    """The rig in the run behind a table: assumed, not stated by the paper.

    Args:
        spring_stiffness: Kr, N m/rad.
        wind_speed: V, m/s; 0 is wind-off.
        derivatives: Cnβ and Cnr, 1/rad.
        release_angle: release angle, rad. It only scales severities (a cubic one as its inverse square), except
            for effects with a characteristic angle.
        air_density: ρ, kg/m³.
    """

    spring_stiffness: float
    wind_speed: float
    derivatives: AeroDerivatives
    release_angle: float = radians(20.0)
    air_density: float = 1.204


@dataclass(frozen=True, eq=False)
class Columns:
    """Both columns of a table.

    Args:
        zeta: damping ratio, shape (windows,).
        omega_n: natural frequency, shape (windows,), rad/s.
    """

    zeta: Array
    omega_n: Array


def rig_state(spring: int = 5, wind_speed: float = 10.0, release_angle: float = radians(20.0)) -> RigState:
    """The state assumed behind Table III; the defaults agree with `infer_springs`, and 20° is a guess.

    Args:
        spring: number in Table II.
        wind_speed: m/s.
        release_angle: rad.
    """
    rig, printed = load_rig(), paper_derivatives()[0]
    derivatives = AeroDerivatives(printed.cn_beta_per_rad, printed.cn_r_per_rad)
    return RigState(rig.spring(spring), wind_speed, derivatives, release_angle, rig.air.density)


def read_table(table: Sequence[WindowRow]) -> tuple[Columns, Columns]:
    """A table's columns and their scatter.

    Args:
        table: rows in the order of time.

    Returns:
        Values and standard deviations. The scatter is the residual of a quadratic in the window's number, and is
        itself known only to √(1/2ν), with ν = windows − 3.

    Raises:
        TunnelError: when there are fewer than six rows.
    """
    if len(table) < 6:
        raise TunnelError(
            f"a table of {len(table)} windows", remedy="give six or more, to estimate a scatter"
        )
    second = [row.omega_n_second_reading_rad_per_s for row in table]
    pairs = [
        (r.omega_n_rad_per_s, r.omega_n_rad_per_s if s is None else s)
        for r, s in zip(table, second, strict=True)
    ]
    readings = np.array(pairs)
    values = Columns(np.array([row.zeta for row in table]), readings.mean(axis=1))
    spread = 0.5 * np.abs(readings[:, 1] - readings[:, 0])
    std_omega = np.sqrt(_scatter(values.omega_n) ** 2 + spread**2)
    return values, Columns(np.full(len(table), _scatter(values.zeta)), std_omega)


def _scatter(column: Array) -> float:
    place = np.arange(column.size)
    residual = column - np.polyval(np.polyfit(place, column, _TREND), place)
    return float(np.sqrt(residual @ residual / freedom(column.size)))


def freedom(windows: int) -> int:
    """Degrees of freedom behind a column's scatter: windows minus the trend's coefficients."""
    return windows - _TREND - 1


def simulate_windows(
    state: RigState,
    effects: Sequence[Effect],
    omega_n: float,
    zeta: float,
    count: int,
    *,
    base: RigState | None = None,
) -> Columns | None:
    """Simulate a release and window its reading as the paper did.

    Args:
        effects: effects to add to the linear model; none with a random part, because one table is a single draw.
        omega_n: base natural frequency in the state ``base``, rad/s.
        zeta: base damping ratio there.
        count: number of consecutive windows of three cycles from the release on.
        base: the state of the base ωn and ζ; None: ``state`` itself.

    Returns:
        Both columns; None if the motion does not oscillate through all windows.

    Raises:
        TunnelError: when an effect has a random part.
    """
    rig = load_rig()
    inertia, mechanical = base_dynamics(state if base is None else base, omega_n, zeta, rig)
    stated = RunSettings(
        spring_stiffness=state.spring_stiffness,
        derivatives=state.derivatives,
        yaw_inertia=inertia,
        mechanical_damping=mechanical,
        wind_speed=state.wind_speed,
        air_density=state.air_density,
        release_angle=state.release_angle,
        duration=round(1.1 * count * CYCLES * 2.0 * pi / omega_n * _RATE) / _RATE,
        timestep=REPORT_STEP,
    )
    chain = EffectChain(stated, tuple(effects), (None,) * len(effects))
    try:
        motion = forward_motion(rig, chain.physics(), _RATE)
    except ValueError:  # grows without bound
        return None
    reading = chain.reading(chain.angle(motion.angle, motion.time_s))
    curve, begin = CubicSpline(motion.time_s, reading), 0.0
    decay = _first_guess(motion.time_s, reading, zeta)
    rows: list[Decay] = []
    for place in range(-1, count):  # the first window twice: the length of its guess may be wrong
        decay = None if decay is None else _window(curve, begin, decay)
        if decay is None:
            return None
        if place >= 0:
            rows.append(decay)
            begin += _length(decay)
    return Columns(np.array([row.zeta for row in rows]), np.array([row.omega_n for row in rows]))


def base_dynamics(state: RigState, omega_n: float, zeta: float, rig: Rig) -> tuple[float, float]:
    """Inertia and mechanical damping that give a base ωn and ζ with the air as printed.

    Args:
        omega_n: rad/s, with the wind on.
        zeta: damping ratio, with the wind on.

    Returns:
        Izz in kg m² and Cr in N m s/rad.
    """
    air = rig.body.flow(state.air_density, state.wind_speed)
    inertia = (state.spring_stiffness - aerodynamic_stiffness(state.derivatives.cn_beta, **air)) / omega_n**2
    return inertia, 2.0 * zeta * omega_n * inertia + aerodynamic_damping(state.derivatives.cn_r, **air)


def _length(decay: Decay) -> float:
    return CYCLES * 2.0 * pi / decay.omega_d


def _window(curve: CubicSpline, begin: float, decay: Decay) -> Decay | None:
    own = np.linspace(0.0, _length(decay), _POINTS)
    if begin + own[-1] > curve.x[-1]:
        return None
    with np.errstate(invalid="ignore"):  # a body at rest fits no decay, and the fit reports it
        fit = fit_run(Reading(own, np.asarray(curve(begin + own))), decay)
    return fit.runs[0].decay if fit.runs and fit.runs[0].decay.omega_d > 0.0 else None


def _first_guess(time: Array, reading: Array, zeta: float) -> Decay | None:
    """A decay of the mean frequency of the upward crossings, which is independent of an offset."""
    upward = np.flatnonzero(np.diff(np.signbit(reading - reading.mean()).astype(int)) < 0)
    if upward.size < CYCLES:
        return None
    mean = 2.0 * pi * (upward.size - 1) / float(time[upward[-1]] - time[upward[0]])
    return Decay.from_modal(mean, zeta)
