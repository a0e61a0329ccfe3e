"""The trained agent of ``Campaign-v0``: its network, its file, its score and its page."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from docs.studies.campaign_agent import train, write_score
from docs.studies.campaign_policies import SEEDS, from_csv, median_interval
from docs.studies.policies import run_campaign, scripted
from docs.studies.trained_policy import (
    FEATURES,
    Agent,
    features,
    menu_text,
    read_agent,
    stored_agent,
    trained,
)
from tunnel_lab.envs.campaign import CampaignEnv
from tunnel_sim.vocabulary.errors import TunnelError

DOCS = Path(__file__).parents[4] / "docs"


def rows(path, policy):
    found = from_csv((DOCS / path).read_text(encoding="utf-8"))
    return sorted((row for row in found if row.policy == policy), key=lambda row: row.seed)


def begun(**arguments):
    env = CampaignEnv(**arguments)
    observation, _ = env.reset(seed=0)
    return env, observation


def hand_made(env):
    """Outputs are the features 8, 9 and so on times the entry's number, so the action follows from their signs."""
    shape = env.conditions.menu.shape
    last = np.zeros((sum(shape), FEATURES))
    start = 0
    for part, size in enumerate(shape):
        last[start : start + size, 8 + part] = np.arange(size)
        start += size
    eye, none = np.eye(FEATURES), np.zeros(FEATURES)
    layers = ((eye, none), (eye, none), (last, np.zeros(sum(shape))))
    return Agent(none, np.ones(FEATURES), layers, menu_text(env.conditions.menu))


def test_features_are_deviations_and_correlations():
    env, _ = begun()
    env.step(np.array([0, 3, 2, 1]))
    found = features(env.known.observation())
    belief = env.known.belief
    np.testing.assert_allclose(found[:4], belief.values)
    np.testing.assert_allclose(np.exp(found[4:8]), np.sqrt(np.diag(belief.covariance)))
    pair = belief.covariance[0, 1] / np.sqrt(belief.covariance[0, 0] * belief.covariance[1, 1])
    assert found[8] == pytest.approx(pair)
    assert found.shape == (FEATURES,)
    assert found[-2:].tolist() == [1.0, env.known.rig_time]


def test_the_action_is_the_largest_output_of_each_part():
    env, observation = begun()
    agent = hand_made(env)
    covariance = np.eye(4)
    signs = {(0, 1): 0.5, (0, 2): -0.5, (0, 3): 0.5, (1, 2): -0.5}  # the first four correlations
    for (row, column), value in signs.items():
        covariance[row, column] = covariance[column, row] = value
    shown = observation | {"covariance": covariance.ravel()}
    assert agent.action(shown, env.conditions.menu) == (3, 0, 2, 0)


def test_an_agent_survives_its_file_and_nothing_else_is_one(tmp_path):
    env, observation = begun()
    agent, path = hand_made(env), tmp_path / "a.safetensors"
    path.write_bytes(agent.to_bytes())
    again = read_agent(path)
    assert again.menu == agent.menu
    assert again.action(observation, env.conditions.menu) == agent.action(observation, env.conditions.menu)
    for content in (b"", b"not an agent", (1 << 60).to_bytes(8, "little")):
        path.write_bytes(content)
        with pytest.raises(TunnelError, match="is not an agent"):
            read_agent(path)


def test_another_menu_is_refused():
    env, _ = begun(durations=(5.0,))
    with pytest.raises(TunnelError, match="trained with another menu"):
        trained(env.known)


def test_the_stored_agent_is_small_and_plays_better_than_the_script():
    env = CampaignEnv()
    assert len(stored_agent().to_bytes()) < 40_000
    assert json.loads(stored_agent().menu)["wind_speeds"] == list(env.conditions.menu.wind_speeds)
    times = {
        policy: np.array([run_campaign(env, policy, seed=seed)["rig_time_s"] for seed in range(100, 110)])
        for policy in (scripted, trained)
    }
    assert np.median(times[trained]) < np.median(times[scripted])


def test_its_score_is_better_than_the_scripts_beyond_chance():
    own, script = rows("how-to/train-an-agent.csv", "trained"), rows("campaign-design.csv", "scripted")
    script = [row for row in script if row.preset == "identification"]
    assert [row.seed for row in own] == [row.seed for row in script] == list(range(SEEDS["identification"]))
    difference = [one.rig_time_s - other.rig_time_s for one, other in zip(own, script, strict=True)]
    assert median_interval(np.array(difference))[2] < 0.0
    assert sum(row.reached for row in own) >= sum(row.reached for row in script)


def test_another_agents_score_stands_beside_the_first(tmp_path):
    for name in ("campaign-design.csv", "how-to/train-an-agent.csv", "how-to/train-an-agent.md"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(DOCS / name, tmp_path / name)
    first = rows("how-to/train-an-agent.csv", "trained")
    for hours in (1.0, 2.0):  # the second score replaces the first
        write_score(
            tmp_path, [replace(row, policy="trained, seed 7", rig_time_s=3600.0 * hours) for row in first]
        )
    stored = from_csv((tmp_path / "how-to/train-an-agent.csv").read_text(encoding="utf-8"))
    assert [row for row in stored if row.policy == "trained"] == first
    assert {row.rig_time_s for row in stored if row.policy == "trained, seed 7"} == {7200.0}
    page = (tmp_path / "how-to/train-an-agent.md").read_text(encoding="utf-8")
    assert "| trained, seed 7 | 7 (6 to 8) | 120.0 (120.0 to 120.0) |" in page


@pytest.mark.slow
def test_training_gives_an_agent_for_the_menu_of_the_preset():
    agent = train(2048, seed=3)
    env, observation = begun()
    assert env.conditions.menu.choice(agent.action(observation, env.conditions.menu)).spring in (3, 5, 6, 8)
    assert np.all(agent.variance > 0.0)


@pytest.mark.slow
def test_episodes_of_the_score_are_played_again():
    from docs.studies.campaign_policies import play

    written = rows("how-to/train-an-agent.csv", "trained")
    for seed in (0, 1):
        row = play("identification", "trained", seed, trained)
        assert (row.runs, row.rig_time_s, row.reached) == (
            written[seed].runs, written[seed].rig_time_s, written[seed].reached
        )  # fmt: skip
