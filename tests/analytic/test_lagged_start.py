"""The lag's state at the start of a run in motion, against SciPy's integration from the release."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.analytic.law_cases import RIG
from tunnel_sim.physics.lagged_start import lagged_at_start
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.plan import AeroDerivatives
from tunnel_sim.vocabulary.record import Array

SPRING, INERTIA, DAMPING, SPEED, DENSITY, SWING = 30.5, 0.1014, 0.012, 18.0, 1.2, 0.35
CN_BETA, CN_R = 0.49, -0.11
WITHIN, ASTRAY = 2e-3, 2e-2  # of the swing


def run(lag: float, angle: float = SWING, rate: float = 0.0) -> RunSettings:
    air = AeroDerivatives(CN_BETA, CN_R)
    return RunSettings(
        SPRING, air, INERTIA, DAMPING, SPEED, DENSITY, angle, release_rate=rate, parameters={"aero_lag": lag}
    )


def moved(lag: float, begin: Array, times: Array) -> Array:
    """Angle, rate and the lag's state at some times, from those at the first, by the equation of the effect."""
    area, length = RIG.body.frontal_area, RIG.body.length
    air = 0.5 * DENSITY * SPEED**2 * area * length * CN_BETA
    air_damping = 0.5 * DENSITY * SPEED * area * length**2 * CN_R
    constant = abs(lag) * length / SPEED

    def rates(_: float, y: Array) -> list[float]:
        angle, rate, state = y
        seen = state if lag > 0.0 else 2.0 * angle - state
        moment = air * seen - SPRING * angle + (air_damping - DAMPING) * rate
        return [rate, moment / INERTIA, (angle - state) / constant]

    solved = solve_ivp(rates, (times[0], times[-1]), begin, "DOP853", times, rtol=1e-10, atol=1e-12)
    return np.asarray(solved.y, np.float64)


TIMES = np.arange(0.0, 6.0, 0.004)


@pytest.mark.parametrize("start", [10, 40, 150, 700])
@pytest.mark.parametrize("lag", [0.5, 2.0, -1.5])
def test_a_part_of_a_run_moves_like_the_run(lag: float, start: int) -> None:
    whole = moved(lag, np.array([SWING, 0.0, SWING]), TIMES)
    angle, rate, _ = whole[:, start].tolist()
    (state,) = lagged_at_start(run(lag, angle, rate).table, RIG, TIMES[[start]])
    part = moved(lag, np.array([angle, rate, state]), TIMES[start:])
    assert np.abs(part[0] - whole[0, start:]).max() < WITHIN * SWING


def test_the_angle_itself_is_another_state() -> None:
    whole = moved(2.0, np.array([SWING, 0.0, SWING]), TIMES)
    angle, rate, _ = whole[:, 40]
    part = moved(2.0, np.array([angle, rate, angle]), TIMES[40:])
    assert np.abs(part[0] - whole[0, 40:]).max() > ASTRAY * SWING


def test_at_the_release_it_is_the_angle() -> None:
    assert lagged_at_start(run(2.0, rate=0.3).table, RIG, np.zeros(1)).tolist() == [SWING]


@pytest.mark.parametrize(("name", "value"), [("spring_stiffness", 0.0), ("yaw_inertia", np.inf)])
def test_a_law_that_does_not_oscillate_keeps_a_finite_state(name: str, value: float) -> None:
    table = run(2.0).table.copy()
    table[name][0] = value
    assert np.isfinite(lagged_at_start(table, RIG, np.array([0.1]))).all()
