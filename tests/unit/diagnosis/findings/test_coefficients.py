"""Coefficients averaged over the answers and over small causes beside them.

Truth: the values that the campaigns were made with; mixtures of normal distributions in closed form.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from diagnosis.answer.linear_theory import beside, starts_beside
from diagnosis.findings.averaged_coefficients import (
    Answers,
    Central,
    NormalMixture,
    Possible,
    before_the_causes,
    coefficients,
    possible_answers,
)
from diagnosis.findings.units import own_estimate
from diagnosis.model.similarity import Similarity
from diagnosis.search.scatter import as_stated
from diagnosis.settings import AnswerSettings, Settings
from identification.show.numbers import estimated
from identification.show.quantity import Quantity
from tests.marks import slow
from tests.support.gap_campaigns import CN_BETA, CN_R, added, answer, campaign, nominal, precise, studied
from tunnel_sim.effects import ALL_EFFECTS, effect_class, effect_from
from tunnel_sim.vocabulary.campaign import Repeatability

CAUSE = "quadratic_damping"
TRUE = {"cn_beta": CN_BETA, "cn_r": CN_R}
PARTS = st.lists(
    st.tuples(st.floats(0.01, 1.0), st.floats(-5.0, 5.0), st.floats(0.01, 4.0)), min_size=1, max_size=6
)


def only(fitted, data, **fields):
    return coefficients(Answers((Possible(1.0, fitted, **fields),), 0.0, fitted), data)


@pytest.fixture(scope="module")
def best(base):
    return added(base, CAUSE)


def test_an_answer_in_which_nothing_swings_has_no_damping_ratio():
    """An unstated spring may end at zero in a fit of an improbable answer."""
    data = campaign(conditions=((16.12, 0.0), (16.12, 20.0)), duration=6.0)
    fitted = nominal(replace(data, runs=tuple(replace(run, spring_stiffness=None) for run in data.runs)))
    common = fitted.point.common.copy()
    common[fitted.problem.names.index("stiffness")] = 0.0
    loose = replace(fitted, point=replace(fitted.point, common=common))
    found = coefficients(Answers((Possible(0.99, fitted), Possible(0.01, loose)), 0.0, fitted), data)
    alone = only(fitted, data)
    assert found["zeta"].value == pytest.approx(alone["zeta"].value)
    assert found["zeta"].std == pytest.approx(alone["zeta"].std)
    assert "zeta" not in only(loose, data)


@given(PARTS)
@settings(max_examples=50)
def test_a_mixture_has_the_moments_of_its_samples_and_the_quantiles_of_its_distribution(parts):
    weights, means, variances = np.array(parts).T
    found = NormalMixture(weights / weights.sum(), means, variances)
    second = float(found.weights @ (variances + means**2))
    assert found.std == pytest.approx(np.sqrt(second - found.mean**2), rel=1e-6)
    for share in (0.025, 0.5, 0.975):
        below = found.weights @ norm.cdf(found.quantile(share), means, np.sqrt(variances))
        assert below == pytest.approx(share, abs=1e-9)


def test_one_answer_with_white_residuals_has_the_interval_of_its_fit(data, best):
    found = only(best, precise(data))
    for name in TRUE:
        assert found[name].value == best.value(name)
        assert found[name].std == pytest.approx(best.std(name), rel=1e-6)
        assert found[name].interval is None
        assert abs(found[name].value - TRUE[name]) < 3.0 * found[name].std


@pytest.mark.parametrize(("width", "low", "high"), [(1e-6, 0.0, 0.01), (3e-3, 0.99, 1.0)])
def test_the_scatter_of_the_wind_speed_is_told_from_the_noise(data, width, low, high):
    """Truth: no unbiased estimator has less noise than that of runs which repeat exactly."""
    given = replace(precise(data), repeatability=Repeatability(wind_speed=width))
    repeating, kinds = nominal(precise(data)), [effect_class("wind_speed_scatter")]
    found = only(as_stated(nominal(given), kinds), given)["cn_beta"]
    assert low < found.shares["scatter"] < high
    assert sum(found.shares.values()) == pytest.approx(1.0)
    noise = math.sqrt(found.shares["noise"]) * found.std
    assert 0.999 * repeating.std("cn_beta") < noise < 3.0 * repeating.std("cn_beta")


def test_the_digits_of_the_density_count(data, best):
    for density, relative in (
        (1.2041, 0.5e-4 / np.sqrt(3.0)),
        (np.float64(1.20412), 0.5e-5 / np.sqrt(3.0)),
        (1.204, 0.0),
    ):
        runs = tuple(replace(run, air_density=density) for run in data.runs)
        found = only(best, replace(data, runs=runs))["cn_beta"]
        rounding = relative / 1.204 * found.value
        assert found.std == pytest.approx(np.hypot(best.std("cn_beta"), rounding), rel=1e-3)


def test_two_probable_answers_have_the_quantiles_of_their_mixture(data, base, best):
    answers = Answers((Possible(0.7, best), Possible(0.3, base)), 0.0, base)
    found = coefficients(answers, precise(data))["cn_r"]
    one, two = (only(fitted, precise(data))["cn_r"] for fitted in (best, base))
    whole = NormalMixture(np.array([0.7, 0.3]), *np.array([(r.value, r.std**2) for r in (one, two)]).T)
    low, high = (whole.quantile(share) for share in (0.025, 0.975))
    x = np.linspace(low, high, 200_001)
    density = whole.weights @ norm.pdf(x, whole.means[:, None], np.sqrt(whole.variances)[:, None])
    assert found.value == pytest.approx(np.average(x, weights=density), rel=1e-4)
    assert found.std == pytest.approx(0.5 * (high - low) / norm.ppf(0.975))
    assert found.interval == pytest.approx((low, high))
    assert sum(found.shares.values()) == pytest.approx(1.0)
    assert found.shares["rivals"] > 0.5
    assert low < min(one.value, two.value)
    assert max(one.value, two.value) < high
    assert found.to_json_dict()["interval"] == list(found.interval)


def test_a_rival_outside_the_interval_does_not_widen_it(data, base, best):
    """Its distant mean would be most of a variance, and move a mean by more than the answer's own deviation."""
    answers = Answers((Possible(0.985, best), Possible(0.015, base)), 0.0, base)
    found = coefficients(answers, precise(data))["cn_r"]
    alone = only(best, precise(data))["cn_r"]
    whole = NormalMixture(
        np.array([0.985, 0.015]), *np.array([(f.value("cn_r"), f.std("cn_r") ** 2) for f in (best, base)]).T
    )
    assert whole.std > 3.0 * alone.std
    assert abs(found.value - alone.value) < 0.1 * alone.std
    assert alone.std <= found.std < 1.5 * alone.std


@given(PARTS)
@example([(0.4375, 3.0, 0.25), (0.34375, -4.0, 0.0625)])  # narrow answers far apart: the ends matter
@settings(max_examples=50)
def test_the_interval_stated_or_meant_holds_95_per_cent_from_both_sides(parts):
    weights, means, variances = np.array(parts).T
    whole = NormalMixture(weights / weights.sum(), means, variances)
    found = Central.of(whole, AnswerSettings())
    low, high = found.interval or (found.value - 1.96 * found.std, found.value + 1.96 * found.std)
    assert high - low == pytest.approx(2.0 * 1.96 * found.std, rel=1e-4)
    stds = np.sqrt(variances)
    held = whole.weights @ (norm.cdf(high, means, stds) - norm.cdf(low, means, stds))
    assert 0.9 < held < 0.98  # an end may be a tenth of a standard deviation from the central interval's


def test_an_unlikely_rival_makes_the_interval_one_sided(data, base, best):
    found = coefficients(Answers((Possible(0.96, best), Possible(0.04, base)), 0.0, base), precise(data))[
        "cn_r"
    ]
    away = [abs(end - best.value("cn_r")) for end in found.interval]
    assert max(away) > 3.0 * min(away)
    assert found.interval[0] < best.value("cn_r") < found.interval[1]


def test_unknown_leaves_the_value_and_adds_half_the_change_from_the_nominal_model(data, base, best):
    found = coefficients(Answers((Possible(0.9, best),), 0.1, base), precise(data))["cn_r"]
    change = Settings().answer.unknown_std * (best.value("cn_r") - base.value("cn_r"))
    whole = NormalMixture(
        np.array([0.9, 0.1]),
        np.full(2, best.value("cn_r")),
        best.std("cn_r") ** 2 + np.array([0.0, change**2]),
    )
    assert found.value == pytest.approx(best.value("cn_r"))
    assert found.std == pytest.approx(Central.of(whole, AnswerSettings()).std, rel=1e-4)
    assert found.std > best.std("cn_r")


def test_the_nominal_model_s_coefficients_are_as_uncertain_as_they_are_wrong(data, base, best):
    after = only(best, data)
    before = before_the_causes(base, after)
    for name in TRUE:
        assert before[name].value == base.value(name)
        assert before[name].std == pytest.approx(
            np.hypot(base.value(name) - best.value(name), after[name].std)
        )
        assert abs(before[name].value - TRUE[name]) < 3.0 * before[name].std


def test_answers_count_without_their_part_of_the_even_share(data, base, best):
    names = ((CAUSE,), ("free_play",), ("unknown",))
    known = zip(names, (0.8, 0.04, 0.16), (best, base, None), strict=True)
    answers = tuple(answer(effects, 0.0, p, fitted) for effects, p, fitted in known)
    study = replace(studied(data, base, (CAUSE,), best), answers=answers)
    found = possible_answers(study, ())
    assert [one.fit for one in found.possible] == [best, base]
    assert [one.probability for one in found.possible] == pytest.approx(
        [0.8 - Settings().weighing.even_share / 3, 0.04 - Settings().weighing.even_share / 3]
    )
    assert found.unknown == pytest.approx(0.16 - Settings().weighing.even_share / 3)
    assert found.possible[0].small is not None
    assert found.possible[1].small is None  # too improbable


def test_without_a_gap_the_nominal_fit_is_all(data, base):
    found = possible_answers(studied(data, base), [effect_class(CAUSE)])
    ((one,), unknown) = found.possible, found.unknown
    assert (one.fit, one.probability, one.small, unknown) == (base, 1.0, None, 0.0)


def test_normalised_runs_have_frequency_and_damping_ratio(data):
    still = tuple(replace(run, spring_stiffness=None) for run in data.runs[:1])
    normalised = replace(data, runs=(still[0], replace(still[0], id="again")))
    base = nominal(normalised)
    found = only(base, normalised)
    assert found["omega_n"].value == pytest.approx(np.sqrt(16.12 / 0.11), rel=2e-3)
    assert {name: value.unit for name, value in found.items()} == {"omega_n": "rad/s", "zeta": "1"}
    assert all(value.std > 0.0 for value in found.values())


@pytest.mark.parametrize(
    ("small", "parameters", "name"),
    [
        slow("structural_damping", {"loss_factor": 5e-4}, "cn_r"),
        ("gravity_stiffness", {"stiffness": 0.02}, "cn_beta"),
    ],
)
def test_a_small_cause_that_is_not_named_is_allowed_for(small, parameters, name):
    """The fit of the named cause alone is wrong by more than twenty of its standard deviations every time."""
    errors, plain = [], []
    for seed in (1, 2):
        effects = (effect_from(CAUSE, {"coefficient": 0.003}), effect_from(small, parameters))
        data = precise(campaign(*effects, seed=seed, duration=6.0))
        best = added(nominal(data), CAUSE)
        found = only(best, data, small=beside(best, starts_beside(best, ALL_EFFECTS)))[name]
        errors.append((found.value - TRUE[name]) / found.std)
        plain.append((best.value(name) - TRUE[name]) / best.std(name))
        assert found.shares["small causes"] > 0.5
    assert min(np.abs(plain)) > 20.0
    assert max(np.abs(errors)) < 3.0


def test_beside_a_complete_answer_small_causes_have_a_small_part(data, best):
    """However far it could move a coefficient: a lag in the wind leaves nearly nothing in the readings."""
    found = beside(best, starts_beside(best, ALL_EFFECTS))
    assert found.weights[0] > 0.99
    assert len(found.weights) > 50
    for name in TRUE:
        assert only(best, precise(data), small=found)[name].shares["small causes"] < 0.5


def test_what_is_left_moves_the_coefficients(data, base):
    """No effect may act beside the nominal model: half the difference between halves of the data counts."""
    found = only(base, precise(data), small=beside(base, ()))["cn_r"]
    assert found.shares["misfit"] > 0.9
    assert abs(found.value - CN_R) < 3.0 * found.std


@pytest.mark.parametrize(
    ("value", "std", "interval", "text"),
    [
        (0.4951, 0.0012, (0.49388, 0.4986), "0.4951 ± 0.0012 (0.4939 to 0.4986)"),
        (1.234e-5, 5.6e-7, (1.2e-5, 1.41e-5), "(1.234 ± 0.056)e-05 (1.200e-05 to 1.410e-05)"),
        (0.4951, 0.0012, None, "0.4951 ± 0.0012"),
    ],
)
def test_a_skewed_interval_is_printed(value, std, interval, text):
    assert estimated(Quantity(value, std, "1", interval)) == text


def test_an_interval_has_the_units_of_the_measured_campaign():
    found = own_estimate(Quantity(10.0, 1.0, "rad/s", interval=(9.0, 13.0)), Similarity(time=4.0))
    assert found.interval == pytest.approx((0.9 * found.value, 1.3 * found.value))
