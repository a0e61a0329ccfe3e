"""Scores against sums done by hand and against the distributions they estimate."""

import json

import numpy as np
import pytest

from identification.scoring import ScoredEstimate, collect, overall, reach_of_rmse, score
from identification.show.quantity import INTERVAL, Quantity
from identification.statistics import Proportion
from tunnel_sim.files.writing import as_json


def outcomes(errors, *, std=1.0, truth=10.0, bound=1.0):
    return [ScoredEstimate(truth, Quantity(truth + e, std, "kg m2"), bound) for e in errors]


def test_figures_are_the_sums_done_by_hand():
    found = score(collect([*outcomes([1.0, -2.0, 4.0]), ScoredEstimate(10.0, None, 1.0)]))
    assert (found.count, found.failures.count) == (4, 1)
    assert found.bias.value == pytest.approx(1.0)
    assert found.bias.std == pytest.approx(3.0 / np.sqrt(3.0))  # s = 3 of 1, −2, 4
    assert found.relative_bias.value == pytest.approx(10.0)
    assert found.bias_in_stds.value == pytest.approx(1.0)
    assert found.rmse.value == pytest.approx(np.sqrt(7.0))
    # of normal errors of mean 1 and variance 9: var(x²) = 2·81 + 4·9 = 198, so se(√7) = √(198/3)/(2√7); the squares
    # 1, 4, 16 themselves scatter less, with s² = 63
    assert found.rmse.std == pytest.approx(np.sqrt(66.0) / (2.0 * np.sqrt(7.0)))
    assert found.rmse_over_bound == Quantity(pytest.approx(np.sqrt(7.0)), pytest.approx(found.rmse.std), "1")
    assert (found.coverage.count, found.coverage.total) == (1, 3)
    assert {found.bias.unit, found.rmse.unit} == {"kg m2"}


def test_the_standard_errors_are_those_of_repeated_scores():
    rng = np.random.default_rng(1)
    many = [score(collect(outcomes(rng.normal(0.3, 2.0, 60)))) for _ in range(400)]
    for name in ("bias", "rmse", "rmse_over_bound"):
        figures = [getattr(one, name) for one in many]
        scatter = np.std([figure.value for figure in figures], ddof=1)
        claimed = np.sqrt(np.mean([figure.std**2 for figure in figures]))
        assert claimed == pytest.approx(scatter, rel=0.15)  # 4σ of a scatter of 400


def test_the_standard_error_of_few_trials_is_not_far_too_small():
    """Of four normal errors the true RMSE is within 1.96 standard errors as often as χ² lets it: nine in ten."""
    rng = np.random.default_rng(2)
    many = [score(collect(outcomes(rng.normal(0.0, 1.0, 4)))).rmse for _ in range(2000)]
    assert np.mean([abs(one.value - 1.0) <= INTERVAL * one.std for one in many]) > 0.85
    alike = score(collect(outcomes([1.0, -1.0, 1.01, -1.01]))).rmse
    assert alike.std / alike.value == pytest.approx(1.0 / np.sqrt(8.0), rel=0.4)


def test_the_reach_of_an_rmse_is_that_of_its_distribution():
    """The chi-squared quantiles 0.4844 and 11.143 of four degrees of freedom are in every table."""
    low, high = reach_of_rmse(4)
    assert (low, high) == (
        pytest.approx((4 / 11.143) ** 0.5, rel=1e-3),
        pytest.approx((4 / 0.4844) ** 0.5, rel=1e-3),
    )


def test_wilsons_interval_is_the_librarys():
    from scipy.stats import binomtest

    for count, total in ((0, 20), (7, 20), (20, 20), (950, 1000)):
        library = binomtest(count, total).proportion_ci(method="wilson")
        assert Proportion(count, total).interval == pytest.approx((library.low, library.high), abs=1e-12)


def test_failures_and_single_trials_have_no_figures():
    found = score(collect([ScoredEstimate(1.0, None)] * 3))
    assert (found.failures.value, found.bias, found.rmse, found.coverage) == (1.0, None, None, None)
    found = score(collect(outcomes([0.5])))
    assert found.rmse is None
    assert found.coverage.value == 1.0
    json.dumps(as_json(found), allow_nan=False)
    with pytest.raises(ValueError, match="no trial"):
        score(collect([]))


def test_a_missing_bound_or_a_truth_of_zero_leaves_the_ratio_out():
    assert score(collect(outcomes([1.0, 2.0], bound=None))).rmse_over_bound is None
    assert score(collect(outcomes([1.0, 2.0], truth=0.0))).relative_bias is None
    assert score(collect(outcomes([1.0, 2.0], std=0.0))).bias_in_stds is None


def test_tiny_errors_do_not_underflow():
    found = score(collect(outcomes([3e-200, 4e-200], truth=0.0, bound=1e-200)))
    assert found.rmse_over_bound.value == pytest.approx(np.sqrt(12.5))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_not_finite_is_refused(value):
    with pytest.raises(ValueError, match="not finite"):
        collect([ScoredEstimate(1.0, Quantity(value, 1.0, "1"))])


def test_units_are_not_mixed():
    with pytest.raises(ValueError, match="mixed"):
        collect([ScoredEstimate(1.0, Quantity(1.0, 1.0, unit)) for unit in ("1", "rad")])


def test_cells_are_added_in_squares():
    one, other = score(collect(outcomes([3.0, -3.5]))), score(collect(outcomes([4.0, -4.5])))
    (a, u), (b, v) = ((found.rmse_over_bound.value, found.rmse_over_bound.std) for found in (one, other))
    root = np.sqrt((a**2 + b**2) / 2.0)
    assert overall([one, other]).value == pytest.approx(root)
    assert overall([one, other]).std == pytest.approx(np.hypot(a * u, b * v) / 2.0 / root)
    assert overall([score(collect([ScoredEstimate(1.0, None)]))]) is None
