"""Dahl's friction: its exact solution for a motion one way, its limits, and runs through the effect."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.analytic.law_cases import RIG, Case
from tests.marks import slow
from tests.reference.effect_cases import settings
from tests.reference.effect_oracle import Setting, reading
from tests.support.acting import acting
from tunnel_sim.effects import EffectChain, effect_from
from tunnel_sim.engine.model import Model, build_model
from tunnel_sim.engine.simulate import simulate_motion
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.moment_law import state_names
from tunnel_sim.physics.run_settings import RunSettings

SAMPLE_RATE = 500.0

_DEFLECTION = state_names().index("deflection")


def _with_friction(run: RunSettings, moment: float, reach: float) -> RunSettings:
    effect = effect_from("coulomb_friction", {"friction_moment": moment, "presliding": reach})
    return acting(effect, run)


@pytest.mark.parametrize(
    ("moment", "reach", "spring", "speed"),
    [
        (0.004, 0.02, 16.12, 20.0),
        slow(0.03, 0.005, 67.98, 0.0),
        slow(0.4, 0.001, 67.98, 0.0),
        slow(0.05, 3e-4, 67.98, 0.0),  # two forward steps for one
        slow(0.4, 3e-5, 16.12, 20.0),  # three, and two of MuJoCo's
    ],
)
def test_ten_seconds_stay_far_below_the_noise(
    moment: float, reach: float, spring: float, speed: float
) -> None:
    run = Setting(spring, speed, duration=10.0, sample_rate=SAMPLE_RATE)
    expected = reading("coulomb_friction", {"friction_moment": moment, "presliding": reach}, run)
    coarse, fine = (
        _with_friction(replace(settings(run), timestep=step), moment, reach) for step in (2e-3, 1e-3)
    )
    for angle in (
        forward_motion(RIG, coarse, SAMPLE_RATE).angle,
        simulate_motion(build_model(RIG, fine), SAMPLE_RATE).angle,
    ):
        assert np.max(np.abs(angle - expected)) < 2e-5


def test_no_range_is_coulombs_friction_to_the_bit() -> None:
    case = Case("", {"friction_moment": 0.02})
    plain, zero = case.settings(), replace(case, terms={**case.terms, "presliding": 0.0}).settings()
    for run in (forward_motion, lambda rig, s, rate: simulate_motion(build_model(rig, s), rate)):
        assert np.array_equal(run(RIG, plain, SAMPLE_RATE).angle, run(RIG, zero, SAMPLE_RATE).angle)
    assert _with_friction(plain, 0.02, 0.0).timestep == plain.timestep


def test_a_range_without_friction_changes_nothing() -> None:
    nominal, frictionless = (Case("", terms).settings() for terms in ({}, {"presliding": 0.01}))
    one, other = (forward_motion(RIG, s, SAMPLE_RATE).angle for s in (nominal, frictionless))
    assert np.array_equal(one, other)


@pytest.mark.parametrize("reach", [0.05, 0.005])
def test_the_deflection_of_a_motion_one_way_is_exact_at_any_step(reach: float) -> None:
    # the first half cycle has no reversal: z = -zs (1 - exp(-way/zs)), whatever the steps
    run = replace(Case("", speed=0.0).settings(), duration=0.2)
    for step in (1e-3, 1e-2):
        loaded = replace(run, timestep=step, parameters={"friction_moment": 0.02, "presliding": reach})
        model = build_model(RIG, loaded)
        state = _advanced(model, round(0.2 / step))
        way = loaded.release_angle - state[1]
        assert state[2] < 0.0  # still on its way
        assert state[_DEFLECTION] == pytest.approx(reach * np.expm1(-way / reach), rel=1e-12)


def _advanced(model: Model, steps: int) -> np.ndarray:
    data = model.release_state()
    mujoco.mj_step(model.mj, data, steps)
    return np.array(data.plugin_state)


def test_the_deflection_never_leaves_its_range() -> None:
    run = replace(Case("", {"friction_moment": 0.4, "presliding": 0.002}).settings(), release_angle=0.3)
    model = build_model(RIG, run)
    data, seen = model.release_state(), []
    for _ in range(3000):
        mujoco.mj_step(model.mj, data)
        seen.append(data.plugin_state[_DEFLECTION])
    assert 0.0019 < np.max(np.abs(seen)) <= 0.002


def test_a_small_motion_is_a_spring_of_stiffness_tc_over_zs() -> None:
    # within a thousandth of the range z is the angle's own change, and the spring's rest has moved to the release
    moment, reach, release = 2.0, 0.2, 1e-4
    run = replace(Case("", speed=0.0).settings(), release_angle=release, mechanical_damping=0.0, duration=2.0)
    run = replace(run, parameters={"friction_moment": moment, "presliding": reach})
    contact, spring = moment / reach, run.spring_stiffness
    centre = release * contact / (contact + spring)
    omega = np.sqrt((contact + spring) / run.yaw_inertia)
    motion = forward_motion(RIG, run, SAMPLE_RATE)
    expected = centre + (release - centre) * np.cos(omega * motion.time_s)
    assert np.max(np.abs(motion.angle - expected)) < 1e-2 * release


@pytest.mark.parametrize("reach", [1e-12, 1e-8, 1e-6])
@pytest.mark.parametrize("step", [1e-3, 2e-3])
def test_a_range_too_short_for_the_step_stays_stable(reach: float, step: float) -> None:
    # 2 Tc/zs would turn a contact of 1e-8 rad by 9 rad in a step; the rest must come, and near Coulomb's
    terms = {"friction_moment": 0.4, "presliding": reach}
    yielding, rigid = (
        replace(Case("", t, speed=0.0).settings(step), duration=10.0)
        for t in (terms, {"friction_moment": 0.4})
    )
    angle, coulomb = (forward_motion(RIG, run, SAMPLE_RATE).angle for run in (yielding, rigid))
    assert np.max(np.abs(angle - coulomb)) < 2e-3
    assert np.ptp(angle[-500:]) < 2e-5


@pytest.mark.parametrize("reverse", [False, True])
def test_it_goes_together_with_a_twisting_rod_in_either_order(reverse: bool) -> None:
    effects = [
        effect_from("coulomb_friction", {"friction_moment": 0.03, "presliding": 1e-4}),
        effect_from("rod_flexibility", {"compliance": 1e-3, "inertia_share": 0.05}),
    ]
    run = replace(settings(Setting()), duration=3.0)
    ordered = tuple(reversed(effects)) if reverse else tuple(effects)
    run = EffectChain(run, ordered, (None, None)).physics()
    finer = replace(run, timestep=run.timestep / 4)
    one, other = (forward_motion(RIG, r, SAMPLE_RATE).angle for r in (run, finer))
    assert np.max(np.abs(one - other)) < 2e-5
