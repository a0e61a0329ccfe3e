"""Damping within the bounds of a passive rig: against SciPy's truncated normal, and on decays of known loss."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import truncnorm

from diagnosis.answer.held_out import one_more
from diagnosis.findings.averaged_coefficients import coefficients, possible_answers
from diagnosis.findings.cause_sizes import decay_of_swing
from diagnosis.findings.passive import truncated, within_bounds
from diagnosis.findings.trade_off import least_separated
from diagnosis.likelihood.least_squares import fit_at
from diagnosis.model.parameters import Point
from diagnosis.search.investigate import nominal_study
from identification.show.quantity import Quantity
from tests.reference.free_decays import Setting, campaign
from tests.support.gap_campaigns import answer
from tunnel_sim.effects import effect_class

FRICTION = effect_class("coulomb_friction")
HYSTERESIS = effect_class("structural_damping")


@pytest.mark.parametrize(
    ("value", "std", "upper"),
    [(0.0, 0.1, 0.0055), (0.01, 0.002, 0.0101), (0.5, 1.0, 1.0), (0.002, 0.0005, 10.0)],
)
def test_the_distribution_within_bounds_is_that_of_scipy(value, std, upper):
    found = truncated(value, std, upper, 0.95)
    truth = truncnorm(-value / std, (upper - value) / std, value, std)
    assert found.mean == pytest.approx(truth.mean(), rel=1e-6)
    assert found.std == pytest.approx(truth.std(), rel=1e-4)
    assert found.interval == pytest.approx(truth.interval(0.95), rel=1e-6)


def test_an_unknown_value_is_uniform_within_its_bounds():
    found = truncated(0.0, 1e9, 12.0, 0.95)
    assert (found.mean, found.std) == pytest.approx((6.0, np.sqrt(12.0)))
    assert found.interval == pytest.approx((0.3, 11.7))


def decays(*speeds):
    """Decays without a stated spring, ζ = 0.0055 in still air, whose answer has an idle dry friction."""
    settings = tuple(Setting(16.12, speed) for speed in speeds)
    data = campaign(settings, rng=np.random.default_rng(3), noise=5e-4, duration=6.0, rate=100.0)
    bare = replace(data, runs=tuple(replace(run, spring_stiffness=None) for run in data.runs))
    found = nominal_study(bare, [FRICTION])
    best = one_more(found.nominal, FRICTION)
    return replace(found, answers=(answer((FRICTION.name,), 0.0, 1.0, best),))


@pytest.fixture(scope="module")
def study():
    return decays(0.0, 0.0)


def test_a_damping_that_the_air_shares_is_positive_and_has_no_upper_bound():
    """Runs at one wind speed determine only the sum of the damping and of the air's part."""
    windy, given = decays(20.0, 20.0), Quantity(0.008, 0.3, "1")
    assert windy.chosen.left_open is not None
    zeta = within_bounds({"zeta": given}, windy)["zeta"]
    truth = truncnorm(-given.value / given.std, np.inf, given.value, given.std)
    assert zeta.interval == pytest.approx(truth.interval(0.95), rel=1e-3)
    assert 0.5 * given.std < zeta.std <= given.std


def test_the_deviation_of_the_damping_is_within_the_whole_rate(study):
    _, whole = decay_of_swing(study.chosen)
    nominal = study.nominal.problem.data.model
    assert whole == pytest.approx(
        nominal.coefficient(study.nominal.problem.names, study.nominal.point.common, "zeta"), rel=0.1
    )
    given = {"zeta": Quantity(0.0, 0.1, "1"), "omega_n": Quantity(10.0, 1e-3, "rad/s")}
    found = within_bounds(given, study)
    assert found["omega_n"] is given["omega_n"]
    zeta = found["zeta"]
    assert zeta.value == 0.0
    assert zeta.std < 0.7 * whole
    assert 0.0 <= zeta.interval[0] < zeta.interval[1] < 1.1 * whole
    unknown = {"zeta": Quantity(0.3 * whole, None, "1", determined=False)}
    assert within_bounds(unknown, study)["zeta"].determined


def test_what_the_bounds_allow_is_unchanged(study):
    _, whole = decay_of_swing(study.chosen)
    for given in (
        {"zeta": Quantity(0.5 * whole, 0.05 * whole, "1")},
        {"zeta": Quantity(0.0, None, "1", bound="lower")},
        {"cn_r": Quantity(-0.2, 5.0, "1/rad")},
    ):
        assert within_bounds(given, study) == given
    nothing = {"zeta": Quantity(0.0, 0.1, "1")}
    assert within_bounds(nothing, replace(study, answers=())) == nothing


@pytest.fixture(scope="module")
def losses():
    """Four decays of one spring without wind, and the fit with a structural loss beside the viscous damping."""
    data = campaign(
        (Setting(None, 0.0),) * 4, rng=np.random.default_rng(8), noise=5e-4, duration=6.0, rate=100.0
    )
    found = nominal_study(data, [HYSTERESIS])
    return data, found, one_more(found.nominal, HYSTERESIS)


@pytest.mark.parametrize("viscous", [0.0, 0.3, 1.0])
def test_the_split_of_a_loss_that_one_spring_leaves_open_is_within_the_intervals(losses, viscous):
    """The runs show the whole rate alone, so every share of the viscous damping fits them equally well."""
    data, found, best = losses
    whole = found.nominal.problem.data.model.coefficient(
        found.nominal.problem.names, found.nominal.point.common, "zeta"
    )
    common = best.point.common.copy()
    places = [
        best.problem.names.index(name) for name in ("mechanical_damping", "structural_damping.loss_factor")
    ]
    common[places[0]] *= viscous
    common[places[1]] = 2.0 * (1.0 - viscous) * whole
    there = fit_at(best.problem, Point(common, best.point.per_run))
    assert there.total == pytest.approx(best.total, abs=1.0)
    assert (there.bound("mechanical_damping") is not None) == (viscous == 0.0)
    assert (there.bound("structural_damping.loss_factor") is not None) == (viscous == 1.0)

    pair = least_separated(there, data)
    assert pair.parameters == ("mechanical_damping", "structural_damping.loss_factor")
    assert pair.correlation < -0.99
    assert "softer or stiffer spring" in pair.remedy
    together = pair.together
    assert (together.quantity, together.factor) == ("zeta", pytest.approx(0.5, rel=1e-3))
    assert together.value == pytest.approx(whole, rel=1e-3)
    assert 0.5 < together.std / found.nominal.std("mechanical_damping") * 2.0 * _omega(found) < 2.0
    assert together.of_second == pytest.approx((0.0, whole), abs=0.01 * whole)

    study = replace(found, answers=(answer((HYSTERESIS.name,), 0.0, 1.0, there),))
    given = coefficients(possible_answers(study, [HYSTERESIS]), data)
    zeta = within_bounds(given, study)["zeta"]
    assert zeta.value == pytest.approx(viscous * whole, abs=0.01 * whole)
    assert zeta.interval == pytest.approx((0.025 * whole, 0.975 * whole), abs=0.01 * whole)
    assert 0.2 * whole < zeta.std < 0.6 * whole
    assert given["omega_n"].std < 1e-4


def _omega(found):
    return float(np.sqrt(found.nominal.value("stiffness")))
