"""What an actuator makes of an input. The truth is its equation, integrated by SciPy or in very short steps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis import diagnose, vocabulary
from diagnosis.diagnosable import kinds_for
from diagnosis.model.rig import SpringModel
from tests.marks import slow
from tests.reference.robot_joints import GEAR, robot, robot_campaign
from tests.support.robots import TRUE, own_model
from tests.unit.diagnosis.test_input_delay import DAMPING, DELAY, INERTIA, NOISE, RATE, SPRING, campaign
from tunnel_reference.driven_inputs import exerted, finer
from tunnel_reference.true_conditions import Actuation as Reference
from tunnel_sim.effects import ALL_EFFECTS, EffectChain, effect_class, effect_from
from tunnel_sim.engine.effect_laws import DRIVE, INTEGRATION_TOLERANCE, WIND_ON
from tunnel_sim.engine.model import build_model
from tunnel_sim.engine.simulate import simulate_motion
from tunnel_sim.engine.virtual_campaign import plan_effects
from tunnel_sim.files.plan_file import paper_plan
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.actuator import ActuatorLimits, InputSamples
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.input_kinds import INPUTS
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.plan import EffectSetting
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

STEP = 0.01
TIME = STEP * np.arange(40)
UNEVEN = np.cumsum(np.random.default_rng(3).uniform(0.5, 1.5, 40)) * STEP
VALUES = np.random.default_rng(4).standard_normal(40)
SQUARE = np.sign(np.sin(np.arange(40.0)))
NULL = {"actuator_lag": "lag", "actuator_saturation": "limit", "actuator_rate_limit": "rate"}


def at(given: InputSamples, time: np.ndarray) -> np.ndarray:
    """The value of samples at times."""
    if given.held:
        return given.values[np.maximum(np.searchsorted(given.time_s, time, side="right") - 1, 0)]
    return np.interp(time, given.time_s, given.values)


each_input = pytest.mark.parametrize(
    "values", [VALUES, np.cumsum(VALUES), SQUARE], ids=["noise", "walk", "square"]
)
each_hold = pytest.mark.parametrize("held", [False, True], ids=["linear", "zero"])
each_clock = pytest.mark.parametrize("time", [TIME, UNEVEN], ids=["even", "uneven"])


@each_input
@each_hold
@each_clock
@pytest.mark.parametrize("rate", [10.0, 300.0, 3e4])
def test_a_rate_limit_follows_its_equation(
    values: np.ndarray, held: bool, time: np.ndarray, rate: float
) -> None:
    asked, short = InputSamples(time, values, held), 2e-5
    fine = np.arange(time[0], time[-1], short)
    wanted = at(asked, fine + 0.5 * short)
    steps, most = [float(values[0])], rate * short
    for goal in wanted[:-1].tolist():
        steps.append(steps[-1] + min(max(goal - steps[-1], -most), most))
    exact = np.array(steps)
    found = asked.at_rate(rate)
    assert np.all(np.diff(found.time_s) > 0.0)
    away = np.abs(at(found, fine) - exact)
    steepest = 0.0 if held else float(np.max(np.abs(np.diff(values)) / np.diff(time)))
    if rate > 1e3:  # a jump then lasts for a few of the short steps, which miss its instant by one
        away = away[np.min(np.abs(fine[:, None] - time), axis=1) > 2.0 * short + np.ptp(values) / rate]
    # every corner is missed by a short step, and what is missed adds up until the input is reached
    assert np.max(away) < 10.0 * short * (min(rate, 1e3) + steepest)


@each_input
@each_hold
@each_clock
@pytest.mark.parametrize("limit", [0.3, 0.9, 2.0])
def test_a_greatest_moment_clips_at_every_time(
    values: np.ndarray, held: bool, time: np.ndarray, limit: float
) -> None:
    asked, fine = InputSamples(time, values, held), np.linspace(time[0], time[-1], 5001)
    assert at(asked.clipped(limit), fine) == pytest.approx(np.clip(at(asked, fine), -limit, limit), abs=1e-9)


@each_input
@each_hold
@each_clock
@pytest.mark.parametrize("softness", [0.1, 0.4, 1.0])
def test_a_soft_limit_follows_its_equation(
    values: np.ndarray, held: bool, time: np.ndarray, softness: float
) -> None:
    asked, fine = InputSamples(time, values, held), np.linspace(time[0], time[-1], 5001)
    found, wanted = asked.saturated(0.9, softness), at(asked, fine)
    exact = wanted / (1.0 + np.abs(wanted / 0.9) ** (1.0 / softness)) ** softness
    assert np.max(np.abs(at(found, fine) - exact)) < (1e-12 if held else 1e-3)
    assert np.max(np.abs(found.values)) < 0.9


@each_hold
def test_a_soft_limit_tends_to_a_hard_one(held: bool) -> None:
    asked, fine = InputSamples(TIME, 1e3 * VALUES, held), np.linspace(TIME[0], TIME[-1], 5001)
    hard = at(asked.clipped(300.0), fine)
    away = [float(np.max(np.abs(at(asked.saturated(300.0, s), fine) - hard))) for s in (0.1, 0.05, 0.025)]
    assert away[0] > 1.5 * away[1] > 2.25 * away[2] > 0.0
    assert np.array_equal(at(asked.saturated(300.0, 0.0), fine), hard)


@pytest.mark.parametrize("limit", [0.5, 1e-3, 1e-9])
def test_a_soft_limit_far_below_the_input_adds_samples_at_its_zeros_alone(limit: float) -> None:
    time = np.arange(5000) / 1000.0
    found = InputSamples(time, np.sin(4.0 * np.pi * time), held=False).saturated(limit, 0.4)
    assert np.all(np.diff(found.time_s) > 0.0)
    assert found.time_s.size < 6 * time.size


def test_a_soft_limit_contains_a_hyperbolic_tangent() -> None:
    asked = np.linspace(-1.0, 1.0, 401)
    found = InputSamples(np.arange(401.0), asked, True).saturated(1.133, 0.4755).values
    assert np.max(np.abs(found - np.tanh(asked))) < 1e-3


@pytest.mark.parametrize("limited", [{"limit": 4.0}, {"rate": 1e6}, {}])
def test_a_limit_that_is_not_reached_changes_no_bit(limited: dict[str, float]) -> None:
    asked = InputSamples(TIME, VALUES, held=False)
    assert ActuatorLimits(**limited).exerted(asked, 1.0) is asked


@each_hold
@pytest.mark.parametrize("lag", [2e-3, 0.02, 0.5])
def test_a_lagged_rig_moves_as_scipy_says(held: bool, lag: float) -> None:
    """An input that is white from sample to sample, 40 samples in a period of 0.4 s."""
    run = replace(WIND_ON, duration=0.35, drive=InputMoment(TIME, 3.0 * VALUES, held=held))
    chain = EffectChain(run, (effect_from("actuator_lag", {"lag": lag}),), (None,))
    found = forward_motion(load_rig(), chain.physics(), 1000.0)
    asked, law = InputSamples(TIME, 3.0 * VALUES, held), run.law(load_rig())
    flow = load_rig().body.flow(run.air_density, run.wind_speed)
    pressure = (
        0.5 * flow["air_density"] * flow["wind_speed"] * flow["frontal_area"] * flow["reference_length"]
    )
    stiffness = law["spring_stiffness"] - pressure * flow["wind_speed"] * law["cn_beta"]
    damping = law["mechanical_damping"] - pressure * flow["reference_length"] * law["cn_r"]
    state, exact = np.array([run.release_angle, 0.0, 3.0 * VALUES[0]]), []
    for k in range(35):
        seen = found.time_s[(found.time_s >= TIME[k] - 1e-9) & (found.time_s < TIME[k + 1] - 1e-9)]

        def slope(t: float, y: np.ndarray, k: int = k) -> list[float]:
            part = 0.0 if held else (t - TIME[k]) / STEP
            wanted = asked.values[k] + part * (asked.values[k + 1] - asked.values[k])
            return [
                y[1],
                (y[2] - stiffness * y[0] - damping * y[1]) / law["yaw_inertia"],
                (wanted - y[2]) / lag,
            ]

        part = solve_ivp(
            slope,
            (TIME[k], TIME[k + 1]),
            state,
            "DOP853",
            np.append(seen, TIME[k + 1]),
            rtol=1e-9,
            atol=1e-11,
        )
        exact.append(part.y[0, :-1])
        state = part.y[:, -1]
    moved = np.concatenate(exact)
    # a line for an exponential leaves a third moment in every interval: most where the lag is a fifth of one
    assert np.max(np.abs(found.angle[: moved.size] - moved)) < 1.5e-4


@each_hold
@pytest.mark.parametrize("lag", [2e-3, 4e-3, 0.02])
def test_the_line_that_takes_the_place_of_an_exponential_is_of_third_order(held: bool, lag: float) -> None:
    """The same input in more and more intervals: half of one leaves an eighth of the error."""
    angles = []
    for parts in (1, 2, 8):
        times = np.linspace(0.0, TIME[-1], parts * (TIME.size - 1) + 1)
        values = at(InputSamples(TIME, 3.0 * VALUES, held), times + (1e-9 if held else 0.0))
        run = replace(WIND_ON, duration=0.35, drive=InputMoment(times, values, held=held))
        chain = EffectChain(run, (effect_from("actuator_lag", {"lag": lag}),), (None,))
        angles.append(forward_motion(load_rig(), chain.physics(), 1000.0).angle)
    coarse, finer_one = (float(np.max(np.abs(angle - angles[-1]))) for angle in angles[:-1])
    assert coarse > 5.0 * finer_one > 0.0


@each_hold
def test_a_motion_is_continuous_where_the_lag_vanishes(held: bool) -> None:
    run = replace(WIND_ON, duration=0.35, drive=InputMoment(TIME, 3.0 * VALUES, held=held))
    angles = [
        forward_motion(
            load_rig(),
            EffectChain(run, (effect_from("actuator_lag", {"lag": lag}),), (None,)).physics(),
            1000.0,
        ).angle
        for lag in (0.0, 1e-7)
    ]
    assert np.max(np.abs(angles[1] - angles[0])) < 1e-6


@each_hold
@pytest.mark.parametrize(
    "actuator",
    [
        ActuatorLimits(limit=0.8),
        ActuatorLimits(rate=60.0),
        ActuatorLimits(lag=0.02),
        ActuatorLimits(0.8, 60.0, 0.02),
    ],
    ids=["saturation", "rate limit", "lag", "all"],
)
def test_the_reference_simulator_agrees(actuator: ActuatorLimits, held: bool) -> None:
    holds = np.array([held])
    other = Reference(
        actuator.limit or np.inf, rate=actuator.rate or np.inf, lags=(actuator.lag,) if actuator.lag else ()
    )
    short = STEP / 64
    expected, _ = exerted(finer(finer(VALUES[:, None], holds), holds), other, short, holds)
    found = actuator.exerted(InputSamples(TIME, VALUES, held), 1.0)
    time = short * np.arange(len(expected))
    until = time < TIME[-1] - STEP
    means = np.abs(np.cumsum(at(found, time + 0.5 * short) - expected[:, 0])[until]) * short
    assert np.max(means) < 5e-4  # N m s, where one interval asks for 1e-2


@pytest.mark.parametrize("name", NULL)
def test_a_constant_moment_beside_the_input_does_not_pass_through_the_actuator(name: str) -> None:
    run = replace(WIND_ON, drive=replace(DRIVE, offset=50.0))
    effect = effect_from(name, {NULL[name]: 2.0})
    acting = EffectChain(run, (effect,), (None,)).physics().drive
    plain = EffectChain(replace(run, drive=DRIVE), (effect,), (None,)).physics().drive
    assert acting is not None
    assert plain is not None
    assert acting.acting.values == pytest.approx(plain.acting.values + 50.0)


@pytest.mark.parametrize("name", NULL)
def test_a_moving_root_has_no_actuator(name: str) -> None:
    run = replace(WIND_ON, drive=replace(DRIVE, kind=INPUTS["base_rad"]))
    chain = EffectChain(run, (effect_from(name, {NULL[name]: 0.1}),), (None,))
    assert chain.physics().drive.acting.values is not None
    assert np.array_equal(chain.physics().drive.acting.values, DRIVE.values)


def test_a_campaign_tries_them_where_a_moment_moves_the_body() -> None:
    driven = campaign()
    free = replace(driven, runs=tuple(replace(run, drive=None) for run in driven.runs))
    by_root = replace(
        driven, runs=tuple(replace(run, drive=replace(run.drive, column="base_rad")) for run in driven.runs)
    )
    own = {effect_class(name) for name in NULL}
    assert own <= set(kinds_for(driven, ALL_EFFECTS, SpringModel())[0])
    for other in (free, by_root):
        assert not own & set(kinds_for(other, ALL_EFFECTS, SpringModel())[0])


def test_a_plan_whose_drive_moves_the_root_refuses_them_in_one_line() -> None:
    drive = Input("base_rad", np.sin(np.arange(100.0)))
    plan = paper_plan()
    plan = replace(
        plan,
        conditions=tuple(replace(one, drive=drive) for one in plan.conditions),
        effects=(EffectSetting("actuator_lag", {"lag": 0.01}),),
    )
    with pytest.raises(TunnelError, match="this drive moves the spring's root") as caught:
        plan_effects(plan)
    assert "\n" not in str(caught.value)


KINDS = vocabulary([*NULL, DELAY.name])


def through(**actuator: Any) -> Campaign:
    """The campaign with its moment through an actuator of the reference simulator, and the input as asked for."""
    found, runs = campaign(), []
    linear = np.array([False])
    for run in found.runs:
        assert run.drive is not None
        time = run.record.time_s
        moment, _ = exerted(
            finer(run.drive.values[:, None], linear), Reference(**actuator), 0.125 / RATE, linear
        )
        acting = InputMoment(0.125 / RATE * np.arange(len(moment)), moment[:, 0])
        settings = replace(
            WIND_ON, wind_speed=0.0, spring_stiffness=SPRING, yaw_inertia=INERTIA, mechanical_damping=DAMPING,
            release_angle=0.02, duration=time.size / RATE, drive=acting,
        )  # fmt: skip
        moved = forward_motion(load_rig(), settings, RATE).angle
        noise = NOISE * np.random.default_rng([7, len(runs)]).standard_normal(time.size)
        runs.append(replace(run, record=Record(time, moved + noise)))
    return replace(found, runs=tuple(runs))


@pytest.mark.parametrize(
    ("name", "value"),
    [("actuator_lag", 0.03), slow("actuator_saturation", 0.6), slow("actuator_rate_limit", 8.0)],
)
def test_each_is_named_with_its_value(name: str, value: float) -> None:
    """The lag is 0.4 of the reciprocal of the resonance's angular frequency, where it is not a delay."""
    data = through(**{"lags": (value,)} if name == "actuator_lag" else {NULL[name]: value})
    found = diagnose(data, kinds=KINDS, rivals=())
    assert found.causes == (name,)
    own = found.candidates[0].parameters[NULL[name]]
    assert own.std is not None
    assert abs(own.value - value) < 4.0 * own.std < 0.02 * value
    assert found.gap.closed > 0.99


@pytest.mark.slow
def test_a_limit_approached_as_a_hyperbolic_tangent_is_a_saturation_alone() -> None:
    found = diagnose(through(limit=0.8, soft=True), kinds=KINDS, rivals=())
    assert found.causes == ("actuator_saturation",)
    assert found.candidates[0].parameters["softness"].value == pytest.approx(0.45, abs=0.1)
    assert found.gap.closed > 0.99


@pytest.mark.parametrize(("lag", "named"), [(0.001, False), (0.004, True)])
def test_a_lag_far_faster_than_the_motion_is_a_delay(lag: float, named: bool) -> None:
    """The gain of the first falls by 1e-4 at a resonance of 2 Hz, that of the second by 1.3e-3."""
    assert effect_from("actuator_lag", {"lag": lag}).plausible(4.0 * np.pi, 10.0, (-0.3, 0.3)) == named


@each_hold
@pytest.mark.parametrize("name", NULL)
def test_mujoco_agrees_in_second_order(name: str, held: bool) -> None:
    """MuJoCo's model has the mean of the moment over each step, as of a delayed input."""
    value = {"actuator_lag": 0.02, "actuator_saturation": 0.6, "actuator_rate_limit": 3.0}[name]
    run = replace(WIND_ON, drive=replace(DRIVE, held=held))
    physics = EffectChain(run, (effect_from(name, {NULL[name]: value}),), (None,)).physics()
    expected = forward_motion(load_rig(), physics, 100.0).angle
    away = [
        float(np.max(np.abs(simulate_motion(build_model(load_rig(), one), 100.0).angle - expected)))
        for one in (physics, replace(physics, timestep=5e-4))
    ]
    assert away[0] < INTEGRATION_TOLERANCE
    assert away[1] < 0.3 * away[0] or away[0] < 1e-9  # clipped and held, it has its kinks at the steps


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "truth", "actuator", "step"),
    [
        ("actuator_lag", 0.03, '<general {} dyntype="filterexact" dynprm="0.03"/>', 1e-3),
        ("actuator_saturation", 0.15 * GEAR, '<motor {} forcerange="-0.15 0.15"/>', 0.0),
    ],
)
def test_mujocos_own_actuators_are_named_and_the_patched_joint_moves_as_they_do(
    tmp_path: Path, name: str, truth: float, actuator: str, step: float
) -> None:
    """MuJoCo simulates the truth with its filter, which acts within one step, or its range of forces."""
    motor = actuator.format(f'name="motor" joint="elbow" gear="{GEAR:g}"')
    data = robot_campaign(robot(TRUE, actuators=motor))
    kinds = vocabulary([*NULL, DELAY.name, "coulomb_friction", "quadratic_damping"])
    found = diagnose(data, kinds=kinds, model=own_model(tmp_path, data, robot()))
    assert found.causes == (name,)
    own = found.candidates[0].parameters[NULL[name]]
    assert own.std is not None
    assert abs(own.value - truth) < step + 3.0 * own.std
    assert found.model is not None
    assert found.model.closed > 0.999
    assert any("The actuator is not part of the model" in note for note in found.model.notes)
