"""Two springs cannot say which of them is off: both choices are weighed, said and averaged over.

Truth: the stiffer of two springs is 2 % stiffer than stated.
"""

from dataclasses import replace

import pytest

from diagnosis.answer.coefficients import coefficients, possible_answers
from diagnosis.answer.judgements import spring_choices
from diagnosis.likelihood.residuals import misfit
from diagnosis.search.choices import choices
from diagnosis.search.investigate import investigate
from tests.unit.gap_campaigns import CN_BETA, CONDITIONS, campaign, precise
from tunnel_sim.effects import effect_class, effect_from

NAME = "spring_miscalibration"
KINDS = [effect_class(NAME), effect_class("coulomb_friction")]


@pytest.fixture(scope="module")
def study():
    off = effect_from(NAME, {"spring_stiffness": 44.84, "error": 0.02})
    return investigate(precise(campaign(off)), KINDS)


def test_both_springs_are_choices_of_equal_probability(study):
    assert study.fitted == (NAME,)
    found = study.choices[(NAME,)]
    errors = {}
    for one in found:
        stiffness = dict(one.hypothesis.fit.problem.fixed)[f"{NAME}.spring_stiffness"]
        own = study.similarity.own(stiffness, "N m/rad")
        errors[round(own, 2)] = one.hypothesis.fit.value(f"{NAME}.error")
    assert errors == {44.84: pytest.approx(0.02, rel=1e-2), 16.12: pytest.approx(-0.02 / 1.02, rel=1e-2)}
    assert [one.probability for one in found] == pytest.approx([0.5, 0.5], abs=0.05)


def test_the_interval_holds_the_truth_of_either_choice(study):
    found = coefficients(possible_answers(study, KINDS), study.campaign)["cn_beta"]
    ends = [one.hypothesis.fit.value("cn_beta") for one in study.choices[(NAME,)]]
    assert abs(ends[0] - ends[1]) > 0.01 * CN_BETA
    assert found.value == pytest.approx(0.5 * sum(ends), abs=0.2 * abs(ends[0] - ends[1]))
    assert abs(found.value - CN_BETA) < 2.0 * found.std


def test_both_springs_are_stated_with_their_errors_and_probabilities(study):
    found = sorted(spring_choices(study), key=lambda one: one.stiffness)
    assert [one.stiffness for one in found] == pytest.approx([16.12, 44.84])
    assert [one.error for one in found] == pytest.approx([-0.02 / 1.02, 0.02], rel=1e-2)
    assert sum(one.probability for one in found) == pytest.approx(1.0)
    assert spring_choices(replace(study, choices={})) == ()


def test_a_third_spring_leaves_no_choice():
    off = effect_from(NAME, {"spring_stiffness": 44.84, "error": 0.02})
    study = investigate(campaign(off, conditions=(*CONDITIONS, (30.0, 0.0), (30.0, 25.0))), KINDS)
    assert study.fitted == (NAME,)
    assert choices(study.hypothesis((NAME,)), misfit(study.nominal)) == ()
    assert not study.choices
