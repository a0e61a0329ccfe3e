"""Causes and answers that readings outside their fit do not confirm.

Truth: the causes planted in a campaign, and a body whose law changes within the record.
"""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.answer.held_out import Step, Waterfall, one_more, predict_held_out, share_ahead
from diagnosis.findings.closing import confirmed
from diagnosis.search.investigate import nominal_study
from tests.support.driven_runs import NOTHING, Planted, driven
from tests.support.gap_campaigns import added, answer, studied
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.record import Record

CAUSE, IDLE = "quadratic_damping", "cubic_stiffness"


@pytest.fixture(scope="module")
def both(data, base):
    """A study whose answer has an idle effect beside the cause; the cause alone was weighed too."""
    found = studied(data, base, (CAUSE, IDLE), added(base, CAUSE, IDLE))
    names = (*found.answers[0].effects,)
    sets = (
        answer(names, 0.0, 0.6, found.chosen),
        answer((CAUSE,), 0.0, 0.25, added(base, CAUSE)),
        answer((CAUSE, IDLE, "sensor_drift"), 0.0, 0.1),
        answer(("unknown",), 1.0, 0.05),
    )
    return replace(found, answers=sets)


def held_out(monkeypatch, idle):
    """Let the held-out excess of both effects be 0.1, and of the cause alone ``idle``."""

    def waterfall(study, base):
        del base
        if study.fitted == ("unknown",):
            return Waterfall((Step(None, 30.0),))
        if study.fitted != (IDLE, CAUSE):
            return Waterfall((Step(None, 30.0), Step(CAUSE, idle)), {CAUSE: 30.0})
        steps = Step(None, 30.0), Step(CAUSE, idle), Step(IDLE, 0.1)
        return Waterfall(steps, {CAUSE: 25.0, IDLE: idle})

    monkeypatch.setattr("diagnosis.findings.closing.waterfall", waterfall)


def test_a_cause_that_does_not_reduce_the_held_out_residual_is_not_part_of_the_answer(both, monkeypatch):
    held_out(monkeypatch, 0.09)
    study, found = confirmed(both)
    assert study.causes == (CAUSE,)
    assert study.needless == (IDLE,)
    assert [one.effects for one in study.answers] == [(CAUSE,), ("unknown",)]
    assert study.answers[0].probability == pytest.approx(0.25 / 0.3)
    assert found.gap.excess_after == 0.09


def test_a_cause_that_reduces_it_stays(both, monkeypatch):
    held_out(monkeypatch, 0.11)
    study, found = confirmed(both)
    assert study is both
    assert found.gap.excess_after == 0.1


def test_without_the_refused_set_an_unknown_cause_may_be_likelier_than_all_others(both, monkeypatch):
    held_out(monkeypatch, 0.09)
    weak = replace(both.answers[1], probability=0.01)
    study, found = confirmed(replace(both, answers=(both.answers[0], weak, *both.answers[2:])))
    assert study.causes == ("unknown",)
    assert study.needless == (IDLE,)
    assert found.gap.closed == 0.0


def test_where_the_part_was_not_weighed_the_cause_is_unknown(both, monkeypatch):
    held_out(monkeypatch, 0.09)
    study, _ = confirmed(replace(both, answers=both.answers[:1]))
    assert study.causes == ("unknown",)
    assert study.answers[0].probability == 0.0  # undecided


def test_real_readings_confirm_the_cause(both):
    assert CAUSE in confirmed(both)[0].causes


FRICTION = effect_class("coulomb_friction")
RUBS = Planted(friction=0.03)


def from_half(first, second):
    """One driven run whose later half is read from another campaign."""
    (run,), (other,) = first.runs, second.runs
    time = run.record.time_s
    late = time > time[time.size // 2]
    reading = np.where(late, other.record.yaw_rad, run.record.yaw_rad)
    return replace(first, runs=(replace(run, record=Record(time, reading)),))


@pytest.mark.parametrize("always", [True, False])
def test_a_law_of_one_half_does_not_predict_the_other(always):
    rubs = driven("one run", RUBS)
    data = rubs if always else from_half(driven("one run"), rubs)
    found = nominal_study(data, [FRICTION])
    best = one_more(found.nominal, FRICTION)
    assert best.excess < found.nominal.excess
    study = replace(found, answers=(answer((FRICTION.name,), 0.0, 1.0, best),))
    assert not predict_held_out(best).residuals
    share = share_ahead(study, ())
    assert share > 0.9 if always else share < 0.1
    assert share_ahead(study, [run.id for run in data.runs]) is None


def test_a_later_half_without_a_gap_judges_nothing():
    found = nominal_study(driven("one run", NOTHING), [FRICTION])
    best = one_more(found.nominal, FRICTION)
    assert share_ahead(replace(found, answers=(answer((FRICTION.name,), 0.0, 1.0, best),)), ()) is None


def test_free_decays_are_not_predicted_ahead(both):
    assert share_ahead(both, ()) is None
