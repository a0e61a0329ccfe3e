"""Rivals from outside the vocabulary: two springs that are off, and one of one's own in this file."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from diagnosis import diagnose
from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.residuals import misfit
from diagnosis.model.fact import as_stated
from diagnosis.search.answer import UNKNOWN
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.investigate import investigate
from diagnosis.search.rivals.inertia_by_spring import InertiaBySpring
from diagnosis.search.rivals.rival import Rival
from diagnosis.search.rivals.two_springs import AnotherSpring, SpringError, TwoSprings
from diagnosis.search.weigh import weigh
from diagnosis.search.weights import FittedSet
from diagnosis.settings import Settings
from tests.support.gap_campaigns import campaign, nominal
from tests.unit.diagnosis.search.rivals.test_inertia_by_spring import decays
from tunnel_sim.effects import effect_class, known_effects

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

ERRORS = {16.12: 0.01, 28.3: 0.0, 44.84: -0.015}
KINDS = [effect_class(name) for name in ("gravity_stiffness", "rod_flexibility", "spring_miscalibration")]


@pytest.fixture(scope="module")
def two_off():
    """Three springs, two of them not as stiff as stated, in closed form."""
    return decays(dict.fromkeys(ERRORS, 0.0), ERRORS)


@pytest.mark.parametrize(("error", "side"), [(0.0196, "stiffer"), (-0.0196, "softer")])
def test_a_spring_that_is_off_is_said_with_its_side(error, side):
    assert SpringError(16.12, error, 0.001).words == f"16.12 N m/rad is 1.96 ± 0.10 % {side} than stated"


def test_two_springs_off_are_unknown_and_said_in_words(two_off):
    found = diagnose(two_off, kinds=KINDS[::2], rivals=(TwoSprings(), InertiaBySpring()))
    assert tuple(found.causes) == UNKNOWN
    stated = sorted({run.spring_stiffness for run in two_off.runs})
    assert "Two springs that are not as stiff as stated would explain the gap: for example, " in found.verdict
    named = [spring for spring in stated if f"{spring:.4g} N m/rad is " in found.verdict]
    assert len(named) == 2


@pytest.mark.slow
def test_without_the_rival_two_springs_off_take_false_names(two_off):
    assert set(diagnose(two_off, kinds=KINDS, rivals=()).causes) == {
        "gravity_stiffness",
        "spring_miscalibration",
    }


def test_two_springs_tell_no_alternative():
    base = nominal(campaign())
    assert len(base.problem.data.springs) == 2
    assert TwoSprings().hypotheses([], [], base) == []


def test_what_is_outside_is_probable_of_unknown():
    base = nominal(campaign())
    left = np.zeros(6)
    found = misfit(base)
    gap = replace(found, chi2=found.chi2 + 1e3 * (20.0 + 1e-6 * found.motion))
    inside = FittedSet(("a", "b"), 0.01, left)
    alone = {w.effects: w.probability for w in weigh([inside], gap, Settings().weighing)}
    both = {
        w.effects: w.probability
        for w in weigh([inside, FittedSet(("c", "d"), 0.01, left, outside=True)], gap, Settings().weighing)
    }
    assert both.keys() == alone.keys() == {("a", "b"), UNKNOWN}
    assert sum(both.values()) == pytest.approx(1.0)
    assert both["a", "b"] == pytest.approx(0.5 * alone["a", "b"], rel=0.05)


def test_the_alternative_is_no_effect_of_the_vocabulary():
    assert AnotherSpring not in known_effects()


class OneRunOff(Rival):
    """The stiffness of a single run is not the one stated."""

    def hypotheses(self, likely, known, nominal):
        del likely, known
        data = nominal.problem.data

        def changed(index, error):
            run = data.runs[index]
            other = replace(run, spring_stiffness=run.spring_stiffness * (1.0 + error))
            runs = (*data.runs[:index], other, *data.runs[index + 1 :])
            return fit(Problem(data.with_runs(runs)), nominal.point)

        def best(index):
            found = minimize_scalar(
                lambda error: changed(index, error).total, bounds=(-0.05, 0.05), method="bounded"
            )
            return changed(index, found.x)

        fits = {data.runs[index].id: best(index) for index in (2, 3)}  # all six take three times as long
        run = min(fits, key=lambda run: fits[run].total)
        return [Hypothesis((f"spring of {run}",), fits[run])]

    def fact(self, best, similarity):
        del similarity
        return as_stated(f"The {best.effects[0]} would explain the gap: measure it again.")


def one_run_off():
    """The rig has another spring in its fourth run than its record says."""
    data = campaign(duration=5.0)
    run = data.runs[3]
    runs = (*data.runs[:3], replace(run, spring_stiffness=1.01 * run.spring_stiffness), *data.runs[4:])
    return replace(data, runs=runs)


def test_a_rival_of_ones_own_is_weighed_counts_for_unknown_and_is_said():
    kinds = [effect_class(name) for name in ("quadratic_damping", "spring_miscalibration")]
    said = diagnose(one_run_off(), kinds=kinds, rivals=(OneRunOff(),))
    names = [candidate.effect for candidate in said.candidates]
    assert "spring of r4" not in names
    (after,) = (one.probability for one in said.candidates if one.effect == UNKNOWN[0])
    without = investigate(one_run_off(), kinds, rivals=())
    (before,) = (one.probability for one in without.answers if one.effects == UNKNOWN)
    assert before < 0.15  # the other springs explain the gap as well; one run alone shows which
    assert 0.4 < after < 0.6
    assert said.verdict.endswith("The spring of r4 would explain the gap: measure it again.")
