"""A moment applied by `qfrc_applied`, and friction that holds against it as against any other."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import pytest

from tunnel_sim.engine.model import build_model
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.run_settings import RodTwist, RunSettings
from tunnel_sim.vocabulary.plan import AeroDerivatives

FRICTION = 0.05  # N m
STILL = RunSettings(
    16.12,
    AeroDerivatives(0.0, 0.0),
    0.1014,
    0.05,
    parameters={"friction_moment": FRICTION},
    release_angle=0.0,
)


def angle_under(settings: RunSettings, moment: float, steps: int) -> float:
    model = build_model(load_rig(), settings)
    data = model.release_state()
    data.qfrc_applied[model.yaw_address] = moment
    mujoco.mj_step(model.mj, data, steps)
    return float(data.qpos[model.yaw_address])


@pytest.mark.parametrize("moment", [0.8 * FRICTION, -0.99 * FRICTION])
def test_friction_holds_a_body_at_rest_against_a_smaller_moment(moment: float) -> None:
    assert angle_under(STILL, moment, 1000) == 0.0


@pytest.mark.parametrize("moment", [10.0 * FRICTION, -10.0 * FRICTION])
def test_a_larger_moment_brings_it_to_rest_within_the_band_of_friction(moment: float) -> None:
    rest = STILL.spring_stiffness * angle_under(STILL, moment, 30_000)
    assert abs(rest - moment) <= FRICTION * (1.0 + 1e-9)
    assert rest != pytest.approx(moment, rel=1e-3)  # it came to rest off the balance: friction holds


def test_the_moment_acts_on_the_springs_end_of_a_rod_that_twists() -> None:
    twisting = replace(STILL, parameters={}, rod_twist=RodTwist(1e-3, 0.3), timestep=5e-4)
    assert STILL.spring_stiffness * angle_under(twisting, 0.5, 60_000) == pytest.approx(0.5, rel=1e-3)
