"""A cause that one run alone contradicts is refused, and one that the runs share survives the loss of each.

Truth: decays with and without a cubic spring, in one run or in all, and a random moment of a given power.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.likelihood.least_squares import Fit, fit
from diagnosis.likelihood.without_run import WithoutRuns, refitted_without
from diagnosis.model.parameters import Point
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.process_noise import MomentLayer, ProcessNoise
from diagnosis.search.sets import Sets, resolved
from diagnosis.search.surviving import contradicted, explains_too_much, refusal, shown_by_one
from diagnosis.search.weights import FittedSet
from tests.support.gap_campaigns import campaign, nominal, whole_runs
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


def moment(drop: float) -> ProcessNoise:
    """A random moment of the six runs that lowers −2 ln L by so much."""
    names = tuple(f"r{i}" for i in range(1, 7))
    return ProcessNoise((), names, np.full(6, drop / 6.0), np.ones(6), 0.0, 0.0, [], 0.01, np.ones(3), 0.0)


def test_a_random_moment_explains_no_more_than_is_missing() -> None:
    base = nominal(campaign(CUBIC, duration=6.0))
    left = base.total - base.count
    assert not explains_too_much(moment(1.2 * left), base)
    assert explains_too_much(moment(3.0 * left), base)
    # a motion of few cycles is absorbed in part, and a moment alone pays for nothing else
    assert not explains_too_much(moment(1.7 * left), base, alone=True)
    assert explains_too_much(moment(4.0 * left), base, alone=True)
    # where nothing is missing, chance alone is allowed
    none = nominal(campaign(duration=6.0))
    assert not explains_too_much(moment(100.0), none)


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
