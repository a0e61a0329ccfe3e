"""The belief of a campaign in the making: against the bound, against brute force, and its limits."""

from dataclasses import replace

import numpy as np
import pytest

from identification import identify
from identification.campaign.belief import (
    expected_belief,
    information_gain,
    prior_belief,
    run_link,
    update_belief,
)
from identification.estimate import PARAMETERS
from identification.signal.decay_fit import Reading, SharedPrior, fit_decays
from identification.signal.run_fit import identify_run
from identification.uncertainty.cramer_rao import campaign_bound
from tests.reference.free_decays import Setting, Truth, angle_of, campaign

NOISE = 0.01
MEAN = {"cn_beta": 0.45, "cn_r": -0.12, "yaw_inertia": 0.1, "mechanical_damping": 0.016}
STD = {"cn_beta": 0.08, "cn_r": 0.03, "yaw_inertia": 0.004, "mechanical_damping": 0.004}
WIDE = {name: 1e3 * std for name, std in STD.items()}
SETTINGS = (Setting(16.12, 0.0), Setting(16.12, 15.0), Setting(44.84, 20.0))


def data(settings=SETTINGS, seed=3, noise=NOISE):
    return campaign(settings, duration=8.0, rate=100.0, noise=noise, rng=np.random.default_rng(seed))


def updated(found, prior):
    fits = [identify_run(run, found.sensor) for run in found.runs]
    links = [run_link(run, found.rig) for run in found.runs]
    return update_belief(prior, links, [(item.reading, item.fit) for item in fits], NOISE)


def test_the_prior_is_what_was_given():
    belief = prior_belief(MEAN, STD)
    np.testing.assert_allclose(belief.values, [MEAN[name] for name in PARAMETERS], rtol=1e-12)
    np.testing.assert_allclose(belief.covariance, np.diag([STD[n] ** 2 for n in PARAMETERS]), atol=1e-12)
    assert belief.relative_std("cn_beta") == pytest.approx(0.08 / 0.45)


def test_with_hardly_a_prior_it_is_the_maximum_likelihood_estimate_and_its_bound():
    found = data()
    belief = updated(found, prior_belief(MEAN, WIDE))
    estimate = identify(found)
    for place, name in enumerate(PARAMETERS):
        assert belief.values[place] == pytest.approx(getattr(estimate, name).value, rel=1e-3)
        assert belief.std(name) == pytest.approx(getattr(estimate, name).std, rel=0.05)
    truth = Truth()
    bound = campaign_bound(
        found,
        truth,
        noise_std=NOISE,
        initial_states=[(setting.release, setting.rate) for setting in SETTINGS],
    )
    for name in PARAMETERS:
        assert belief.std(name) == pytest.approx(bound.std(name), rel=0.1)


def test_one_run_alone_moves_only_what_it_shows():
    prior = prior_belief(MEAN, STD)
    calm = updated(data(SETTINGS[:1]), prior)
    # Nothing about the air; as Izz moves by half its prior's deviation, Cnβ = φ₂ Izz is scaled by 2 %, no more.
    assert abs(information_gain(prior, calm)) < 0.05
    assert calm.std("yaw_inertia") < 0.1 * STD["yaw_inertia"]
    windy = updated(data(SETTINGS[1:2]), prior)
    assert information_gain(prior, windy) > 0.1


def test_what_is_expected_of_a_run_is_what_it_brings():
    truth = Truth()
    exact = {name: getattr(truth, name) for name in PARAMETERS}
    before = updated(data(SETTINGS[:1]), prior_belief(exact, STD))
    found = data(SETTINGS[:2])
    setting = SETTINGS[1]
    time = found.runs[1].record.time_s - found.runs[1].record.time_s[0]
    expected = expected_belief(before, run_link(found.runs[1], found.rig), time, setting.release, NOISE)
    after = updated(found, prior_belief(exact, STD))
    assert expected is not None
    for name in PARAMETERS:
        assert expected.std(name) == pytest.approx(after.std(name), rel=0.1)


def test_the_expected_information_matches_brute_force():
    """Finite differences of the closed-form decay, all eleven unknowns, the prior added, by plain inversion."""
    settings = tuple(Setting(s.spring, s.speed, 0.3, 0.0) for s in SETTINGS)
    found = data(settings)
    time = found.runs[0].record.time_s - found.runs[0].record.time_s[0]
    belief = prior_belief(MEAN, STD)
    for run, setting in zip(found.runs, settings, strict=True):
        after = expected_belief(belief, run_link(run, found.rig), time, setting.release, NOISE)
        assert after is not None
        belief = after

    def model(point):
        truth = Truth(*point[:4])
        return np.concatenate(
            [
                angle_of(Setting(s.spring, s.speed, point[5 + 2 * i], point[6 + 2 * i]), truth, time)
                + point[4]
                for i, s in enumerate(settings)
            ]
        )

    order = [MEAN[name] for name in ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping")]
    point = np.array([*order, 0.0, *[value for s in settings for value in (s.release, 0.0)]])
    steps = 1e-6 * np.eye(point.size)
    jacobian = np.array([(model(point + step) - model(point - step)) / 2e-6 for step in steps]).T
    information = jacobian.T @ jacobian / NOISE**2
    information[:4, :4] += np.diag(
        [STD[n] ** -2 for n in ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping")]
    )
    expected = np.linalg.inv(information)[:2, :2]
    np.testing.assert_allclose(belief.covariance[:2, :2], expected, rtol=1e-4)
    wide = prior_belief(MEAN, STD).covariance[:2, :2]
    gain = 0.5 * np.log(np.linalg.det(wide) / np.linalg.det(expected))
    assert information_gain(prior_belief(MEAN, STD), belief) == pytest.approx(gain, rel=1e-4)


def test_a_run_that_might_not_come_back_is_not_predicted():
    found = data(SETTINGS[2:])
    belief, time = prior_belief(MEAN, STD), np.arange(500) / 100.0
    for spring, comes_back in ((0.98, False), (44.84, True)):
        link = run_link(replace(found.runs[0], spring_stiffness=spring), found.rig)
        assert (expected_belief(belief, link, time, 0.3, NOISE) is not None) == comes_back


def test_the_prior_of_a_fit_is_worth_its_information():
    """A prior as sharp as the run pulls the estimate half the way."""
    found = data((Setting(16.12, 0.0),))
    reading = Reading.from_record(found.runs[0].record)
    own = identify_run(found.runs[0], found.sensor).fit
    free = fit_decays([reading], [np.eye(2)], np.array([own.decay.rate, own.decay.stiffness]))
    information, _ = free.runs[0].reduced("shared")
    known = information[:2, :2]
    away = np.linalg.cholesky(np.linalg.inv(known)) @ np.array([NOISE, -NOISE])
    pulled = fit_decays(
        [reading],
        [np.eye(2)],
        free.parameters,
        zero=free.zero,
        prior=SharedPrior(free.parameters + away, known),
    )
    np.testing.assert_allclose(pulled.parameters - free.parameters, 0.5 * away, rtol=0.05)
    assert pulled.converged


def test_nothing_made_nothing_learnt():
    prior = prior_belief(MEAN, STD)
    assert update_belief(prior, [], [], NOISE) is prior
