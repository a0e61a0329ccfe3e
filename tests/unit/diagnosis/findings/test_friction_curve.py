"""Friction against rate: the law's band against draws, and points that show the true law beside a wrong one."""

import numpy as np
import pytest
from scipy.special import chdtrc

from diagnosis.findings.friction_curve import friction_curve
from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.problem import Problem
from diagnosis.model.parameters import Point
from diagnosis.model.similarity import AS_MEASURED, Similarity
from tests.support.gap_campaigns import campaign, nominal
from tunnel_sim.effects import effect_class, effect_from

FRICTION = effect_class("coulomb_friction")
TRUTH = effect_from("coulomb_friction", {"friction_moment": 0.004, "peak": 1.0, "peak_rate": 0.6})


@pytest.fixture(scope="module")
def records():
    return campaign(TRUTH, damping=0.003, duration=10.0)


def fitted(records, *forms):
    base = nominal(records)
    problem = Problem(
        base.problem.data, (FRICTION,), free_forms=tuple(f"coulomb_friction.{f}" for f in forms)
    )
    start = np.concatenate([base.point.common, [0.004, 0.5, 0.5][: 1 + len(forms)]])
    return base, fit(problem, Point(start, base.point.per_run))


@pytest.fixture(scope="module")
def plain(records):
    return fitted(records)


@pytest.fixture(scope="module")
def stribeck(records):
    return fitted(records, "peak", "peak_rate")[1]


def off(curve, law):
    """Distance of the points from a law, in their standard deviations."""
    at = np.array([point.rate_rad_s for point in curve.points])
    moment, std = (np.array([getattr(point, name) for point in curve.points]) for name in ("moment", "std"))
    return (moment - law(at)) / std


def test_the_points_show_the_true_law_where_the_law_fitted_is_another(plain):
    curve = friction_curve(plain[1], AS_MEASURED)
    assert (curve.effect, curve.unit) == ("coulomb_friction", "N m")
    assert np.ptp(curve.moment) == 0.0  # plain dry friction: a horizontal line
    from_line = off(curve, lambda rate: np.interp(rate, curve.rate_rad_s, curve.moment))
    slow = [point for point in curve.points if 0.3 < point.rate_rad_s < 0.7]  # within the peak
    fast = [point for point in curve.points if 1.5 < point.rate_rad_s < 3.5]  # beyond it
    assert chdtrc(from_line.size, from_line @ from_line) < 1e-4
    assert np.mean([p.moment for p in slow]) > 1.15 * np.mean([p.moment for p in fast])


def test_the_points_agree_with_the_law_that_is_the_truth(stribeck):
    curve = friction_curve(stribeck, AS_MEASURED)
    assert np.sqrt(np.mean(off(curve, TRUTH.sliding) ** 2)) < 1.6
    assert sum(point.strokes for point in curve.points) > 60
    rates = np.array(curve.rate_rad_s)
    far = np.abs(np.array(curve.moment) - TRUTH.sliding(rates)) / np.array(curve.std)
    assert np.max(far) < 4.0


def test_the_band_is_that_of_draws_of_the_parameters(stribeck):
    curve = friction_curve(stribeck, AS_MEASURED)
    rng = np.random.default_rng(8)
    drawn = rng.multivariate_normal(stribeck.point.common, stribeck.stated_covariance, 4000)
    laws = [stribeck.problem.effects_at(one)[0].sliding(np.array(curve.rate_rad_s)) for one in drawn]
    np.testing.assert_allclose(np.std(laws, axis=0), curve.std, rtol=0.1)


def test_a_curve_is_in_the_units_of_the_rig_and_none_without_friction(plain):
    base, found = plain
    own, similar = (friction_curve(found, one) for one in (AS_MEASURED, Similarity(time=2.0, moment=0.5)))
    assert np.array(similar.rate_rad_s) == pytest.approx(2.0 * np.array(own.rate_rad_s), rel=1e-5)
    assert np.array(similar.moment) == pytest.approx(2.0 * np.array(own.moment), rel=1e-5)
    assert [one.strokes for one in similar.points] == [one.strokes for one in own.points]
    assert friction_curve(base, AS_MEASURED) is None


def test_the_friction_at_a_steady_rate_is_that_of_each_form():
    rate = np.array([0.1, 2.0, 7.0])
    forms = {
        (): [1.0, 1.0, 1.0],
        (("exponent", 0.3),): [(0.05) ** 0.3, 1.0, 3.5**0.3],
        (("saturation", 0.1),): np.tanh([1.0, 20.0, 70.0]),
        (("peak", 1.0), ("peak_rate", 0.1)): [1.0 + np.exp(-1.0), 1.0, 1.0],
        (("presliding", 0.01),): [1.0, 1.0, 1.0],
    }
    for form, factor in forms.items():
        effect = effect_from("coulomb_friction", {"friction_moment": 0.02, **dict(form)})
        np.testing.assert_allclose(effect.sliding(rate), 0.02 * np.array(factor))
