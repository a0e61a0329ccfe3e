"""The same bits: against ``simulate``, by seed, alone and side by side, and from a state taken on the way."""

from __future__ import annotations

from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest

from tests.marks import slow
from tests.support.env_episodes import NAME, episode, make, same
from tunnel_sim.effects import ALL_EFFECTS, Effect
from tunnel_sim.effects.capabilities import Clock
from tunnel_sim.effects.mechanics import SpringMiscalibration
from tunnel_sim.engine.simulate import simulate
from tunnel_sim.envs import EnvError
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.moment_law import state_names

TRUTH = {"cn_beta": 0.47, "cn_r": -0.1, "yaw_inertia": 0.1, "mechanical_damping": 0.02, "sensor_zero": 0.004}
STATED: dict[str, Any] = {
    "spring": 5,
    "wind_speed": 21.0,  # not the reference of speed-dependent forms
    "release_angle": 0.3,
    "truth": TRUTH,
    "effects": {},
}


def of(kind: type[Effect]) -> dict[str, dict[str, float]]:
    severity = kind.parameters()[0]
    values = {severity.name: severity.scale}
    if kind is SpringMiscalibration:
        values["spring_stiffness"] = 16.12
    return {kind.name: values}


TOGETHER = of(ALL_EFFECTS[0]) | {"buffeting": {"intensity": 0.01}, "mains_hum": {"amplitude": 0.002}}
TOGETHER |= {"sensor_hysteresis": {"half_width": 0.002}, "wind_speed_drift": {"drift": 0.1}}
CASES: dict[str, dict[str, dict[str, float]]] = {"none": {}, "together": TOGETHER}
CASES |= {kind.name: of(kind) for kind in ALL_EFFECTS if not (kind.driven or issubclass(kind, Clock))}


@pytest.mark.parametrize("case", CASES)
def test_a_plain_episode_is_the_run_that_simulate_makes(case: str) -> None:
    env = make(duration=0.3, expose_truth=True)
    *_, info = episode(env, seed=3, options=STATED | {"effects": CASES[case]})
    plan, record = info["truth"], info["record"]
    alone = simulate(load_rig(), plan.stated(), plan.sensor, np.random.default_rng(3), effects=plan.effects)
    assert same(record.time_s, alone.time_s)
    assert same(record.yaw_rad, alone.yaw_rad)
    if CASES[case]:
        assert plan.effects
        nominal = simulate(load_rig(), plan.stated(), plan.sensor, np.random.default_rng(3))
        assert not same(record.yaw_rad, nominal.yaw_rad)


def test_the_noise_after_drawn_conditions_is_that_of_the_generator_they_came_from() -> None:
    env = make(duration=0.2, expose_truth=True)
    _, info = env.reset(seed=9)
    *_, end = episode(env, seed=9)
    plan = info["truth"]
    rng = np.random.default_rng(9)
    rng.integers(8)
    rng.uniform(10.0, 20.0)
    rng.choice((-1.0, 1.0))
    rng.uniform(0.0, 1.0, 6)  # angle, four of the truth, zero
    assert same(end["record"].yaw_rad, simulate(load_rig(), plan.stated(), plan.sensor, rng).yaw_rad)


@pytest.mark.parametrize("preset", ["plain", "operator"])
def test_seed_and_actions_decide_every_bit(preset: str) -> None:
    action: Any = 0 if preset == "plain" else np.array([0.2, 0.1], dtype=np.float32)
    runs = [
        episode(make(duration=0.2, preset=preset, effect_probability=0.7), action, seed=seed)
        for seed in (5, 5, 6)
    ]
    assert same(runs[0][0], runs[1][0])
    assert same(runs[0][1], runs[1][1])
    assert not same(runs[0][0], runs[2][0])


def test_a_second_episode_is_another_one_and_reproducible() -> None:
    pairs = []
    for _ in range(2):
        env = make(duration=0.2, effect_probability=0.7)
        pairs.append((episode(env, seed=5)[0], episode(env)[0]))
    assert same(pairs[0][1], pairs[1][1])
    assert not same(pairs[0][0], pairs[0][1])


def transitions(envs: Any, preset: str, steps: int) -> dict[str, list[Any]]:
    envs.action_space.seed(2)
    observations, infos = envs.reset(seed=7)
    kept: dict[str, list[Any]] = {"observations": [observations], "results": [], "records": []}
    kept["stiffness"] = [infos["spring_stiffness"]]
    for _ in range(steps):
        action = envs.action_space.sample()
        observations, *results, infos = envs.step(action)
        kept["observations"].append(observations)
        kept["results"].append(np.array(results, dtype=np.float64))
        kept["records"] += [record.yaw_rad for record in infos.get("record", []) if record is not None]
        log = "operator_log" if preset == "operator" else "run"
        assert (log in infos) == ("record" in infos)
    envs.close()
    return kept


@pytest.mark.parametrize("preset", [slow("plain"), "operator"])
def test_native_sync_and_async_agree_to_the_bit_through_resets(preset: str) -> None:
    # runs of every layout, drawn anew thrice; the operator's random moments end some of them early
    arguments = {"preset": preset, "duration": 0.1, "effect_probability": 0.9, "moment_limit": 600.0}
    kinds: dict[str, dict[str, Any]] = {
        "native": {"vectorization_mode": "vector_entry_point"},
        "one thread": {"vectorization_mode": "vector_entry_point", "nthread": 1},
        "sync": {"vectorization_mode": "sync"},
        "async": {"vectorization_mode": "async", "vector_kwargs": {"context": "spawn"}},
    }
    count = 6
    results = {
        name: transitions(gymnasium.make_vec(NAME, num_envs=count, **kind, **arguments), preset, 33)
        for name, kind in kinds.items()
        if name != "async"
    }
    few = kinds["async" if preset == "plain" else "sync"] | {"num_envs": 2}  # processes are slow to start
    results["async"] = transitions(gymnasium.make_vec(NAME, **few, **arguments), preset, 14)
    results["native of two"] = transitions(
        gymnasium.make_vec(NAME, num_envs=2, **kinds["native"], **arguments), preset, 14
    )
    for one, other in (("native", "one thread"), ("native", "sync"), ("async", "native of two")):
        for name, values in results[one].items():
            assert len(values) == len(results[other][name]) > 0
            assert all(same(a, b) for a, b in zip(values, results[other][name], strict=True)), (
                one,
                other,
                name,
            )
    terminated = np.array(results["native"]["results"])[:, 1].any()
    assert terminated == (preset == "operator")


def test_a_mask_begins_some_runs_and_leaves_the_others() -> None:
    envs = gymnasium.make_vec(NAME, num_envs=3, preset="plain", duration=0.2)
    envs.reset(seed=1)
    for _ in range(5):
        envs.step(np.zeros(3, dtype=np.int64))
    kept = envs.get_state(0)
    observations, infos = envs.reset(seed=[4, 5, 6], options={"reset_mask": np.array([False, True, False])})
    assert observations[1, -2] == 0.0
    assert infos["_spring_stiffness"].tolist() == [False, True, False]
    assert same(envs.get_state(0).mujoco, kept.mujoco)
    assert same(observations[1], make(duration=0.2).reset(seed=5)[0])


def test_runs_may_have_options_of_their_own() -> None:
    envs = gymnasium.make_vec(NAME, num_envs=2, preset="plain", duration=0.2)
    _, infos = envs.reset(seed=1, options={"wind_speed": 12.0, "runs": [{"spring": 3}, {"spring": 8}]})
    assert infos["wind_speed"].tolist() == [12.0, 12.0]
    assert infos["spring_stiffness"].tolist() == [4.28, 44.84]


STATES = {
    "plain": {},
    "unsteady_aero_lag": {"unsteady_aero_lag": {"lag": 3.0}},
    "together": TOGETHER,
    "rod_flexibility": {"rod_flexibility": {"compliance": 1e-3}},
}


@pytest.mark.parametrize("case", STATES)
def test_an_episode_goes_on_from_a_state_with_the_same_bits(case: str) -> None:
    envs = [make(duration=0.3, preset="operator").unwrapped for _ in range(2)]
    envs[0].action_space.seed(3)
    actions = [envs[0].action_space.sample() for _ in range(30)]
    envs[0].reset(seed=1, options=STATED | {"effects": STATES[case]})
    for action in actions[:12]:
        envs[0].step(action)
    state = envs[0].get_state()
    first = [envs[0].step(action) for action in actions[12:]]
    envs[0].set_state(state)
    again = [envs[0].step(action) for action in actions[12:]]
    envs[1].set_state(state)
    elsewhere = [envs[1].step(action) for action in actions[12:]]
    many = gymnasium.make_vec(NAME, num_envs=2, duration=0.3, preset="operator")
    many.reset(seed=8)
    many.set_state(1, state)
    for i, action in enumerate(actions[12:]):
        observations, rewards, *_ = many.step(np.stack((actions[0], action)))
        assert same(observations[1], first[i][0])
        assert rewards[1] == first[i][1]
    for other in (again, elsewhere):
        assert all(same(a[0], b[0]) and a[1] == b[1] for a, b in zip(first, other, strict=True))
        assert same(first[-1][4]["record"].yaw_rad, other[-1][4]["record"].yaw_rad)
    # and what follows the episode
    assert same(envs[0].reset()[0], envs[1].reset()[0])


def test_the_state_holds_mujocos_with_that_of_the_plugin() -> None:
    env = make(duration=0.3).unwrapped
    env.reset(seed=1, options=STATED | {"effects": STATES["unsteady_aero_lag"]})
    for _ in range(7):
        env.step(0)
    state = env.get_state().mujoco
    model = env._engine._model.mj
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, state, int(mujoco.mjtState.mjSTATE_INTEGRATION))
    plugin = dict(zip(state_names(), data.plugin_state, strict=True))
    assert data.time == pytest.approx(0.07)
    assert plugin["time"] == pytest.approx(0.07)
    assert plugin["started"] == 1.0
    assert plugin["lagged"] != plugin["angle"]


def test_a_state_of_another_configuration_is_refused() -> None:
    env = make(duration=0.3).unwrapped
    env.reset(seed=1)
    with pytest.raises(ValueError, match="different configuration"):
        make(duration=0.2).unwrapped.set_state(env.get_state())


def test_an_episode_cannot_pass_over_samples() -> None:
    env = make(duration=0.3)
    with pytest.raises(EnvError, match="cannot drop samples"):
        env.reset(seed=1, options=STATED | {"effects": {"dropped_samples": {"lost_time": 0.01}}})
