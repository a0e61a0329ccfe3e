"""The tests behind ``--check``: nothing where nothing changed, and every planted change."""

import math
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from identification.scoring import Aspect, Trials, _larger, changes, holm

CELLS, COUNT = 6, 60


def trials(
    rng, *, truth=None, scale=1.0, shift=0.0, failures=0, std=1.0, outliers=0, bound=True, heavy=False
):
    error = (rng.standard_t(2, COUNT) if heavy else rng.standard_normal(COUNT)) * scale + shift
    error[:outliers] *= 30.0
    ones = np.ones(COUNT)
    return Trials(
        error, std * ones, rng.random(COUNT) if truth is None else truth, ones if bound else None, failures
    )


def several(seed, **options):
    rng = np.random.default_rng(seed)
    return [trials(rng, **options) for _ in range(CELLS)]


def p_values(before, now):
    cells = [change.p_value for old, new in zip(before, now, strict=True) for change in changes([old], [new])]
    return cells + [change.p_value for change in changes(before, now)]


def test_the_same_trials_are_no_change():
    same = several(1)
    for change in changes(same, same):
        assert (change.before, change.p_value) == (change.now, 1.0)


def test_where_every_trial_failed_coverage_has_not_changed():
    none = np.zeros(0)
    failed = [Trials(none, none, none, none, 5)]
    found = {change.aspect: change for change in changes(failed, failed)}
    assert (found["coverage"].before, found["coverage"].now, found["coverage"].p_value) == (1.0, 1.0, 1.0)


PLANTED = {
    "bias": {"shift": 0.5},
    "spread": {"scale": 1.5},
    "outliers": {"outliers": 8},
    "coverage": {"std": 0.6},
    "failures": {"failures": 8},
}


@pytest.mark.parametrize("aspect", get_args(Aspect))
def test_each_aspect_is_caught_by_its_own_test(aspect):
    found = {change.aspect: change for change in changes(several(1), several(2, **PLANTED[aspect]))}
    assert found[aspect].p_value < 1e-6
    better = {change.aspect: change for change in changes(several(2, **PLANTED[aspect]), several(1))}
    assert better[aspect].p_value == 1.0  # an improvement is never an alarm


def test_an_outlier_is_six_times_the_median_error_of_its_cell_old_and_new():
    """Cells of medians 1 and 10: in the one 7 is an outlier and in the other it is not."""

    def cell(*errors):
        ones = np.ones(len(errors))
        return Trials(np.array(errors), ones, ones, ones, 0)

    before = [cell(1.0, -1.0, 1.0, 5.9), cell(10.0, -10.0, 10.0, 7.0)]
    now = [cell(1.0, -1.0, 7.0, -7.0), cell(10.0, 59.0, -61.0, 7.0)]
    found = {change.aspect: change for change in changes(before, now)}["outliers"]
    assert (found.before, found.now) == (0.0, 3.0 / 8.0)


def test_intervals_that_became_too_wide_are_worse_too():
    found = {change.aspect: change for change in changes(several(1), several(2, std=3.0))}
    assert found["coverage"].p_value < 1e-3


def test_bias_in_opposite_directions_does_not_cancel():
    rng = np.random.default_rng(5)
    biased = [trials(rng, shift=0.6 if i % 2 else -0.6) for i in range(CELLS)]
    (bias, *_) = changes(several(1), biased)
    assert bias.p_value < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("heavy", [False, True])
def test_false_alarms_are_as_rare_as_stated(heavy):
    """At 10 %, to see any: Holm is conservative, and errors without a variance change nothing."""
    sets = 150
    alarms = sum(
        any(holm(p_values(several((1, i), heavy=heavy), several((2, i), heavy=heavy)), 0.10))
        for i in range(sets)
    )
    assert alarms <= 28  # of 150, at 10 %: exceeded with probability 5e-4


def on_the_same_records(before, change):
    return [replace(one, error=change(one.error)) for one in before]


def test_on_the_same_records_smaller_changes_show_and_immaterial_ones_do_not():
    before, rng = several(1), np.random.default_rng(2)
    noisier = on_the_same_records(before, lambda error: error + 0.6 * rng.standard_normal(error.size))
    spread = {change.aspect: change for change in changes(before, noisier)}["spread"]
    assert spread.p_value < 1e-4
    apart = [replace(one, truth=one.truth + 1.0) for one in noisier]  # as if the records were others
    assert {change.aspect: change for change in changes(before, apart)}["spread"].p_value > spread.p_value
    rounded = on_the_same_records(before, lambda error: error * (1.0 + 1e-6) + 1e-9)
    assert {change.p_value for change in changes(before, rounded)} == {1.0}


@pytest.mark.slow
def test_false_alarms_on_the_same_records_are_as_rare_as_stated():
    """Another method, as good: each of its errors is old half and fresh half, so that pairs are exchangeable."""
    alarms = 0
    for i in range(150):
        rng = np.random.default_rng((3, i))
        before = several((4, i))
        now = on_the_same_records(
            before, lambda error, rng=rng: np.sqrt(0.5) * (error + rng.standard_normal(error.size))
        )
        alarms += any(holm(p_values(before, now), 0.10))
    assert alarms <= 28


def test_holm_is_the_published_procedure():
    assert holm([0.004, 0.03, 0.02, 0.5], 0.05) == (True, False, False, False)
    assert holm([0.01, 0.013, 0.02, 0.04], 0.05) == (True, True, True, True)
    assert holm([], 0.05) == ()


def test_a_bound_on_one_side_only_is_refused():
    rng = np.random.default_rng(1)
    with pytest.raises(ValueError, match="one side"):
        changes([trials(rng)], [trials(rng, bound=False)])


def test_nothing_identified_is_a_matter_of_failures_only():
    none = Trials(np.zeros(0), np.zeros(0), np.zeros(0), None, COUNT)
    found = {change.aspect: change.p_value for change in changes(several(1)[:1], [none])}
    assert found.pop("failures") < 1e-6
    assert set(found.values()) == {1.0}


def test_ranks_of_several_cells_are_weighed_as_van_elteren_does():
    """The published statistic for data without ties, cells of different sizes weighed by 1/(n + m + 1)."""
    rng = np.random.default_rng(31)
    cells = [(rng.normal(size=n), rng.normal(0.4, size=m)) for n, m in ((5, 9), (20, 8), (3, 4))]
    excess = variance = 0.0
    for old, new in cells:
        n, m = old.size, new.size
        wins = sum(float(b > a) for a in old for b in new)  # Mann and Whitney's U of the new values
        excess += (wins - 0.5 * n * m) / (n + m + 1)
        variance += n * m / (12.0 * (n + m + 1))
    expected = 0.5 * math.erfc(excess / math.sqrt(2.0 * variance))
    assert _larger(cells, same=False) == pytest.approx(expected, rel=1e-9)
    assert _larger([(np.zeros(0), np.ones(3))], same=False) == 1.0
