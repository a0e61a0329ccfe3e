"""The policies of ``Campaign-v0`` and the arithmetic of their comparison."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

from docs.studies import policies
from docs.studies.campaign_policies import (
    CONTESTS,
    SEEDS,
    fill,
    from_csv,
    median_interval,
    play,
)
from docs.studies.policies import best_rivals, expected_gain, greedy, run_campaign, scripted, separating
from tunnel_lab.envs.campaign import CampaignEnv

DOCS = Path(__file__).parents[4] / "docs"
SMALL = {
    "springs": (3, 5),
    "wind_speeds": (20.0, 0.0),
    "release_angles_deg": (5.0, 10.0),
    "durations": (5.0, 10.0),
}


def begun(*actions, seed=0, **arguments):
    env = CampaignEnv(**arguments)
    env.reset(seed=seed)
    for action in actions:
        env.step(np.array(action))
    return env


def test_the_script_takes_springs_in_turn_and_on_each_the_wind_off_first():
    env = begun(**SMALL)
    seen = []
    for _ in range(5):
        action = scripted(env.known)
        seen.append(action)
        env.step(np.array(action))
    assert seen == [(0, 1, 1, 1), (0, 0, 1, 1), (1, 1, 1, 1), (1, 0, 1, 1), (0, 1, 1, 1)]


def test_greedy_takes_the_largest_expected_gain_for_its_time():
    for actions in ((), [(0, 1, 1, 1)], [(1, 0, 1, 1), (1, 1, 1, 1)]):
        known = begun(*actions, **SMALL).known
        menu = known.conditions.menu
        values = {}
        for action in menu.actions():
            choice = menu.choice(action)
            spring = known.last is None or known.last.spring != choice.spring
            speed = known.last is None or known.last.wind_speed != choice.wind_speed
            time = 60.0 + choice.duration + 300.0 * spring + 60.0 * speed
            values[action] = expected_gain(known, choice) / time
        assert greedy(known) == max(values, key=lambda action: values[action])
        assert len(set(values.values())) > 4


def test_greedy_brings_what_it_promises():
    """Over a few seeds the information that the chosen run brings is the one expected, to a fifth."""
    expected, brought = [], []
    for seed in range(6):
        env = begun((0, 1, 1, 1), seed=seed, **SMALL)
        action = greedy(env.known)
        expected.append(expected_gain(env.known, env.known.conditions.menu.choice(action)))
        brought.append(env.step(np.array(action))[-1]["step_information_nats"])
    assert np.mean(brought) == pytest.approx(np.mean(expected), rel=0.2)


def test_greedy_leaves_out_runs_that_might_not_come_back():
    known = begun(springs=(1,), wind_speeds=(20.0, 0.0), durations=(5.0,)).known
    assert expected_gain(known, known.conditions.menu.choice((0, 0, 2, 0))) == 0.0
    assert greedy(known) == scripted(known)


def test_separating_follows_the_script_until_there_is_something_to_separate():
    env = begun(preset="diagnosis", durations=(5.0,))
    assert separating(env.known) == scripted(env.known)
    env.step(np.array(scripted(env.known)))
    assert separating(env.known) == scripted(env.known)  # no wind yet


def test_separating_prefers_the_run_that_distinguishes_the_rivals(monkeypatch):
    """A damping effect seen at one speed alone: air or rig? A run with the wind off shows it, for a minute more."""
    env = CampaignEnv(
        preset="diagnosis",
        springs=(5,),
        wind_speeds=(10.0, 0.0),
        release_angles_deg=(20.0,),
        durations=(5.0,),
        noise_std=0.002,
        severities={"quadratic_damping": (0.003, 0.006), "nonlinear_yaw_damping": (60.0, 120.0)},
    )
    env.reset(seed=0, options={"effects": {"quadratic_damping": {"coefficient": 0.004}}})
    env.step(np.array([0, 0, 0, 0]))
    rivals = best_rivals(env.known.study)
    assert rivals is not None
    assert {fit.problem.effects[0].name for fit in rivals} == {"quadratic_damping", "nonlinear_yaw_damping"}
    assert separating(env.known) == (0, 1, 0, 0)
    # The wind off costs 125 s instead of 65 s, and the log-likelihood ratio grows with the separation's square.
    for still, chosen in ((1.3, 0), (1.5, 1)):
        apart = {10.0: 1.0, 0.0: still}
        monkeypatch.setattr(policies, "separation", lambda *given, apart=apart: apart[given[2].wind_speed])
        assert separating(env.known) == (0, chosen, 0, 0)


@pytest.mark.slow
def test_an_episode_is_played_to_its_end():
    env = CampaignEnv(**SMALL)
    info = run_campaign(env, greedy, seed=3)
    assert info["runs"] == len(info["campaign"].runs) <= 24
    again = run_campaign(env, greedy, seed=3)
    assert again["rig_time_s"] == info["rig_time_s"]


@pytest.mark.parametrize("count", [6, 17, 50, 100])
def test_the_interval_of_a_median_covers_95_percent_and_not_much_more(count):
    _, low, high = median_interval(np.arange(1.0, count + 1.0))
    assert low == count + 1 - high
    missed = 2.0 * binom.cdf(int(low) - 1, count, 0.5)
    tighter = 2.0 * binom.cdf(int(low), count, 0.5)
    assert missed <= 0.05 < tighter


def rows():
    return from_csv((DOCS / "campaign-design.csv").read_text(encoding="utf-8"))


def test_the_page_shows_what_the_table_of_episodes_holds():
    page = (DOCS / "campaign-design.md").read_text(encoding="utf-8")
    assert fill(page, rows()) == page
    changed = [replace(row, runs=row.runs + 1) for row in rows()]
    assert fill(page, changed) != page


def test_the_table_of_episodes_is_complete():
    found = {(row.preset, row.policy, row.seed) for row in rows()}
    assert found == {
        (preset, policy, seed)
        for preset, policies in CONTESTS.items()
        for policy in policies
        for seed in range(SEEDS[preset])
    }
    assert all(count >= 50 for count in SEEDS.values())
    assert not any(row.on_first for row in rows() if row.preset == "identification")


@pytest.mark.slow
@pytest.mark.parametrize(("preset", "seeds"), [("identification", (0, 1, 2)), ("diagnosis", (0, 2))])
def test_episodes_of_the_page_are_played_again(preset, seeds):
    written = {(row.preset, row.policy, row.seed): row for row in rows()}
    for policy in CONTESTS[preset]:
        for seed in seeds:
            row, shown = play(preset, policy, seed), written[preset, policy, seed]
            assert replace(row, cn_beta_error=0.0, cn_r_error=0.0) == replace(
                shown, cn_beta_error=0.0, cn_r_error=0.0
            )
            assert row.cn_beta_error == pytest.approx(shown.cn_beta_error, abs=0.01)
            assert row.cn_r_error == pytest.approx(shown.cn_r_error, abs=0.01)
