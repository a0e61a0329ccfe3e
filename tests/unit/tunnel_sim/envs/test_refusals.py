"""Bad arguments, options and actions: one clear line, a TunnelError that is a ValueError."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

from tests.support.env_episodes import NAME, make
from tunnel_sim.envs import EnvError
from tunnel_sim.envs.free_decay import FreeDecayEnv, FreeDecayVectorEnv
from tunnel_sim.envs.information import UNKNOWNS
from tunnel_sim.vocabulary.errors import TunnelError


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        ({"durration": 5.0}, ["durration", "did you mean 'duration'"]),
        ({"widht": 320}, ["FreeDecay-v0: unknown argument 'widht'", "did you mean 'width'"]),
        ({"preset": "operater"}, ["did you mean 'operator'"]),
        ({"duration": -1.0}, ["duration = -1.0", "above 0"]),
        ({"duration": float("nan")}, ["duration = nan"]),
        ({"duration": "long"}, ["duration = 'long'"]),
        ({"duration": 0.105}, ["control periods", "whole number"]),
        ({"duration": 0.01}, ["one control period"]),
        ({"control_period": 0.0015}, ["sample intervals"]),
        ({"noise_std": -1e-4}, ["noise_std", "0 or more"]),
        ({"noise_std": 0.0, "resolution": 0.0}, ["infinite information"]),
        ({"noise_std": 1e-7, "resolution": 0.0}, ["below 1e-06 rad"]),
        ({"effect_probability": 1.5}, ["probability"]),
        ({"prior": {"cn_bta": 0.1}}, ["did you mean 'cn_beta'"]),
        (
            {"prior": {"cn_r": 0.0}},
            ["cn_r = 0.0: the value is known exactly", "nothing to learn", "above 0, in 1/rad"],
        ),
        ({"prior": {"release_angle": -0.1}}, ["release_angle = -0.1", "in rad"]),
        ({"prior": 5}, ["FreeDecay-v0: prior = 5 is not a mapping", "give values by name"]),
        ({"rig_file": "nowhere.toml"}, ["FreeDecay-v0, rig_file, nowhere.toml", "no such file"]),
        ({"rig_file": 5}, ["rig_file = 5 is not a path"]),
        ({"preset": ["operator"]}, ["unknown preset ['operator']"]),
        ({"duration": 1e9}, ["FreeDecay-v0: duration = 1e+09 s at 1000 Hz", "give at most 20000 s"]),
        ({"width": 0}, ["width = 0 is not a whole number of 1 or more"]),
        ({"height": "tall"}, ["height = 'tall' is not a whole number"]),
    ],
)
def test_arguments(arguments: dict[str, Any], parts: list[str]) -> None:
    with pytest.raises(TunnelError) as refusal:
        make(disable_env_checker=True, **arguments)
    assert_one_line(refusal.value, parts)


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        ({"windspeed": 10.0}, ["did you mean 'wind_speed'"]),
        ({"wind_speed": -1.0}, ["option wind_speed", "0 to 40"]),
        ({"wind_speed": 41.0}, ["option wind_speed", "0 to 40"]),
        ({"wind_speed": "fast"}, ["option wind_speed"]),
        ({"release_angle": 20.0}, ["option release_angle", "1.03", "in rad"]),  # degrees, surely
        ({"spring": 11}, ["no spring 11", "use one of 1, 2"]),
        ({"spring": "five"}, ["option spring"]),
        ({"spring": 5, "spring_stiffness": 16.0}, ["both"]),
        ({"spring_stiffness": 0.0}, ["option spring_stiffness"]),
        ({"truth": {"cn_bta": 0.4}}, ["did you mean 'cn_beta'"]),
        ({"truth": 0.4}, ["option truth", "not a mapping"]),
        ({"truth": {"yaw_inertia": 0.0}}, ["yaw_inertia"]),
        ({"effects": {"coulomb_fricton": {"friction_moment": 0.1}}}, ["did you mean 'coulomb_friction'"]),
        ({"effects": {"coulomb_friction": {}}}, ["friction_moment is missing"]),
        ({"effects": {"coulomb_friction": {"friction_moment": -0.1}}}, ["out of range"]),
        ({"effects": {"coulomb_friction": 0.1}}, ["coulomb_friction", "not a mapping"]),
        ({"effects": "coulomb_friction"}, ["names no effects"]),
        ({"effects": ["coulomb_friction"]}, ["names no effects"]),
    ],
)
def test_options(options: dict[str, Any], parts: list[str]) -> None:
    for env in (make(), gymnasium.make_vec(NAME, num_envs=2, preset="plain")):
        with pytest.raises(EnvError) as refusal:
            env.reset(seed=1, options=options)
        assert_one_line(refusal.value, parts)


@pytest.mark.parametrize("action", [1, -1, 0.0, [0, 0], "go"])
def test_actions_of_the_plain_preset(action: Any) -> None:
    env = make()
    env.reset(seed=1)
    with pytest.raises(EnvError) as refusal:
        env.step(action)
    assert_one_line(refusal.value, ["action", "preset='operator'"])


@pytest.mark.parametrize(
    "action", [[1.1, 0.0], [0.0, -1.5], [np.nan, 0.0], [0.0], [0.0, 0.0, 0.0], 0], ids=str
)
def test_actions_of_the_operator(action: Any) -> None:
    env = make(preset="operator")
    env.reset(seed=1)
    with pytest.raises(EnvError) as refusal:
        env.step(np.array(action))
    assert_one_line(refusal.value, ["action"])


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (
            {"wind_speed": 100, "moment": 0},
            "wind_speed = 100 m/s is beyond wind_limit = 40 m/s; give 0 to 40 m/s",
        ),
        ({"wind_speed": -1.0}, "wind_speed = -1 m/s is negative; give 0 to 40 m/s"),
        ({"wind_speed": np.nan}, "wind_speed = nan m/s"),
        (
            {"wind_speed": 1.0, "moment": -0.6},
            "moment = -0.6 N m is beyond moment_limit = 0.5 N m",
        ),
    ],
)
def test_values_of_an_action_are_refused_in_their_units(values: dict[str, float], said: str) -> None:
    with pytest.raises(EnvError, match=said) as refusal:
        make(preset="operator").unwrapped.operator_action(**values)
    assert_one_line(refusal.value, ["operator_action: "])


def test_all_but_the_derivatives_may_be_known_exactly() -> None:
    """What the page says of a prior of 0."""
    exact = dict.fromkeys(UNKNOWNS[:5], 0.0)
    env = make(preset="operator", duration=0.5, prior=exact)
    env.reset(seed=1)
    assert np.isfinite(env.step(np.zeros(2))[1])


@pytest.mark.parametrize(
    ("reset", "parts"),
    [
        ({"seed": [1, 2]}, ["2 seeds for 3 runs"]),
        ({"options": {"reset_mask": [True, False]}}, ["reset_mask", "3"]),
        ({"options": {"reset_mask": np.zeros(3, dtype=bool)}}, ["reset_mask"]),
        ({"options": {"runs": [{}]}}, ["runs", "3"]),
        ({"options": {"runs": [{}, {}, {"wind": 1.0}]}}, ["reset options has no 'wind'"]),
    ],
)
def test_resets_of_many(reset: dict[str, Any], parts: list[str]) -> None:
    envs = gymnasium.make_vec(NAME, num_envs=3, preset="plain")
    with pytest.raises(EnvError, match="call reset"):
        envs.step(np.zeros(3, dtype=np.int64))
    with pytest.raises(EnvError) as refusal:
        envs.reset(**reset)
    assert_one_line(refusal.value, parts)


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        ({"num_envs": 0}, ["num_envs = 0 is not a whole number of 1 or more"]),
        ({"num_envs": 1.5}, ["num_envs = 1.5"]),
        ({"nthread": -1}, ["nthread = -1 is not a whole number of 0 or more"]),
        ({"max_episode_steps": "all"}, ["max_episode_steps = 'all'"]),
    ],
)
def test_arguments_of_many(arguments: dict[str, Any], parts: list[str]) -> None:
    with pytest.raises(EnvError) as refusal:
        FreeDecayVectorEnv(**arguments)
    assert_one_line(refusal.value, ["FreeDecay-v0: ", *parts])


def test_unknown_camera_and_modes_of_many() -> None:
    env = make(render_mode="rgb_array", camera="abov")
    env.reset(seed=1)
    with pytest.raises(EnvError, match="did you mean 'above'"):
        env.render()
    with pytest.raises(EnvError, match="did you mean 'rgb_array'"):
        FreeDecayEnv(render_mode="rgb_aray")  # gymnasium.make itself warns of it
    with pytest.raises(EnvError, match="rgb_array"):
        gymnasium.make_vec(NAME, num_envs=2, preset="plain", render_mode="human")


def assert_one_line(error: BaseException, parts: list[str]) -> None:
    text = str(error)
    assert "\n" not in text
    for part in parts:
        assert part in text
