"""The gap as causes are added: against closed forms, and with readings that no fit may see.

Truth: a sine of amplitude a adds a²/2 to the mean square; what is left out of a fit cannot change it.
"""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.answer.held_out import (
    Base,
    Subsets,
    predict_held_out,
    predict_stretches,
    turns_of,
    waterfall,
)
from diagnosis.findings.candidates import Candidate, inclusion
from diagnosis.likelihood.partial import fit_seen
from diagnosis.likelihood.problem import Problem
from diagnosis.model.data import FOLDS
from diagnosis.search.answer import Answer
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.process_noise import MomentLayer, ProcessNoise
from diagnosis.search.random_spectra import SpectrumPart
from diagnosis.search.weights import FittedSet
from diagnosis.settings import Settings
from tests.support.gap_campaigns import NOISE, added, answer, nominal, studied
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.freedom import ANGLE

CAUSE, IDLE, HUM = "quadratic_damping", "cubic_stiffness", "mains_hum"
NO_BASE = Base(NOISE**2, 0.0, 0.0)


@pytest.fixture(scope="module")
def both(base):
    return added(base, CAUSE, IDLE)


def test_the_cause_that_closes_most_comes_first_and_the_idle_one_is_not_missed(data, base, both):
    found = waterfall(studied(data, base, (CAUSE, IDLE), both), NO_BASE)
    assert [step.effect for step in found.steps] == [None, CAUSE, IDLE]
    before, one, all_ = (step.excess for step in found.steps)
    chance = 4.0 * np.sqrt(2.0 / base.count)
    assert before > 20.0
    assert abs(one) < chance
    assert abs(all_) < chance
    assert found.without[IDLE] == pytest.approx(one)
    assert found.without[CAUSE] > 0.9 * before
    assert found.held_out == "on held-out runs"


def test_a_hum_is_a_step_of_its_own_power(data, base, both):
    amplitude = 1e-3
    power = 0.5 * amplitude**2 / NOISE**2
    study = studied(data, base, (CAUSE, IDLE, HUM), both)
    found = waterfall(study, replace(NO_BASE, hum=power))
    steps = {step.effect: step.excess for step in found.steps}
    assert list(steps) == [None, CAUSE, HUM, IDLE]
    assert steps[CAUSE] - steps[HUM] == pytest.approx(power)
    assert found.without[HUM] - steps[IDLE] == pytest.approx(power)


def test_an_unknown_gap_has_the_nominal_model_only(data, base):
    study = replace(studied(data, base), answers=(answer(("unknown",), 0.2, 1.0),))
    found = waterfall(study, replace(NO_BASE, hum=0.5))
    assert [step.effect for step in found.steps] == [None]
    assert found.steps[0].excess > base.excess
    assert found.without == {}


def test_each_set_of_causes_is_fitted_once_and_never_worse_than_fewer(data, base, both):
    fits = Subsets(studied(data, base, (CAUSE, IDLE), both))
    assert fits(()) is base
    assert fits((CAUSE, IDLE)) is both
    one = fits((CAUSE,))
    assert fits([CAUSE]) is one
    assert one.total == pytest.approx(added(base, CAUSE).total, rel=1e-4)
    assert both.total <= one.total <= fits((IDLE,)).total <= base.total
    assert one.problem.effect_names == (f"{CAUSE}.coefficient",)


def test_what_is_left_out_of_a_fit_cannot_change_it(base):
    seen = [np.arange(run.reading.size) % 500 < 400 for run in base.problem.data.runs]
    spoilt = tuple(
        replace(run, reading=np.where(keep, run.reading, run.reading + 0.1))
        for run, keep in zip(base.problem.data.runs, seen, strict=True)
    )
    other = replace(base, problem=Problem(replace(base.problem.data, runs=spoilt)))
    point, _ = fit_seen(base, seen)
    spoilt_point, _ = fit_seen(other, seen)
    assert np.array_equal(point.common, spoilt_point.common)
    assert np.array_equal(point.per_run, spoilt_point.per_run)
    assert not np.array_equal(point.common, base.point.common)


def test_a_single_run_is_held_out_by_stretches_of_time(data):
    alone = replace(data, runs=data.runs[:1])
    base = nominal(alone)
    best = added(base, CAUSE)
    found = waterfall(studied(alone, base, (CAUSE,), best), NO_BASE)
    assert found.held_out == "on held-out stretches of time"
    assert found.steps[0].excess > base.excess  # predicted, not fitted
    assert abs(found.steps[1].excess) < 4.0 * np.sqrt(2.0 / base.count)


def test_every_block_of_a_run_is_left_out_in_one_turn_of_whole_stretches(base):
    first = base.problem.data.runs[0]
    turns = turns_of(base, {first.id})
    assert set(turns[0].tolist()) == set(range(FOLDS))
    assert np.flatnonzero(np.diff(turns[0])).size == 8  # nine stretches
    assert all((turn == -1).all() for turn in turns[1:])
    found = predict_stretches(base, turns)
    assert list(found) == [first.id]
    assert found[first.id].shape == first.reading.shape


def test_runs_that_are_the_only_ones_of_their_kind_are_held_out_in_time(data):
    few = replace(data, runs=(*data.runs[:3], replace(data.runs[1], id="again")))
    base = nominal(few)
    assert 0 < len(predict_held_out(base).residuals) < 4
    found = waterfall(studied(few, base), NO_BASE)
    assert "only one of its kind" in found.held_out
    assert np.isfinite(found.steps[0].excess)


def test_the_probability_of_an_effect_is_that_of_the_answers_that_name_it():
    weighed = (
        Candidate("free_play + mains_hum + sensor_drift", 0.5, 0.0, 1.0),
        Candidate("free_play + mains_hum", 0.2, 0.0, 1.0),
        Candidate("sensor_drift", 0.125, 0.0, 1.0),
        Candidate("unknown", 0.175, 0.0, 0.0),
    )
    found = inclusion(weighed, (HUM,), Settings().gap, ANGLE)
    assert found["free_play"] == pytest.approx(0.7)
    assert found["sensor_drift"] == pytest.approx(0.625)
    assert found[HUM] == 1.0 - 1e-3
    assert found[CAUSE] == 0.0


def test_a_random_moment_comes_last_and_leaves_its_innovations(data, base):
    """Where the wind is off the runs' own residuals are left, and nothing beside the moment is taken out."""
    kind = effect_class("buffeting")
    best = added(base, IDLE)
    windy = tuple(run.id for run in data.runs if run.wind_on)
    innovations = [np.ones(9)] * 4
    process = ProcessNoise(
        (SpectrumPart(0.01, 5.0),),
        windy,
        np.full(4, 2.5),
        np.ones(4),
        5.0,
        0.25,
        innovations,
        0.012,
        np.ones(3),
        0.0,
    )
    layer = MomentLayer((kind,), process, FittedSet((kind.name, IDLE), 0.01, np.zeros(6)))
    own = Hypothesis((IDLE,), best, moment=layer)
    study = studied(data, base, (kind.name, IDLE, HUM))
    study = replace(study, answers=(Answer((kind.name, IDLE), 0.01, 0.9, own, own),))
    found = waterfall(study, replace(NO_BASE, hum=2.0))
    residuals = predict_held_out(best).residuals
    still = {run: float(np.mean(left**2)) - 1.0 for run, left in residuals.items()}
    off = [still[run.id] for run in data.runs if not run.wind_on]
    assert {step.effect for step in found.steps[1:-1]} == {IDLE, HUM}
    assert found.steps[-1].effect == kind.name
    assert found.steps[-1].excess == pytest.approx((4 * 0.25 + sum(off)) / 6)
    assert set(found.without) == {HUM, kind.name}
    assert found.without[HUM] == pytest.approx(found.steps[-1].excess + 2.0)
    assert found.without[kind.name] == found.steps[-2].excess
