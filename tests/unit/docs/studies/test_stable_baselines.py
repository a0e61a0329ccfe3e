"""The bridge to Stable-Baselines3: the same runs as the native environment, restarted when they end."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers.vector import NormalizeObservation

import tunnel_sim.envs  # noqa: F401  registers
from tunnel_sim.envs import EnvError

ARGUMENTS = {"duration": 0.03, "preset": "operator"}
ACTIONS = np.zeros((2, 2), dtype=np.float32)


def bridged(native, **options):
    from docs.studies.stable_baselines import BaselinesVecEnv  # loads torch

    return BaselinesVecEnv(native, **options)


def native(**arguments):
    return gymnasium.make_vec("tunnel_sim/FreeDecay-v0", num_envs=2, **ARGUMENTS, **arguments)


def test_runs_are_those_of_the_native_environment_and_restart_at_their_end():
    bridge, plain = bridged(native()), native()
    bridge.seed(3)
    np.testing.assert_array_equal(bridge.reset(), plain.reset(seed=3)[0])
    assert bridge.reset_infos[1]["wind_speed"] > 0.0
    for _ in range(2):
        seen, reward, done, infos = bridge.step(ACTIONS)
        other = plain.step(ACTIONS)
        np.testing.assert_array_equal(seen, other[0])
        np.testing.assert_array_equal(reward, other[1])
        assert not done.any()
        assert infos == [{}, {}]
    seen, reward, done, infos = bridge.step(ACTIONS)
    last, gain, _, truncated, _ = plain.step(ACTIONS)
    assert done.all()
    assert truncated.all()
    np.testing.assert_array_equal(reward, gain)
    np.testing.assert_array_equal([info["terminal_observation"] for info in infos], last)
    assert all(info["TimeLimit.truncated"] for info in infos)
    assert infos[0]["record"].time_s.size == 30
    np.testing.assert_array_equal(seen, plain.step(ACTIONS)[0])  # there the restart takes a step of its own
    assert np.all(seen[:, -2] == 0.0)
    assert not bridge.step(ACTIONS)[2].any()


def test_the_options_apply_to_every_run():
    bridge = bridged(native(), options={"spring": 5, "wind_speed": 12.0})
    bridge.reset()
    for _ in range(3):
        seen = bridge.step(ACTIONS)[0]
    assert seen[:, -1].tolist() == [12.0, 12.0]
    assert bridge.get_attr("num_envs") == [2, 2]
    assert bridge.env_method("information", indices=[1])[0].shape == (7, 7)
    assert bridge.env_is_wrapped(NormalizeObservation) == [False, False]
    with pytest.raises(EnvError, match="give it to make_vec"):
        bridge.set_attr("rig", None)


def test_the_statistics_of_the_normalisation_hold_every_observation_once():
    normal, seen = NormalizeObservation(native()), [native().reset(seed=3)[0]]
    bridge, plain = bridged(normal), bridged(native())
    for envs in (bridge, plain):
        envs.seed(3)
        envs.reset()
    for _ in range(4):
        shown = bridge.step(ACTIONS)[0]
        raw, _, done, infos = plain.step(ACTIONS)
        if done.any():
            seen.append([info["terminal_observation"] for info in infos])
        seen.append(raw)
    rms, every = normal.obs_rms, np.concatenate(seen)
    np.testing.assert_allclose(rms.mean, every.mean(axis=0), rtol=1e-3, atol=1e-4)
    expected = (raw - rms.mean) / np.sqrt(rms.var + normal.epsilon)
    np.testing.assert_allclose(shown, expected, rtol=1e-3, atol=1e-4)


def test_an_agent_learns_through_the_bridge():
    from stable_baselines3 import PPO

    envs = bridged(NormalizeObservation(native()))
    model = PPO("MlpPolicy", envs, n_steps=8, batch_size=16, n_epochs=1, seed=1)
    before = model.policy.action_net.weight.detach().numpy().copy()
    model.learn(16)
    assert np.abs(model.policy.action_net.weight.detach().numpy() - before).max() > 0.0
