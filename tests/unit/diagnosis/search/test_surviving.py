"""A cause that one run alone contradicts is refused, and one that the runs share survives the loss of each.

Truth: decays with and without a cubic spring, in one run or in all, and a random moment of a given power.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom

from diagnosis.likelihood.least_squares import Fit, fit
from diagnosis.likelihood.without_run import WithoutRuns, refitted_without
from diagnosis.model.parameters import Point
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.process_noise import MomentLayer
from diagnosis.search.sets import Sets, resolved
from diagnosis.search.steady_noise import absorption, most_absorbed
from diagnosis.search.surviving import contradicted, explains_too_much, refusal, shown_by_one
from diagnosis.search.weights import FittedSet
from tests.reference.linear_rig import response
from tests.support.drawn_moment import SHAKEN, moment
from tests.support.gap_campaigns import (
    CN_BETA,
    CN_R,
    CONDITIONS,
    DAMPING,
    INERTIA,
    INTERVAL,
    campaign,
    nominal,
    whole_runs,
)
from tunnel_sim.effects import effect_class, effect_from
from tunnel_sim.vocabulary.campaign import Campaign

CUBIC = effect_from("cubic_stiffness", {"coefficient": 0.3})
SEVERITY = "cubic_stiffness.coefficient"


def one_with(place: int) -> Campaign:
    """Six runs, of which one alone has a cubic spring."""
    data, other = campaign(duration=6.0), campaign(CUBIC, duration=6.0)
    runs = tuple(other.runs[i] if i == place else run for i, run in enumerate(data.runs))
    return replace(data, runs=runs)


def with_cubic(data: Campaign, start: float = 0.1) -> Fit:
    """The campaign fitted with a cubic spring."""
    base = nominal(data)
    problem = replace(base.problem, effects=(effect_class("cubic_stiffness"),))
    return fit(problem, Point(np.append(base.point.common, start), base.point.per_run))


@pytest.fixture(scope="module")
def shared() -> Fit:
    return with_cubic(campaign(CUBIC, duration=6.0))


def test_a_fit_without_a_run_is_the_linear_one(shared: Fit) -> None:
    without, place = WithoutRuns.of(shared), shared.problem.names.index(SEVERITY)
    for index in (0, 4):
        again = refitted_without(shared, index)
        assert again is not None
        assert without.common[index, place] == pytest.approx(
            again.value(SEVERITY), abs=0.1 * again.std(SEVERITY)
        )
        assert without.stds[index, place] == pytest.approx(again.std(SEVERITY), rel=0.05)
        assert without.total[index] == pytest.approx(again.total, abs=0.1)
        assert without.count[index] == again.count


def test_a_cause_of_all_runs_survives_the_loss_of_each(shared: Fit) -> None:
    assert contradicted(shared) == {}
    assert shown_by_one(shared) == {}
    assert refusal(Hypothesis((), shared), shared) is None


def test_an_effect_of_one_run_is_contradicted_by_the_others() -> None:
    found = with_cubic(one_with(2))
    assert abs(found.value(SEVERITY)) > 3.0 * found.std(SEVERITY)
    assert contradicted(found) == {"cubic_stiffness": "r3"}


def test_an_effect_that_the_others_cannot_show_is_not_contradicted() -> None:
    """Small swings show no cubic spring."""
    data = campaign(CUBIC, duration=6.0)
    small = campaign(duration=6.0)
    scaled = [
        run if i == 2 else replace(run, record=replace(run.record, yaw_rad=run.record.yaw_rad * 0.02))
        for i, run in enumerate(small.runs)
    ]
    scaled[2] = data.runs[2]
    found = with_cubic(replace(small, runs=tuple(scaled)), 0.3)
    assert contradicted(found) == {}
    assert shown_by_one(found) == {"cubic_stiffness": "r3"}


def test_a_random_moment_explains_no_more_than_is_missing() -> None:
    base = nominal(campaign(CUBIC, duration=6.0))
    left = base.total - base.count
    most = most_absorbed(moment(left), base)
    assert most > 1.5  # a motion of few cycles is absorbed in part
    assert not explains_too_much(moment(0.95 * most * left), base)
    assert explains_too_much(moment(1.2 * most * left), base)
    # where nothing is missing, chance alone is allowed
    none = nominal(campaign(duration=6.0))
    assert not explains_too_much(moment(100.0), none)


def test_as_much_of_a_random_motion_is_absorbed_as_is_foreseen() -> None:
    """Truth: fits to exact responses of the linear rig, whose stiffness and damping are fitted as well."""
    clean, rng = campaign(duration=6.0), np.random.default_rng(21)
    before, keep = nominal(clean), np.exp(-2.0 * np.pi * SHAKEN.bandwidth * INTERVAL)
    ratios = []
    for _ in range(20):
        runs = []
        for run, (spring, speed) in zip(clean.runs, CONDITIONS, strict=True):
            white = SHAKEN.intensity * np.sqrt(1.0 - keep**2) * rng.standard_normal(run.record.time_s.size)
            per_speed = 0.5 * 1.2 * speed * 0.036 * 0.625
            rig = INERTIA, DAMPING - per_speed * 0.625 * CN_R, spring - per_speed * speed * CN_BETA
            moved = response(lfilter([1.0], [1.0, -keep], white), INTERVAL, *rig)
            runs.append(replace(run, record=replace(run.record, yaw_rad=run.record.yaw_rad + moved)))
        after = nominal(replace(clean, runs=tuple(runs)))
        pairs = zip(before.problem.data.runs, after.problem.data.runs, strict=True)
        whole = sum(float(np.sum(one.scaled(other.reading - one.reading) ** 2)) for one, other in pairs)
        ratios.append(whole / (after.total - after.count))
    foreseen = absorption(moment(1.0), before)
    assert np.quantile(foreseen, 0.2) < np.median(ratios) < np.quantile(foreseen, 0.8)
    # one in a thousand of each is beyond a limit that one in a hundred passes
    assert np.sum(ratios > np.quantile(foreseen, 0.99)) <= binom.isf(1e-3, len(ratios), 0.01)
    assert np.sum(ratios < np.quantile(foreseen, 0.01)) <= binom.isf(1e-3, len(ratios), 0.01)


def test_a_set_with_a_random_moment_is_judged_as_others_are() -> None:
    """The moment pays for a steady part that is worse than none."""
    base = nominal(campaign(CUBIC, duration=6.0))
    kind = effect_class("ambient_vibration")
    names = (kind.name,)
    layer = MomentLayer((kind,), moment(10.0 * base.total), FittedSet(names, 0.0, np.zeros(6)))
    answer = Hypothesis((), base, moment=layer)
    found = resolved(Sets(whole_runs(base), (), random=(answer,)))
    assert found.random == ()
    assert found.refused[names].kind == "explains too much"
