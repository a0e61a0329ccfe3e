"""The posterior on its grid: Fisher's where the record is long, a plain sum where it is short."""

import itertools
import json

import numpy as np
import pytest

from identification import Estimate, identify
from identification.estimators.bayesian import shared_moments
from identification.show.quantity import Quantity
from identification.statistics import determined
from tests.reference.free_decays import TWELVE, Setting, campaign, damped_cosine
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("unexamined")


def test_long_records_give_output_errors_values_and_deviations():
    data = campaign(TWELVE[:4], noise=5e-4, rng=np.random.default_rng(8))
    ours, theirs = identify(data, "bayesian"), identify(data, "output_error")
    for run, other in zip(ours.runs, theirs.runs, strict=True):
        for name in ("omega_n", "zeta"):
            one, two = getattr(run, name), getattr(other, name)
            assert abs(one.value - two.value) < 0.4 * two.std  # what block means leave out moves it by 0.1
            assert one.std == pytest.approx(two.std, rel=0.03)
            assert one.interval == pytest.approx(
                (one.value - 1.96 * one.std, one.value + 1.96 * one.std), rel=1e-3
            )
    for name in ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping"):
        one, two = getattr(ours, name), getattr(theirs, name)
        assert abs(one.value - two.value) < 0.3 * two.std
        assert one.std == pytest.approx(two.std, rel=0.1)


def test_a_short_record_matches_a_plain_sum():
    """Known noise, one cycle of 24 samples: a dense fixed grid, least squares and differences at every point."""
    rng, noise = np.random.default_rng(9), 0.03
    clock = np.arange(24) / 24.0
    yaw = damped_cosine(clock, 1.0, 40.0, 0.4, 0.0) + noise * rng.standard_normal(24)
    run = Run("r", Record(clock, yaw), 0.0)
    data = Campaign("short", RigProperties(), SensorProperties(24.0, None, noise), (run,))
    found = identify(data, "bayesian").runs[0]
    weights, zetas, omegas = [], [], []
    for rate, stiffness in itertools.product(np.linspace(-1.2, 3.2, 56), np.linspace(24.0, 60.0, 56)):
        linear = np.array(
            [
                damped_cosine(clock, 2.0 * rate, stiffness, 1.0, 0.0),
                damped_cosine(clock, 2.0 * rate, stiffness, 0.0, 1.0),
                np.ones_like(clock),
            ]
        ).T
        state = np.linalg.lstsq(linear, yaw, rcond=None)[0]
        left = yaw - linear @ state

        def motion(a, k, state=state):
            return damped_cosine(clock, 2.0 * a, k, state[0], state[1])

        by_rate = (motion(rate + 1e-5, stiffness) - motion(rate - 1e-5, stiffness)) / 2e-5
        by_stiffness = (motion(rate, stiffness + 1e-4) - motion(rate, stiffness - 1e-4)) / 2e-4
        own = np.column_stack((by_rate, by_stiffness))
        rest = own - linear @ np.linalg.lstsq(linear, own, rcond=None)[0]
        prior = np.sqrt(np.linalg.det(rest.T @ rest))
        weights.append(np.exp(-0.5 * left @ left / noise**2 + 10.0) * prior)
        zetas.append(rate / np.sqrt(stiffness))
        omegas.append(np.sqrt(stiffness))
    weights = np.array(weights) / np.sum(weights)
    for quantity, values in ((found.zeta, np.array(zetas)), (found.omega_n, np.array(omegas))):
        mean = weights @ values
        spread = np.sqrt(weights @ (values - mean) ** 2)
        assert quantity.value == pytest.approx(mean, abs=0.01 * spread)
        assert quantity.std == pytest.approx(spread, rel=0.01)


def test_intervals_go_through_json_and_are_absent_where_there_are_none():
    data = campaign((Setting(16.12, 0.0),), noise=5e-4, rng=np.random.default_rng(8), duration=5.0)
    estimate = identify(data, "bayesian")
    document = json.loads(json.dumps(estimate.to_json_dict()))
    assert len(document["runs"][0]["zeta"]["interval"]) == 2
    assert Estimate.from_json_dict(document) == estimate
    assert "interval" not in Quantity(1.0, 0.1, "1").to_json_dict()


class Spike:
    """A likelihood far narrower than its proposal, and away from it."""

    def log_likelihood_at(self, points):
        return -1e12 * np.sum((points - 2.0) ** 2, axis=1)


def test_draws_of_which_one_counts_determine_nothing_and_raise_nothing():
    rng = np.random.default_rng(1)
    _, covariance = shared_moments([Spike()], [np.eye(2)], np.zeros(2), np.eye(2), rng)
    assert not determined(covariance)
