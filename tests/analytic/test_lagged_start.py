"""The lag's state at the start of a run in motion, against the run from its release."""

from __future__ import annotations

import numpy as np
import pytest

from tests.analytic.law_cases import RIG
from tunnel_sim.physics.forward import forward_run, integrate
from tunnel_sim.physics.lagged_start import lagged_at_start
from tunnel_sim.physics.moment_law import parameter_vector
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.plan import AeroDerivatives
from tunnel_sim.vocabulary.record import Array

INTERVAL, SWING = 4e-3, 0.35
WITHIN, ASTRAY = 2e-3, 2e-2  # of the swing


def run(lag: float, angle: float = SWING, rate: float = 0.0) -> RunSettings:
    air = AeroDerivatives(0.49, -0.11)
    return RunSettings(
        30.5, air, 0.1014, 0.012, 18.0, 1.2, angle, release_rate=rate, parameters={"aero_lag": lag}
    )


def integrated(settings: RunSettings, samples: int, lagged: float | None = None) -> tuple[Array, Array]:
    row, keep_alive = forward_run(settings)
    row["steps"], row["step"] = 4, INTERVAL / 4
    row["rate"] = settings.release_rate
    if lagged is not None:
        row["lagged"] = lagged
    angle, rate, status = integrate(parameter_vector(settings.law(RIG))[None], row, samples)
    del keep_alive
    assert status == 0
    return angle[0], rate[0]


@pytest.mark.parametrize("start", [10, 40, 150, 700])
@pytest.mark.parametrize("lag", [0.5, 2.0, -1.5])
def test_a_part_of_a_run_moves_like_the_run(lag: float, start: int) -> None:
    angle, rate = integrated(run(lag), 1500)
    part = run(lag, float(angle[start]), float(rate[start]))
    (state,) = lagged_at_start(part.table, RIG, np.array([start * INTERVAL]))
    followed, _ = integrated(part, 1500 - start, float(state))
    assert np.abs(followed - angle[start:]).max() < WITHIN * SWING


def test_the_angle_itself_is_another_state() -> None:
    angle, rate = integrated(run(2.0), 1500)
    part = run(2.0, float(angle[40]), float(rate[40]))
    followed, _ = integrated(part, 1460)
    assert np.abs(followed - angle[40:]).max() > ASTRAY * SWING


def test_at_the_release_it_is_the_angle() -> None:
    assert lagged_at_start(run(2.0, rate=0.3).table, RIG, np.zeros(1)).tolist() == [SWING]


@pytest.mark.parametrize(("name", "value"), [("spring_stiffness", 0.0), ("yaw_inertia", np.inf)])
def test_a_law_that_does_not_oscillate_keeps_a_finite_state(name: str, value: float) -> None:
    table = run(2.0).table.copy()
    table[name][0] = value
    assert np.isfinite(lagged_at_start(table, RIG, np.array([0.1]))).all()
