"""Stiff springs against the closed form: frequency and damping as accurate as `tunnel_sim.physics.steps` states.

Truth: the solution of Izz β̈ + (Cr − Ca) β̇ + (Kr − Ka) β = 0, and for the steps themselves RK4's own amplification.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.analytic.decay_oracle import AREA, LENGTH, closed_form
from tunnel_sim.engine.simulate import simulate, simulate_motions
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.physics.steps import BODY_TURN, FREQUENCY_ERROR
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import (
    AeroDerivatives,
    SensorModel,
    aerodynamic_damping,
    aerodynamic_stiffness,
)

RIG = load_rig()
AIR = AeroDerivatives(0.35, -0.7)
FLOW = {"air_density": 1.2, "wind_speed": 20.0, "frontal_area": AREA, "reference_length": LENGTH}
PLAIN = RunSettings(16.12, AIR, 0.1014, 0.018, release_angle=0.3, duration=2.0)
GUST = {"air_density": 1.2, "wind_speed": 20.0}


def _exact(run: RunSettings, time: np.ndarray) -> np.ndarray:
    flow = {**FLOW, "wind_speed": run.wind_speed}
    stiffness = run.spring_stiffness - aerodynamic_stiffness(run.derivatives.cn_beta, **flow)
    damping = run.mechanical_damping - (
        aerodynamic_damping(run.derivatives.cn_r, **flow) if run.wind_speed > 0.0 else 0.0
    )
    return closed_form(time, run.release_angle, stiffness, damping, run.yaw_inertia)


@pytest.mark.parametrize("sample_rate", [100.0, 500.0, 1000.0])
@pytest.mark.parametrize(
    "stiffness", [16.12, 1.5e3, 1e4, *(pytest.param(k, marks=pytest.mark.slow) for k in (1e5, 1e6))]
)
@pytest.mark.parametrize("wind", [{}, GUST], ids=["still", "wind"])
def test_phase_and_decay_stay_within_the_stated_error(
    stiffness: float, sample_rate: float, wind: dict[str, float]
) -> None:
    run = replace(PLAIN, spring_stiffness=stiffness, mechanical_damping=0.005 * np.sqrt(stiffness), **wind)
    (motion,) = simulate_motions(RIG, [run], sample_rate)
    exact = _exact(run, motion.time_s)
    # the phase errs by at most this share of the turns made, the angle by that of what is left of the amplitude
    turned = np.sqrt(stiffness / run.yaw_inertia) * motion.time_s
    damping = run.mechanical_damping / (2.0 * run.yaw_inertia)
    left = run.release_angle * np.exp(-damping * motion.time_s)
    assert np.all(np.abs(motion.angle - exact) <= 1.2 * FREQUENCY_ERROR * left * turned + 1e-8)


def test_undamped_oscillation_keeps_its_amplitude() -> None:
    run = replace(PLAIN, spring_stiffness=1e5, mechanical_damping=0.0, derivatives=AeroDerivatives(0.0, 0.0))
    quiet = SensorModel(1000.0, 0.0, 0.0)
    record = simulate(RIG, run, quiet, np.random.default_rng(0))
    omega = np.sqrt(run.spring_stiffness / run.yaw_inertia)
    wave = np.exp(1j * omega * record.time_s)
    late = record.time_s > 1.5
    amplitude = 2.0 * np.abs(np.mean((record.yaw_rad * wave)[late]))
    lost = np.exp(-omega * 1.75 * BODY_TURN**5 / 144.0)  # the damping ratio that the steps add at the most
    assert lost - 2e-3 < amplitude / run.release_angle < 1.0 + 2e-3  # 2e-3: no whole cycles in the mean
    coarse = forward_motion(RIG, run, 1000.0)  # in steps of a millisecond: what was lost in silence
    assert np.max(np.abs(coarse.angle[late])) < 0.8 * run.release_angle


@pytest.mark.parametrize("turn", [0.02, 0.05, BODY_TURN])
def test_the_steps_error_is_that_of_runge_and_kutta(turn: float) -> None:
    step = 1j * turn
    growth = 1 + step + step**2 / 2 + step**3 / 6 + step**4 / 24
    assert 1.0 - abs(growth) == pytest.approx(turn**6 / 144.0, rel=0.01)
    assert turn - np.angle(growth) == pytest.approx(turn**5 / 120.0, rel=0.01)
    assert turn**4 / 120.0 <= FREQUENCY_ERROR * (1.0 + 1e-12)


def test_a_rate_for_which_no_step_is_short_enough_is_refused_in_one_line() -> None:
    with pytest.raises(
        TunnelError, match=r"run 2: the body's motion on its spring at .* Hz is too fast"
    ) as no:
        simulate_motions(RIG, [PLAIN, replace(PLAIN, spring_stiffness=1e9)], 1000.0)
    assert "\n" not in str(no.value)
    assert "spring_stiffness" in str(no.value)
