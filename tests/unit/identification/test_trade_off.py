"""Which parameters trade off, by covariances of known correlation, and the run that separates them, once added."""

import json
from dataclasses import replace

import numpy as np
import pytest

from diagnosis.answer.held_out import one_more
from diagnosis.answer.linear_theory import move_of_halves
from diagnosis.findings.trade_off import least_separated, role_in_effect
from diagnosis.likelihood.residuals import linear_coefficients
from identification import identify
from identification.estimate import Estimate
from identification.printing import SYMBOLS, trade_off_line
from identification.trade_off import ROLES, Combination, Role, Setting, TradeOff, separating, trade_off
from tests.reference.free_decays import Setting as Condition
from tests.reference.free_decays import campaign
from tests.support.gap_campaigns import campaign as gap_campaign
from tests.support.gap_campaigns import nominal
from tunnel_sim.effects import effect_class, effect_from, known_effects

RIG, JOINT, DRIVEN = Setting(springs=True, driven=False), Setting(False, False), Setting(False, True)
ANY = dict.fromkeys("abcd", Role())


def covariance(correlations, stds):
    return np.array(correlations) * np.outer(stds, stds)


def test_the_pair_of_the_greatest_correlation_of_either_sign_is_found_whatever_the_units():
    matrix = [[1.0, 0.96, 0.1], [0.96, 1.0, 0.15], [0.1, 0.15, 1.0]]
    found = trade_off("abc", covariance(matrix, [1e-6, 40.0, 3.0]), ANY, RIG)
    assert found.parameters == ("a", "b")
    assert found.correlation == pytest.approx(0.96)
    negative = np.array(matrix) * np.outer([1, -1, 1], [1, -1, 1])
    assert trade_off("abc", negative, ANY, RIG).correlation == pytest.approx(-0.96)


def test_nothing_is_said_below_the_stated_correlation_or_of_what_is_not_known():
    matrix = covariance([[1.0, 0.97], [0.97, 1.0]], [1.0, 2.0])
    assert trade_off("ab", matrix, ANY, RIG) is not None
    assert trade_off("ab", matrix * [[1.0, 0.9], [0.9, 1.0]], ANY, RIG) is None
    assert trade_off("ab", matrix * [[1.0, 0.0], [0.0, 0.0]], ANY, RIG) is None
    assert trade_off("a", matrix[:1, :1], ANY, RIG) is None
    assert trade_off("", np.zeros((0, 0)), ANY, RIG) is None


FRICTION, SHAPE = Role(amplitude=0.0), Role(amplitude=None)


@pytest.mark.parametrize(
    ("first", "second", "rig", "words"),
    [
        (ROLES["yaw_inertia"], ROLES["added_stiffness"], RIG, "softer or stiffer spring"),
        (ROLES["yaw_inertia"], ROLES["added_stiffness"], JOINT, "known inertia"),
        (ROLES["yaw_inertia"], ROLES["added_stiffness"], DRIVEN, "lower and higher frequencies"),
        (ROLES["mechanical_damping"], ROLES["cn_r"], RIG, "wind off or at another wind speed"),
        (ROLES["cn_beta"], ROLES["cn_r"], RIG, "add runs at another wind speed"),
        (ROLES["mechanical_damping"], FRICTION, RIG, "releases from larger and smaller angles"),
        (ROLES["added_stiffness"], FRICTION, DRIVEN, "drive it to larger and smaller angles"),
        (ROLES["yaw_inertia"], ROLES["drive_gain"], RIG, "free decays"),
        (ROLES["zero"], ROLES["moment_offset"], JOINT, "known angles"),
        (SHAPE, SHAPE, RIG, "releases from larger and smaller angles"),
        (ROLES["added_stiffness"], ROLES["stiffness"], RIG, "by itself"),
    ],
)
def test_the_run_changes_what_the_two_follow_with_different_powers(first, second, rig, words):
    assert words in separating(first, second, rig)
    assert separating(first, second, rig) == separating(second, first, rig)


@pytest.mark.parametrize(
    ("effect", "parameter", "role"),
    [
        ("coulomb_friction", "friction_moment", Role(amplitude=0.0)),
        ("coulomb_friction", "exponent", Role(amplitude=None)),
        ("quadratic_damping", "coefficient", Role(amplitude=2.0, frequency=2.0)),
        ("cubic_stiffness", "coefficient", Role(amplitude=3.0)),
        ("gravity_stiffness", "stiffness", Role()),
        ("gravity_stiffness", "rest_angle", Role(amplitude=None)),
        ("structural_damping", "loss_factor", Role()),
        ("nonlinear_yaw_damping", "coefficient", Role(amplitude=3.0, frequency=1.0, wind=1.0)),
        ("wind_speed_drift", "settling", Role(amplitude=None, wind=2.0, length=True)),
        ("input_delay", "delay", Role(input=True)),
    ],
)
def test_the_role_of_an_effects_parameter_is_that_of_its_equation(effect, parameter, role):
    kind = effect_class(effect)
    (info,) = (one for one in kind.parameters() if one.name == parameter)
    assert role_in_effect(kind, info) == role


def test_every_parameter_of_the_vocabulary_has_a_run_that_separates_it_from_every_other():
    every = [role_in_effect(kind, info) for kind in known_effects() for info in kind.parameters()]
    assert all(separating(one, other, RIG) for one in every for other in (*every, *ROLES.values()))


def windy(*speeds):
    conditions = tuple(Condition(spring, speed) for spring in (16.12, 44.84) for speed in speeds)
    return campaign(conditions, rng=np.random.default_rng(4), noise=5e-4, duration=6.0, rate=100.0)


def test_an_estimate_names_the_damping_of_two_near_wind_speeds_and_not_once_its_run_is_added():
    near, apart = identify(windy(19.0, 21.0)), identify(windy(0.0, 19.0, 21.0))
    document = near.to_json_dict()
    assert apart.trade_off is None
    assert trade_off_line(apart.trade_off, SYMBOLS) == ""
    correlation = near.covariance_matrix / np.outer(*2 * [np.sqrt(np.diag(near.covariance_matrix))])
    strongest = np.max(np.abs(np.triu(correlation, 1)))
    assert abs(near.trade_off.correlation) == pytest.approx(strongest)
    line = trade_off_line(near.trade_off, SYMBOLS)
    assert line.startswith("What trades off: Cn")
    shown = line.partition("(correlation ")[2].partition(")")[0]
    assert float(shown.replace("−", "-")) == pytest.approx(near.trade_off.correlation, abs=0.005)
    assert line.endswith("add runs with the wind off or at another wind speed.")
    assert line in str(near).replace("\n", " ")
    assert Estimate.from_json_dict(json.loads(json.dumps(document))) == near


def test_a_fit_of_a_diagnosis_names_its_pair_and_leaves_out_what_lies_at_a_bound():
    base = nominal(gap_campaign())
    assert least_separated(base, gap_campaign()) is None
    size = len(base.problem.names)
    places = [base.problem.names.index(name) for name in ("mechanical_damping", "cn_r")]
    matrix = np.eye(size)
    matrix[places[0], places[1]] = matrix[places[1], places[0]] = 0.99
    found = least_separated(replace(base, covariance=matrix), gap_campaign())
    assert found.parameters == ("mechanical_damping", "cn_r")
    common = base.point.common.copy()
    common[places[0]] = 0.0  # its lower bound
    at_bound = replace(base, covariance=matrix, point=replace(base.point, common=common))
    assert least_separated(at_bound, gap_campaign()) is None
    words = trade_off_line(found, {"mechanical_damping": "damping", "cn_r": "Cnr"})
    assert "damping and Cnr are poorly separable in these runs (correlation 0.99)" in words


@pytest.mark.parametrize(
    ("value", "shown"), [(0.976, "0.98"), (-0.9938, "−0.994"), (0.99978, "0.9998"), (-1.0, "−1.000000")]
)
def test_a_correlation_is_told_from_one(value, shown):
    found = TradeOff(("cn_r", "cn_beta"), value, "do it")
    assert f"(correlation {shown})" in trade_off_line(found, SYMBOLS)


def test_the_combination_of_least_variance_is_stated_and_the_split_respects_the_bounds_of_both():
    """ζ + η/2 = 0.0031 ± 0.0001 of a decay, whose loss factor alone is unknown to 0.2."""
    values, std = np.array([0.0, 0.0062]), 0.2
    matrix = np.array([[0.25, -0.5], [-0.5, 1.0]]) * std**2 + np.diag([1e-8, 0.0])
    found = Combination.of("zeta", values, matrix, np.array([[0.0, 1.0], [0.0, 1.0]]), "1")
    assert found.factor == pytest.approx(0.5)
    assert found.value == pytest.approx(0.0031)
    assert found.std == pytest.approx(1e-4)
    assert found.of_second == pytest.approx((0.0, 0.0031))
    pair = TradeOff(("mechanical_damping", "structural_damping.loss_factor"), -1.0, "add runs", found)
    line = trade_off_line(pair, {"zeta": "ζ", "mechanical_damping": "damping"})
    assert line.startswith(
        "What the runs determine: the whole damping ratio, ζ + 0.500 × structural damping (loss factor) = "
        "0.00310 ± 0.00010; of it structural damping (loss factor) contributes 0 to 0.0031. What trades off: "
    )
    squared = replace(pair, together=replace(found, unit="1/s2"))
    assert " ± 0.00010 1/s²; of it " in trade_off_line(squared, {})
    assert Combination.of("a", values, np.abs(matrix), np.zeros((2, 2)), "1") is None  # they do not add up


def test_an_error_of_the_model_widens_the_combination_and_the_part_of_the_second():
    values, matrix = np.array([0.003, 0.0062]), np.array([[1.0, -1.9], [-1.9, 4.0]]) * 1e-8
    bounds = np.array([[0.0, 1.0], [0.0, 1.0]])
    by_noise = Combination.of("zeta", values, matrix, bounds, "1")
    given = Combination.of("zeta", values, matrix, bounds, "1", lambda factors: 3e-4 * float(np.sum(factors)))
    assert given.value == by_noise.value
    assert given.std == pytest.approx(np.hypot(by_noise.std, 3e-4 * (1.0 + given.factor)))
    reach = 1.96 * given.factor * np.hypot(2e-4, 3e-4)
    assert given.of_second == pytest.approx(given.factor * values[1] + np.array([-reach, reach]), rel=1e-3)


def test_a_fit_states_the_combination_of_two_losses_as_a_damping_ratio():
    data = gap_campaign(effect_from("quadratic_damping", {"coefficient": 0.003}))
    base = nominal(data)
    whole = one_more(base, effect_class("quadratic_damping"))
    found = least_separated(whole, data)
    assert found.parameters == ("mechanical_damping", "quadratic_damping.coefficient")
    together, places = found.together, [whole.problem.names.index(name) for name in found.parameters]
    inertia, _, stiffness = linear_coefficients(whole, 0)
    ratio = 0.5 * whole.point.common[places[0]] / np.sqrt(inertia * stiffness)
    assert together.quantity == "zeta"
    assert together.value == pytest.approx(ratio + together.factor * whole.point.common[places[1]])
    matrix = whole.covariance[np.ix_(places, places)]
    assert together.std < 0.5 * 0.5 * np.sqrt(matrix[0, 0] / (inertia * stiffness))
    assert 0.0 <= together.of_second[0] < together.of_second[1] <= together.value


def test_the_combination_includes_the_difference_between_halves_of_the_data():
    data = gap_campaign(effect_from("quadratic_damping", {"coefficient": 0.003, "exponent": 1.3}))
    whole = one_more(nominal(data), effect_class("quadratic_damping"))
    together = least_separated(whole, data).together
    place = whole.problem.names.index("quadratic_damping.coefficient")
    moved = move_of_halves(whole, np.eye(len(whole.problem.names))[place])
    assert moved > 3.0 * whole.std("quadratic_damping.coefficient")
    assert together.of_second[1] - together.of_second[0] > 1.9 * together.factor * moved
