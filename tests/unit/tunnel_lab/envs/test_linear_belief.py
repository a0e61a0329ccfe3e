"""Campaigns by linear theory: against the full simulation of the same seed, and where runs hold no information."""

from __future__ import annotations

import numpy as np
import pytest

from identification.campaign.belief import linear_belief, linear_run, prior_belief, shows_a_decay
from identification.signal.free_decay import Decay
from identification.statistics import scaled_solve
from tunnel_lab.envs.campaign import CampaignEnv
from tunnel_lab.envs.session import MEAN, STD

ACTIONS = ([0, 0, 2, 0], [0, 3, 2, 0], [1, 2, 1, 0])


@pytest.mark.parametrize("seed", [1, 2])
def test_a_campaign_is_that_of_the_full_simulation_to_first_order(seed):
    """The same truth and noise: the records agree to 1e-8 rad, the estimates to a third of a deviation."""
    linear, full = (CampaignEnv(simulation=kind, durations=(8.0,)) for kind in ("linear", "full"))
    for env in (linear, full):
        env.reset(seed=seed)
    for action in ACTIONS:
        infos = [env.step(np.array(action))[-1] for env in (linear, full)]
        assert [info["status"] for info in infos] == ["ok", "ok"]
    for one, other in zip(linear.campaign.runs, full.campaign.runs, strict=True):
        np.testing.assert_allclose(one.record.yaw_rad, other.record.yaw_rad, atol=1e-8)
        assert (one.id, one.wind_speed, one.air_density) == (other.id, other.wind_speed, other.air_density)
    first, second = linear.known.belief, full.known.belief
    deviations = np.sqrt(np.diag(second.covariance))
    assert np.all(np.abs(first.values - second.values) < 0.33 * deviations)
    np.testing.assert_allclose(np.sqrt(np.diag(first.covariance)), deviations, rtol=0.15)
    assert infos[0]["total_information_nats"] == pytest.approx(infos[1]["total_information_nats"], rel=0.1)


def test_without_noise_a_run_gives_its_decay_and_zero():
    time, decay = np.arange(800) / 100.0, Decay(0.2, 60.0)
    run = linear_run(np.eye(2, 4), time, decay, 0.1, 0.003, np.zeros(800))
    np.testing.assert_allclose(run.found, [0.2, 60.0, 0.003])


def test_the_belief_is_the_prior_without_information_and_moves_with_it():
    prior = prior_belief(MEAN, STD)
    assert linear_belief(prior, [], 0.05) is prior
    env = CampaignEnv()
    env.reset(seed=0, options={"truth": {"cn_beta": 0.6}})
    for action in ACTIONS:
        env.step(np.array(action))
    assert env.known.belief.values[0] == pytest.approx(0.6, abs=4.0 * env.known.belief.std("cn_beta"))


def test_what_does_not_stand_out_or_come_back_gives_no_information():
    assert shows_a_decay(np.full(100, 0.1), 0.1)
    assert not shows_a_decay(np.full(100, 0.05), 0.1)
    weak = CampaignEnv(noise_std=2.0)
    weak.reset(seed=0)
    assert weak.step(np.array([0, 0, 0, 0]))[-1]["status"].startswith("no information")
    assert weak.known.beliefs == (weak.known.prior,)


def test_no_action_causes_a_warning():
    """Warnings are errors here; weak, fast and diverging runs are among the actions."""
    for noise in (1e-6, 0.3):
        env = CampaignEnv(
            noise_std=noise,
            springs=(1, 3, 8),
            wind_speeds=(0.0, 20.0, 40.0),
            release_angles_deg=(0.1, 10.0, 50.0),
            durations=(0.5, 5.0),
            targets=(1e-9, 1e-9),
            max_runs=40,
        )
        env.reset(seed=3)
        env.action_space.seed(3)
        for _ in range(40):
            observation, reward, *_ = env.step(env.action_space.sample())
            assert env.observation_space.contains(observation)
            assert np.isfinite(reward)


@pytest.mark.parametrize("size", [2, 3])
def test_a_negative_diagonal_is_refused_before_its_root_is_taken(size):
    matrix = np.eye(size)
    matrix[1, 1] = -1e-9
    with pytest.raises(np.linalg.LinAlgError, match="does not influence"):
        scaled_solve(matrix, np.ones(size))
