"""The reward of FreeDecay-v0 against the closed forms of the Cramér–Rao bound, and against differences."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest

import tunnel_sim.envs  # noqa: F401  registers the environments
from identification.signal.decay_fit import information_at
from identification.signal.free_decay import Decay
from identification.uncertainty.cramer_rao import campaign_bound
from tests.marks import slow
from tunnel_sim.envs.information import UNKNOWNS, Prior, half_log_det
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, SensorProperties
from tunnel_sim.vocabulary.plan import Truth

RIG = load_rig()
TRUTH = {"cn_beta": 0.47, "cn_r": -0.1, "yaw_inertia": 0.1, "mechanical_damping": 0.02, "sensor_zero": 0.004}
LOADS = (
    0.5 * RIG.air.density * RIG.body.frontal_area * RIG.body.length,
    0.5 * RIG.air.density * RIG.body.frontal_area * RIG.body.length**2,
)


def run(
    options: dict[str, Any], action: Any = 0, **arguments: Any
) -> tuple[Any, list[float], dict[str, Any]]:
    env = gymnasium.make("tunnel_sim/FreeDecay-v0", **{"preset": "plain", **arguments})
    env.reset(seed=1, options={"truth": TRUTH, "air_density": RIG.air.density, **options})
    rewards, over, info = [], False, {}
    while not over:
        _, reward, terminated, truncated, info = env.step(action)
        rewards.append(float(reward))
        over = terminated or truncated
    return env.unwrapped, rewards, info


def from_readings(env: Any) -> np.ndarray:
    """The information of the readings alone: without the prior."""
    prior = np.array([getattr(Prior(), name) for name in UNKNOWNS])
    prior[:2] *= TRUTH["yaw_inertia"], TRUTH["mechanical_damping"]
    return env.information() - np.diag(prior**-2.0)


@pytest.mark.parametrize(("spring", "speed"), [(3, 10.0), slow(5, 20.0), slow(10, 15.0), (5, 0.0)])
def test_one_run_has_the_information_of_the_closed_form(spring: int, speed: float) -> None:
    env, _, info = run({"spring": spring, "wind_speed": speed, "release_angle": 0.3}, duration=5.0)
    inertia = TRUTH["yaw_inertia"]
    stiffness = RIG.springs[spring] - LOADS[0] * speed**2 * TRUTH["cn_beta"]
    damping = TRUTH["mechanical_damping"] - LOADS[1] * speed * TRUTH["cn_r"]
    decay = Decay(0.5 * damping / inertia, stiffness / inertia)
    closed = information_at(info["record"].time_s, decay, 0.3, 0.0) / env.config.reading_variance
    chain = np.zeros((5, 7))  # from (Izz, Cr, angle, rate, zero, Cnβ, Cnr) to (a, k, zero, angle, rate)
    chain[0] = [-decay.rate / inertia, 0.5 / inertia, 0, 0, 0, 0, -0.5 * LOADS[1] * speed / inertia]
    chain[1] = [-stiffness / inertia**2, 0, 0, 0, 0, -LOADS[0] * speed**2 / inertia, 0]
    chain[2, 4] = chain[3, 2] = chain[4, 3] = 1.0
    expected = chain.T @ closed @ chain
    scale = np.sqrt(np.diag(expected))
    scale[scale == 0.0] = 1.0
    assert from_readings(env) / np.outer(scale, scale) == pytest.approx(
        expected / np.outer(scale, scale), abs=2e-7
    )


def test_two_runs_together_have_the_bound_of_their_campaign() -> None:
    speeds, angle, runs = (0.0, 20.0), 0.3, []
    shared, own = [0, 1, 4, 5, 6], [2, 3]
    total = np.zeros((9, 9))
    for place, speed in enumerate(speeds):
        env, _, info = run({"spring": 5, "wind_speed": speed, "release_angle": angle}, duration=4.0)
        order = shared + own
        at = [0, 1, 2, 3, 4, 5 + 2 * place, 6 + 2 * place]
        total[np.ix_(at, at)] += from_readings(env)[np.ix_(order, order)]
        runs.append(replace(info["run"], id=str(place)))
    body = RIG.body
    campaign = Campaign(
        "two", RigProperties(None, body.frontal_area, body.length), SensorProperties(), tuple(runs)
    )
    deviation = float(np.sqrt(env.config.reading_variance))
    injected = {name: TRUTH[name] for name in ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping")}
    bound = campaign_bound(campaign, Truth(**injected), noise_std=deviation)
    found = np.sqrt(np.diag(np.linalg.inv(total)))
    names = ("yaw_inertia", "mechanical_damping", "sensor_zero", "cn_beta", "cn_r")
    for name, value in zip(names, found, strict=False):
        if name in bound.parameters:
            assert value == pytest.approx(bound.std(name), rel=1e-6), name
    assert set(bound.parameters) == set(injected)


def test_the_rewards_sum_to_the_information_of_the_whole_run() -> None:
    env, rewards, _ = run({"spring": 5, "wind_speed": 20.0, "release_angle": 0.3}, duration=3.0)
    whole = env.information()
    covariance = np.linalg.inv(whole)[5:, 5:]
    gained = 0.5 * np.log(0.5**4 / np.linalg.det(covariance))
    assert sum(rewards) == pytest.approx(gained, rel=1e-9)
    assert min(rewards) >= 0.0


def test_without_wind_nothing_is_learnt_of_the_air() -> None:
    _, rewards, _ = run({"spring": 5, "wind_speed": 0.0, "release_angle": 0.3}, duration=1.0)
    assert rewards == [0.0] * 100


def test_more_noise_informs_less_and_a_better_prior_leaves_less_to_learn() -> None:
    options = {"spring": 5, "wind_speed": 20.0, "release_angle": 0.3}
    plain, noisy, known = (
        sum(run(options, duration=2.0, **arguments)[1])
        for arguments in ({}, {"noise_std": 0.005}, {"prior": {"cn_beta": 0.01}})
    )
    assert noisy < plain - 0.1
    assert known < plain - 1.0
    exact = sum(run(options, duration=2.0, prior={"yaw_inertia": 0.0, "mechanical_damping": 0.0})[1])
    assert exact > plain


def test_under_the_operator_the_sensitivities_are_those_of_differences() -> None:
    # the forward integrator, given the wind as a series, knows nothing of the environment; no moment there
    action = np.array([0.8, 0.0], dtype=np.float32)
    options = {"spring": 5, "wind_speed": 10.0, "release_angle": 0.25}
    env, _, info = run(options, action, duration=3.0, preset="operator", wind_time_constant=1.5)
    record, set_point = info["record"], info["operator_log"].set_point[0]
    fine = np.arange(0, 30_001) * 1e-4
    speed = set_point + (10.0 - set_point) * np.exp(-fine / 1.5)

    def reading(**changes: float) -> np.ndarray:
        from tunnel_sim.physics.run_settings import RunSettings, Series
        from tunnel_sim.vocabulary.plan import AeroDerivatives

        truth = {**TRUTH, "release_angle": 0.25, "release_rate": 0.0, **changes}
        settings = RunSettings(
            16.12, AeroDerivatives(truth["cn_beta"], truth["cn_r"]), truth["yaw_inertia"],
            truth["mechanical_damping"], air_density=RIG.air.density, release_angle=truth["release_angle"],
            release_rate=truth["release_rate"], duration=3.0, series={"wind_speed": Series(tuple(speed), 1e-4)},
        )  # fmt: skip
        return forward_motion(RIG, settings, 1000.0).angle + truth["sensor_zero"]

    columns = []
    for name in UNKNOWNS:
        value = {**TRUTH, "release_angle": 0.25, "release_rate": 0.0}[name]
        step = 1e-4 * max(abs(value), 0.1)
        columns.append((reading(**{name: value + step}) - reading(**{name: value - step})) / (2.0 * step))
    sensitivity = np.array(columns)
    expected = sensitivity @ sensitivity.T / env.config.reading_variance
    scale = np.sqrt(np.diag(expected))
    found = from_readings(env) / np.outer(scale, scale)
    assert found == pytest.approx(expected / np.outer(scale, scale), abs=2e-4)
    assert record.time_s.size == 3000


def test_the_moment_enters_the_sensitivity_of_the_inertia() -> None:
    # at rest under a constant moment nothing accelerates: the inertia has no influence, whatever the moment
    still = TRUTH | {"cn_beta": 0.0, "cn_r": 0.0}
    env = gymnasium.make("tunnel_sim/FreeDecay-v0", preset="operator", duration=1.0)
    env.reset(
        seed=1, options={"truth": still, "spring_stiffness": 2.0, "wind_speed": 0.0, "release_angle": 0.2}
    )
    action = env.unwrapped.operator_action(wind_speed=0.0, moment=0.4)  # 2 N m/rad times 0.2 rad
    for _ in range(50):
        env.step(action)
    information = from_readings(env.unwrapped)
    assert abs(information[0, 0]) < 1e-6 * information[2, 2]
    assert information[0, 0] < 1e-6 * env.unwrapped.information()[0, 0]


def test_half_log_det_is_that_of_the_inverse_block() -> None:
    rng = np.random.default_rng(2)
    root = rng.standard_normal((5, 7, 9))
    matrices = root @ root.transpose(0, 2, 1)
    blocks = np.linalg.inv(matrices)[:, 5:, 5:]
    assert half_log_det(matrices) == pytest.approx(-0.5 * np.linalg.slogdet(blocks)[1])
