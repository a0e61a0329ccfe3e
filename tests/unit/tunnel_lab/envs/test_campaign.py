"""``tunnel_sim/Campaign-v0``: Gymnasium's conventions, what it shows and what it hides."""

from __future__ import annotations

import dataclasses

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import tunnel_sim.envs  # registers
from diagnosis import diagnose, vocabulary
from identification import identify
from identification.campaign.belief import information_gain
from tests.marks import slow
from tunnel_lab.envs.campaign import CampaignEnv
from tunnel_lab.envs.menu import Costs
from tunnel_lab.envs.session import MEAN, RigTruth, draw_truth, probabilities
from tunnel_sim.vocabulary.errors import TunnelError

ID = "tunnel_sim/Campaign-v0"
SHORT = {"durations": (5.0,)}
DIAGNOSIS = {"preset": "diagnosis", "durations": (5.0,), "springs": (5,)}
QUICK_DIAGNOSIS = {**DIAGNOSIS, "severities": {"quadratic_damping": (0.003, 0.006)}, "max_runs": 2}
FEW = vocabulary(["cubic_stiffness", "quadratic_damping", "coulomb_friction"])
OFF, ON = np.array([1, 0, 2, 0]), np.array([1, 2, 2, 0])
TRUTH = {"cn_beta": 0.5, "cn_r": -0.1, "yaw_inertia": 0.1, "mechanical_damping": 0.015, "sensor_zero": 0.002}


def make(**arguments):
    return gym.make(ID, **arguments)


def equal(first, second):
    assert first.keys() == second.keys()
    for key, value in first.items():
        np.testing.assert_array_equal(value, second[key])


@pytest.mark.parametrize(
    "arguments",
    [SHORT, slow({**SHORT, "simulation": "full"}), slow(QUICK_DIAGNOSIS)],
    ids=["identification", "full", "diagnosis"],
)
def test_the_public_checkers_pass(arguments, recwarn):
    from stable_baselines3.common.env_checker import check_env as check_with_sb3  # loads torch

    env = make(**arguments)
    check_env(env.unwrapped, skip_render_check=False)
    check_with_sb3(env.unwrapped)
    assert [str(warning.message) for warning in recwarn] == []


def test_the_registry_names_it():
    assert tunnel_sim.envs is not None
    spec = gym.spec(ID)
    assert spec.entry_point == "tunnel_lab.envs.campaign:CampaignEnv"
    assert not spec.nondeterministic


def test_same_seed_and_actions_give_the_same_bits():
    episodes = []
    for _ in range(2):
        env = make(**SHORT)
        seen = [env.reset(seed=11)[0]]
        rewards = []
        for action in (OFF, ON):
            observation, reward, *_ = env.step(action)
            seen.append(observation)
            rewards.append(reward)
        episodes.append((seen, rewards))
    for first, second in zip(episodes[0][0], episodes[1][0], strict=True):
        equal(first, second)
    assert episodes[0][1] == episodes[1][1]
    other = make(**SHORT)
    other.reset(seed=12)
    assert not np.array_equal(other.step(OFF)[0]["estimate"], episodes[0][0][1]["estimate"])


def test_the_noise_of_a_run_hangs_on_its_number_only():
    records = []
    for first in (OFF, ON):
        env = CampaignEnv(**SHORT)
        env.reset(seed=4)
        env.step(first)
        env.step(ON)
        records.append(env.campaign.runs[1].record.yaw_rad)
    np.testing.assert_array_equal(*records)


def reachable(value, depth=0):
    """Everything a frozen value leads to."""
    yield value
    if depth > 8:
        return
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from reachable(getattr(value, field.name), depth + 1)
    elif isinstance(value, tuple | list):
        for item in value:
            yield from reachable(item, depth + 1)


def test_the_truth_is_hidden_unless_asked_for():
    hidden, shown = make(**SHORT), make(**SHORT, expose_truth=True)
    options = {"truth": TRUTH}
    assert "truth" not in hidden.reset(seed=1, options=options)[1]
    info = shown.reset(seed=1, options=options)[1]
    assert info["truth"] == {**TRUTH, "effects": {}}
    for env in (hidden, shown):
        equal(env.step(OFF)[0], env.unwrapped.known.observation())
    assert "truth" not in hidden.step(ON)[-1]
    found = list(reachable(shown.unwrapped.known))
    assert len(found) > 50
    assert not any(isinstance(value, RigTruth) for value in found)
    assert any(
        value == 0.05 for value in found if isinstance(value, float)
    )  # the walk walks: the noise is there
    assert not any(value in TRUTH.values() for value in found if isinstance(value, float))


def test_the_reward_is_information_less_rig_time():
    env = CampaignEnv(**SHORT, seconds_per_nat=500.0)
    env.reset(seed=2)
    before = env.known.belief
    _, reward, *_, info = env.step(ON)
    gain = information_gain(before, env.known.belief)
    assert info["step_information_nats"] == info["total_information_nats"] == gain > 0.0
    assert info["rig_time_s"] == 60.0 + 300.0 + 60.0 + 5.0
    assert reward == pytest.approx(gain - 425.0 / 500.0)
    again = env.step(ON)[-1]
    assert again["rig_time_s"] == 425.0 + 65.0
    assert again["total_information_nats"] == gain + again["step_information_nats"]
    assert env.step(OFF)[-1]["rig_time_s"] == 425.0 + 65.0 + 125.0


def test_the_cost_of_a_run_is_the_callers_to_state():
    env = CampaignEnv(**SHORT, costs=Costs(setup=1.0, spring_change=2.0, speed_change=4.0))
    by_name = CampaignEnv(**SHORT, costs={"setup": 1.0, "spring_change": 2.0, "speed_change": 4.0})
    assert by_name.conditions.costs == env.conditions.costs
    env.reset(seed=2)
    assert env.step(OFF)[-1]["rig_time_s"] == 12.0


def test_it_ends_at_the_goal_and_hands_its_campaign_over():
    env = make(noise_std=0.005)
    env.reset(seed=5, options={"truth": TRUTH})
    over = [env.step(np.array([1, speed, 2, 2]))[2:] for speed in (0, 3)]
    assert [terminated for terminated, *_ in over] == [False, True]
    info = over[1][2]
    assert info["relative_std"]["cn_beta"] <= 0.01
    assert info["relative_std"]["cn_r"] <= 0.05
    estimate = identify(info["campaign"])
    assert estimate.cn_beta.value == pytest.approx(0.5, abs=5.0 * estimate.cn_beta.std)
    assert diagnose(info["campaign"], kinds=FEW).causes == ()


def test_it_is_truncated_when_the_runs_are_used_up():
    env = make(**SHORT, max_runs=2)
    env.reset(seed=5)
    assert env.step(OFF)[2:4] == (False, False)
    *_, terminated, truncated, info = env.step(OFF)
    assert (terminated, truncated) == (False, True)
    assert len(info["campaign"].runs) == 2
    with pytest.raises(TunnelError, match="the runs of the episode are used up; call reset"):
        env.step(OFF)


def test_a_lost_run_costs_its_time_and_gives_no_information():
    env = make(springs=(1, 5), durations=(20.0,))
    before, _ = env.reset(seed=3, options={"truth": TRUTH})
    after, reward, terminated, truncated, info = env.step(np.array([0, 3, 2, 0]))
    assert info["status"].startswith("lost: the motion grows without bound")
    np.testing.assert_array_equal(before["covariance"], after["covariance"])
    assert (terminated, truncated) == (False, False)
    assert reward == pytest.approx(-440.0 / 600.0)
    assert env.step(np.array([1, 0, 2, 0]))[-1]["status"] == "ok"


def test_a_diagnosis_finds_the_effect_that_was_given():
    env = make(**DIAGNOSIS, noise_std=0.0015)
    env.reset(seed=0, options={"truth": TRUTH, "effects": {"cubic_stiffness": {"coefficient": 0.4}}})
    observation, reward, terminated, _, info = env.step(np.array([0, 0, 1, 0]))
    assert info["answers"]["cubic_stiffness"] == observation["probabilities"][3] >= 0.9
    assert terminated
    assert observation["probabilities"].sum() == pytest.approx(1.0)
    assert reward > 0.0
    assert diagnose(info["campaign"], kinds=FEW).causes == ("cubic_stiffness",)


def test_no_gap_is_no_information():
    env = CampaignEnv(**DIAGNOSIS)
    env.reset(seed=0, options={"effects": {}})
    np.testing.assert_allclose(probabilities(env.known), 1.0 / 7.0)
    observation, reward, terminated, *_ = env.step(np.array([0, 0, 1, 0]))
    assert observation["probabilities"][0] == 0.999
    assert reward == pytest.approx(-425.0 / 600.0)
    assert not terminated


def test_the_truth_is_drawn_as_stated():
    rng = np.random.default_rng(8)
    severities = {"quadratic_damping": (0.002, 0.004), "cubic_stiffness": (0.1, 0.3)}
    drawn = [draw_truth(rng, severities, None) for _ in range(400)]
    for name in MEAN:
        values = np.array([getattr(truth.coefficients, name) for truth in drawn])
        # The cut at 2.5 deviations leaves 0.955 of the standard deviation; five standard errors either way.
        std = {"cn_beta": 0.08, "cn_r": 0.03, "yaw_inertia": 0.004, "mechanical_damping": 0.004}[name]
        assert abs(values.mean() - MEAN[name]) < 5.0 * std / 20.0
        assert values.std() == pytest.approx(0.955 * std, rel=5.0 / np.sqrt(800.0))
        assert np.abs(values - MEAN[name]).max() <= 2.5 * std
    names = [truth.effects[0].name for truth in drawn]
    assert 150 < names.count("cubic_stiffness") < 250
    assert all(
        0.1 <= t.effects[0].coefficient <= 0.3 for t in drawn if t.effects[0].name == "cubic_stiffness"
    )


def test_an_option_leaves_the_other_draws_as_they_are():
    free, given = CampaignEnv(expose_truth=True), CampaignEnv(expose_truth=True)
    drawn = free.reset(seed=9)[1]["truth"]
    found = given.reset(seed=9, options={"truth": {"cn_beta": 0.5}})[1]["truth"]
    assert found == {**drawn, "cn_beta": 0.5}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"preset": "diagnosys"}, "did you mean 'diagnosis'"),
        ({"simulation": "linaer"}, "unknown simulation 'linaer'"),
        ({"preset": "diagnosis", "simulation": "linear"}, "needs the full simulation"),
        ({"springs": ()}, "springs"),
        ({"springs": (99,)}, "there is no spring 99"),
        ({"wind_speeds": (-1.0,)}, "wind_speeds"),
        ({"release_angles_deg": (0.0,)}, "release_angles_deg"),
        ({"durations": (5.0, 5.0)}, "contains a value twice"),
        ({"durations": (float("nan"),)}, "durations"),
        ({"noise_std": 0.0}, "noise_std"),
        ({"sample_rate": 300.0}, "divide"),
        ({"severities": {"cubic_stiffness": (0.1, 0.2)}}, "diagnosis"),
        ({"preset": "diagnosis", "severities": {}}, "at least one"),
        ({"preset": "diagnosis", "severities": {"cubic_stifness": (0.1, 0.2)}}, "did you mean"),
        ({"preset": "diagnosis", "severities": {"cubic_stiffness": (0.2, 0.1)}}, "range"),
        ({"targets": (0.0, 0.05)}, "target"),
        ({"probability": 1.5}, "probability"),
        ({"seconds_per_nat": -1.0}, "seconds_per_nat"),
        ({"max_runs": 0}, "max_runs"),
        ({"rig": "nowhere.toml"}, "nowhere.toml"),
        (
            {"springs": 5},
            r"Campaign-v0: springs = 5 is not a list of numbers; give one number or more in a list",
        ),
        ({"springs": ("soft",)}, r"springs\[0\] = 'soft' is not a whole number"),
        ({"springs": {5: 1.0}}, "springs = .* is not a list"),
        ({"wind_speeds": "12"}, "wind_speeds = '12' is not a list"),
        ({"durations": (1e9,)}, "durations = 1e[+]09 s at .* is longer than a record can be; give at most"),
        ({"targets": (0.01,)}, r"targets = \(0.01,\) has 1 number, not 2; give 2 numbers"),
        ({"targets": 0.01}, "targets = 0.01 is not a list"),
        ({"probability": "sure"}, "probability = 'sure' is not a number above 0 and at most 1"),
        ({"max_runs": 2.5}, "max_runs = 2.5 is not a whole number"),
        ({"max_runs": 1e9}, "max_runs = .* is not a whole number from 1 to 10000"),
        ({"costs": {"setup": -1.0}}, "costs: setup = -1.0 is not a number of 0 or more; .*in s"),
        ({"costs": {"set_up": 1.0}}, "costs has no 'set_up'; did you mean 'setup'"),
        ({"costs": 60.0}, "costs = 60.0 is not a mapping"),
        ({"scatter": 0.1}, "scatter = 0.1 is not a mapping"),
        ({"preset": ["diagnosis"]}, "unknown preset"),
        ({"preset": "diagnosis", "severities": {"cubic_stiffness": 0.1}}, "severities.* is not a list"),
        ({"preset": "diagnosis", "severities": ("cubic_stiffness",)}, "severities = .* is not a mapping"),
        ({"rig": 5}, "rig = 5 is not a path"),
        ({"render_mode": "rgb"}, "unknown render_mode 'rgb'; use one of human, rgb_array"),
    ],
)
def test_a_bad_argument_is_one_clear_line(arguments, said):
    with pytest.raises(TunnelError, match=said) as caught:  # a file that is missing is not a ValueError
        CampaignEnv(**arguments)
    assert "\n" not in str(caught.value)
    assert caught.value.remedy


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"thruth": {}}, "did you mean 'truth'"),
        ({"truth": {"cn_betta": 0.4}}, "did you mean 'cn_beta'"),
        ({"truth": {"yaw_inertia": -1.0}}, "yaw_inertia = -1.0 is not a number above 0; .* in kg m2"),
        ({"truth": {"cn_beta": float("inf")}}, "truth: cn_beta = inf is not a number; .* in 1/rad"),
        (3, "reset options = 3 is not a mapping"),
        ({"truth": 3}, "not a mapping"),
        ({"effects": "cubic_stiffness"}, "Campaign-v0: option effects = 'cubic_stiffness' is not a mapping"),
        ({"effects": {"coulomb": {}}}, "Campaign-v0, option effects: unknown effect 'coulomb'"),
        ({"effects": {"cubic_stiffness": {"coefficient": 0.1}}}, "simulation='full'"),
        ({"effects": {"cubic_stiffness": {"coeff": 1.0}}}, "coeff"),
    ],
)
def test_a_bad_option_is_one_clear_line(options, said):
    with pytest.raises(TunnelError, match=said) as caught:
        CampaignEnv().reset(seed=0, options=options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("action", [[0, 0, 0], [0, 0, 0, 3], [-1, 0, 0, 0], [0.5, 0, 0, 0], 3, "up"])
def test_a_bad_action_is_one_clear_line(action):
    env = CampaignEnv()
    env.reset(seed=0)
    with pytest.raises(TunnelError, match="give four whole numbers") as caught:
        env.step(action)
    assert "\n" not in str(caught.value)
    assert env.known.choices == ()


def test_a_step_before_the_first_reset_is_refused():
    with pytest.raises(TunnelError, match="reset"):
        CampaignEnv().step(OFF)


def test_it_draws_itself_and_prints_itself(capsys):
    env = CampaignEnv(**SHORT, render_mode="rgb_array")
    env.reset(seed=1)
    before = env.render()
    env.step(ON)
    after = env.render()
    assert before.shape == after.shape == (480, 960, 3)
    assert after.dtype == np.uint8
    assert (before != after).mean() > 0.01
    human = CampaignEnv(**SHORT, render_mode="human")
    human.reset(seed=1)
    human.step(ON)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "new campaign"
    assert lines[1].startswith("run 1: spring 5, 15 m/s, 10°, 5 s; Cnβ = 0.")


def test_many_in_one_process_are_the_same_as_one_alone():
    many = gym.make_vec(ID, num_envs=2, vectorization_mode="sync", **SHORT)
    many.reset(seed=[3, 4])
    observations, rewards, *_ = many.step(np.stack([ON, OFF]))
    for place, (seed, action) in enumerate(((3, ON), (4, OFF))):
        alone = make(**SHORT)
        alone.reset(seed=seed)
        observation, reward, *_ = alone.step(action)
        equal({key: value[place] for key, value in observations.items()}, observation)
        assert rewards[place] == reward
    many.close()


@pytest.mark.slow
def test_many_in_processes_of_their_own_are_the_same():
    results = []
    for mode in ("sync", "async"):
        many = gym.make_vec(ID, num_envs=2, vectorization_mode=mode, **SHORT)
        many.reset(seed=7)
        results.append(many.step(np.stack([ON, ON])))
        many.close()
    equal(results[0][0], results[1][0])
    np.testing.assert_array_equal(results[0][1], results[1][1])


WIDE = {"wind_speed": 0.02, "spring_stiffness": 0.01, "mechanical_damping": 0.1, "zero": 0.003}
DRIFTS = {"spring_stiffness_drift": 0.05, "wind_speed_drift_between_runs": -0.04}


def records(actions=(OFF, ON, ON), **arguments):
    env = make(**SHORT, expose_truth=True, max_runs=5, **arguments)
    env.reset(seed=11, options={"truth": TRUTH})
    for action in actions:
        info = env.step(action)[4]
    return [run.record.yaw_rad for run in env.unwrapped.campaign.runs], env.unwrapped.campaign, info["truth"]


def test_scatter_is_hidden_and_leaves_the_noise_of_every_run():
    bare, stated, truth = records()
    assert "runs" not in truth
    still, _, _ = records(scatter={"wind_speed": 0.02})
    np.testing.assert_array_equal(still[0], bare[0])  # wind off
    assert np.max(np.abs(still[1] - bare[1])) > 1e-4
    moved, labelled, truth = records(scatter={"zero": 0.003})
    zeros = [run["zero"] for run in truth["runs"]]
    for one, other, zero in zip(moved, bare, zeros, strict=True):
        np.testing.assert_allclose(one - other, zero, rtol=0.0, atol=1e-12)
    assert len(set(zeros)) == 3
    assert [(r.wind_speed, r.spring_stiffness) for r in labelled.runs] == [
        (r.wind_speed, r.spring_stiffness) for r in stated.runs
    ]


def test_scattering_runs_of_linear_theory_are_those_of_the_full_simulation():
    scatter = {**WIDE, **DRIFTS}
    (linear, _, truth), (full, _, same) = (
        records(scatter=scatter, simulation=how) for how in ("linear", "full")
    )
    assert truth["runs"] == same["runs"]
    for one, other in zip(linear, full, strict=True):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-7)
    bare, _, _ = records()
    assert all(np.max(np.abs(one - other)) > 1e-3 for one, other in zip(linear, bare, strict=True))


def test_a_drift_is_complete_at_the_last_run():
    _, _, truth = records((OFF,) * 5, scatter=DRIFTS)
    shares = np.arange(5) / 4.0
    for run, share in zip(truth["runs"], shares, strict=True):
        assert run == {"wind_speed": -0.04 * share, "spring_stiffness": 0.05 * share}


@pytest.mark.parametrize(
    ("scatter", "said"),
    [
        ({"wind": 0.1}, "scatter has no 'wind'; use one of"),
        ({"wind_speed": 2.0}, "wind_speed = 2.0 is out of range"),
    ],
)
def test_a_bad_scatter_is_refused(scatter, said):
    with pytest.raises(TunnelError, match=said):
        make(scatter=scatter)


@pytest.mark.parametrize(
    ("argument", "said"),
    [
        ("durration", "did you mean 'durations'?"),
        ("max_rnus", "did you mean 'max_runs'?"),
        ("qq", "use one of costs, "),
    ],
)
def test_an_unknown_argument_is_one_line(argument, said):
    with pytest.raises(ValueError, match="Campaign-v0: unknown argument") as refusal:
        gym.make("tunnel_sim/Campaign-v0", **{argument: 1.0})
    assert isinstance(refusal.value, TunnelError)
    assert f"unknown argument '{argument}'; {said}" in str(refusal.value)
