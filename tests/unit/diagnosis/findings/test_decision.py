"""Whether a diagnosis decides between its answers, and why not."""

from __future__ import annotations

import pytest

from diagnosis.findings.decision import Predictions, decision
from diagnosis.settings import Settings


@pytest.mark.parametrize(
    ("size", "unknown", "decided"), [(0.3, 0.2, False), (0.3, 0.03, True), (0.1, 0.2, True)]
)
def test_a_size_that_differs_between_the_runs_makes_an_unknown_cause_likelier(
    size: float, unknown: float, decided: bool
) -> None:
    answers = [("free_play", 0.7), ("unknown", unknown), ("coulomb_friction", 0.3 - unknown)]
    found = decision(answers, Settings().answer, Predictions(held_out=0.98, size=size))
    assert found.decided == decided
    said = "Free play fits best, but differs by 30 % in size between the runs, beyond its errors."
    assert (said in found.words("the runs")) != decided


def test_the_credible_set_is_the_smallest_with_nine_tenths():
    answers = (("free_play", 0.35), ("cubic_stiffness", 0.33), ("quadratic_damping", 0.25), ("unknown", 0.07))
    assert decision(answers, Settings().answer).credible == answers[:3]
    assert decision((("none", 0.999), ("unknown", 0.001)), Settings().answer).credible == (("none", 0.999),)


@pytest.mark.parametrize(
    ("predictions", "doubt"),
    [
        (Predictions(held_out=0.0), "explains nothing of the gap on held-out readings"),
        (Predictions(held_out=0.09), "explains only 9.0 % of the gap on held-out readings"),
        (Predictions(held_out=0.98, ahead=0.0), "explains nothing of the gap in the later half of the runs"),
        (
            Predictions(held_out=0.98, patched=0.02),
            "explains only 2.0 % of the gap when written into the model",
        ),
        (
            Predictions(held_out=0.98, under_load=0.02),
            "leaves 2.0 % of the gap: friction under load may follow another law",
        ),
        (Predictions(held_out=0.98, left=0.16), "leaves a residual of 16.0 % of the swing on held-out"),
        (
            Predictions(held_out=0.98, part=20.8),
            "explains the gap by cancelling: with a part of the causes the misfit is 21 times",
        ),
        (
            Predictions(held_out=0.98, pattern=0.0032),
            "leaves a difference of 0.32 % between the runs that follows a condition of the plan",
        ),
        (
            Predictions(held_out=0.98, still_air=0.052),
            "leaves 5.2 % of the gap in the runs in still air, fitted alone",
        ),
        (
            Predictions(held_out=0.98, scatter=2.6),
            "needs at least 2.6 times the scatter that is stated or usual",
        ),
        (Predictions(held_out=0.2, ahead=0.2, patched=0.2, left=0.09, part=1.0, scatter=1.8), ""),
        (Predictions(), ""),
    ],
)
def test_an_answer_that_predicts_nothing_is_undecided(predictions, doubt):
    answers = (("free_play", 0.61), ("coulomb_friction", 0.35), ("unknown", 0.04))
    found = decision(answers, Settings().answer, predictions)
    assert found.decided is not bool(doubt)
    assert bool(found.unpredictive) is bool(doubt)
    assert [name for name, _ in found.credible] == ["free_play", "coulomb_friction"]
    words = found.words("the runs")
    assert ("Free play fits best, but" in words) is bool(doubt)
    assert doubt in words
    assert decision((("unknown", 0.9), ("free_play", 0.1)), Settings().answer, predictions).decided


def test_the_verbs_of_a_doubt_agree_with_the_number_of_causes():
    answers = (("coulomb_friction + gravity_stiffness", 0.71), ("unknown", 0.29))
    words = decision(answers, Settings().answer, Predictions(held_out=0.05, left=0.22)).words("the runs")
    assert words.partition(". The answer")[0].endswith(
        "fit best, but explain only 5.0 % of the gap on held-out readings and leave a residual of 22.0 % of the "
        "swing on held-out readings"
    )
