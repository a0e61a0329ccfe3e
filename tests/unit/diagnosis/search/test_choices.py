"""Two springs cannot say which of them is off: both choices are weighed, said and averaged over.

Truth: the stiffer of two springs is 2 % stiffer than stated.
"""

from dataclasses import asdict, replace

import numpy as np
import pytest

from diagnosis.findings.averaged_coefficients import coefficients, possible_answers
from diagnosis.findings.next_steps import next_steps
from diagnosis.findings.spring_choices import spring_choices
from diagnosis.findings.verdict import verdict
from diagnosis.likelihood.least_squares import fit, scaled_residuals
from diagnosis.likelihood.residuals import misfit
from diagnosis.model.run_noise import WhiteNoise
from diagnosis.search.choices import _exchanged
from diagnosis.search.investigate import investigate
from diagnosis.search.study import _gap_beside
from tests.support.diagnosis_document import document, findings_of
from tests.support.gap_campaigns import CN_BETA, campaign, precise
from tunnel_sim.effects import effect_class, effect_from

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

NAME = "spring_miscalibration"
KINDS = [effect_class(NAME), effect_class("coulomb_friction")]


@pytest.fixture(scope="module")
def study():
    off = effect_from(NAME, {"spring_stiffness": 44.84, "error": 0.02})
    return investigate(precise(campaign(off, duration=5.0)), KINDS)


def test_both_springs_are_choices_of_equal_probability(study):
    assert study.fitted == (NAME,)
    found = study.answer.choices
    errors = {}
    for one in found:
        stiffness = dict(one.hypothesis.fit.problem.fixed)[f"{NAME}.spring_stiffness"]
        own = study.similarity.own(stiffness, "N m/rad")
        errors[round(own, 2)] = one.hypothesis.fit.value(f"{NAME}.error")
    assert errors == {44.84: pytest.approx(0.02, rel=1e-2), 16.12: pytest.approx(-0.02 / 1.02, rel=1e-2)}
    assert [one.probability for one in found] == pytest.approx([0.5, 0.5], abs=0.05)


def test_the_interval_holds_the_truth_of_either_choice(study):
    found = coefficients(possible_answers(study, KINDS), study.campaign)["cn_beta"]
    ends = [one.hypothesis.fit.value("cn_beta") for one in study.answer.choices]
    assert abs(ends[0] - ends[1]) > 0.01 * CN_BETA
    assert found.value == pytest.approx(0.5 * sum(ends), abs=0.2 * abs(ends[0] - ends[1]))
    assert abs(found.value - CN_BETA) < 2.0 * found.std


def test_both_springs_are_stated_with_their_errors_and_probabilities(study):
    found = sorted(spring_choices(study), key=lambda one: one.stiffness)
    assert [one.stiffness for one in found] == pytest.approx([16.12, 44.84])
    assert [one.error for one in found] == pytest.approx([-0.02 / 1.02, 0.02], rel=1e-2)
    assert sum(one.probability for one in found) == pytest.approx(1.0)
    assert spring_choices(replace(study, answers=(replace(study.answer, choices=()),))) == ()


def test_the_other_spring_leaves_the_same_residuals_before_it_is_fitted(study):
    """So that no fit of it can end elsewhere: with two springs it is the same motion in other units of moment."""
    first, other = study.answer.choices
    exchanged = _exchanged(first.hypothesis.fit, f"{NAME}.error")
    left = np.concatenate(scaled_residuals(other.hypothesis.fit.problem, exchanged))
    assert left == pytest.approx(np.concatenate(first.hypothesis.fit.residuals), abs=1e-6)


def test_choices_are_sought_in_the_noise_in_which_an_answer_is_fitted(study):
    """A random moment beside a spring is noise of the fit, and does not tell the springs apart."""
    fitted = study.answer.hypothesis.fit
    runs = tuple(replace(run, noise=WhiteNoise(2.0 * run.noise.variance)) for run in fitted.problem.data.runs)
    data = fitted.problem.data.with_runs(runs)
    gap = _gap_beside(fit(replace(fitted.problem, data=data), fitted.point), study.nominal)
    assert gap.excess.sum() == pytest.approx(0.5 * misfit(study.nominal).excess.sum(), rel=0.05)
    assert _gap_beside(fitted, study.nominal).excess == pytest.approx(misfit(study.nominal).excess)


def test_the_first_step_is_to_tell_the_springs_apart(study):
    given = document() | {"causes": [NAME], "ambiguous_with": []}
    springs = sorted(spring_choices(study), key=lambda one: one.stiffness)
    given["found"] |= {"choices": [asdict(one) | {"probability": 0.5} for one in springs]}
    assert next_steps(findings_of(given))[0] == (
        "Measure the stiffness of both springs again (16.12 and 44.84 N m/rad), or add runs with a third spring: "
        "shows which of them is off."
    )
    assert not any("Measure the stiffness of that spring" in step for step in next_steps(findings_of(given)))
    assert verdict(findings_of(given), "").endswith(
        "One of the two springs is off, and these runs do not show which: 16.12 N m/rad is 1.96 % softer than "
        "stated (50 %), or 44.84 N m/rad is 2.00 % stiffer than stated (50 %). The coefficients are "
        "averaged over both."
    )
