"""What the answer says of itself: the same words in verdict, JSON, terminal and page."""

from __future__ import annotations

import pytest
from diagnosis_document import campaign, document

from diagnosis.answer.reported import on_stretches
from diagnosis.answer.verdict import verdict
from diagnosis.closure import Step, Waterfall
from diagnosis.printing import gap_table
from diagnosis.result import FITTED, HELD_OUT, GapSummary, RunGap
from tunnel_lab.diagnosis_view import view
from tunnel_lab.diagnosis_view.page import render_report


def gap(*held_out: bool) -> GapSummary:
    runs = tuple(RunGap(f"r{i}", 2.0, 0.1, held_out=held) for i, held in enumerate(held_out))
    return GapSummary(True, 2.0, 0.1, 0.9, HELD_OUT if any(held_out) else FITTED, runs, 0.01, 1e-9)


def said(*causes: str, closed_on: str = "somewhere", both_winds: bool = True) -> str:
    return verdict(
        causes,
        before=2.0,
        closed=0.95,
        rest="What remains is small.",
        probability=0.9,
        closed_on=closed_on,
        both_winds=both_winds,
    )


@pytest.mark.parametrize(
    ("held_out", "closed_on", "after_on"),
    [
        ((True, True), "on runs held out of the fit", "on runs held out of the fit"),
        ((True, False), "on runs held out of the fit", "in all runs, 1 of 2 held out of the fit"),
        ((False, False), *["in the fitted runs (none could be held out)"] * 2),
    ],
)
def test_the_runs_of_the_closure_are_named(held_out, closed_on, after_on):
    found = gap(*held_out)
    assert (found.closed_on, found.after_on) == (closed_on, after_on)
    assert f"closes {closed_on}. What remains is small." in said(
        "coulomb_friction", closed_on=found.closed_on
    )


def test_where_no_run_could_be_held_out_the_share_closed_is_that_of_stretches():
    stretches = Waterfall((Step(None, 4.0), Step("coulomb_friction", 0.2)), {}, "on stretches of time")
    found = on_stretches(gap(False, False), stretches)
    assert found.closed == pytest.approx(0.95)
    assert found.closed_on == "on stretches of time"
    assert found.after_on == FITTED
    for kept in (gap(True, False), gap(True, True)):
        assert on_stretches(kept, stretches) is kept
    unnamed = gap(False)
    assert on_stretches(unnamed, Waterfall((Step(None, 4.0),), {}, "on stretches of time")) is unnamed


@pytest.mark.slow
def test_where_no_run_could_be_held_out_nothing_says_that_one_was():
    found = gap(False, False, False)
    given = document()
    given["verdict"] = said("quadratic_damping", closed_on=found.closed_on)
    given["waterfall_on"] = "on stretches of time held out of the fit"
    given["gap"] |= {"closed_on": found.closed_on, "after_on": found.after_on}
    for run in given["gap"]["runs"]:
        run["held_out"] = False
    notes = [fact.note for fact in view.facts(given)]
    assert notes.count(found.closed_on) == 2
    assert not any("on runs held out" in note for note in notes)
    page = render_report(given, campaign())
    assert "on runs held out" not in page
    assert "run held out" not in page
    table = gap_table(given)
    assert table.columns == ("run", "before", "after")


def test_every_cause_of_several_is_named_with_what_it_acts_on():
    text = said("coulomb_friction", "cubic_stiffness", "mains_hum", both_winds=False)
    assert "from coulomb friction, cubic stiffness and mains hum (probability 0.90)" in text
    for words in ("the damping (coulomb friction)", "the restoring moment (cubic stiffness)", "(mains hum)"):
        assert words in text
    assert "With them added" in text
    assert "With it added" in said("coulomb_friction")


@pytest.mark.parametrize("cause", ["coulomb_friction", "nonlinear_yaw_moment"])
def test_the_wind_is_mentioned_only_where_runs_have_it_on_and_off(cause):
    assert "wind" not in said(cause, both_winds=False)
    assert "with the wind on" in said(cause)
    assert ("with the wind on and off" in said(cause)) == (cause == "coulomb_friction")
