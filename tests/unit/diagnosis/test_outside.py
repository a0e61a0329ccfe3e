"""Two springs that are not as stated are no effect of the vocabulary, and take no name of it."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis.search.outside import AnotherSpring, two_springs

from diagnosis import diagnose
from diagnosis.likelihood.residuals import misfit
from diagnosis.search import investigate
from diagnosis.search.weigh import UNKNOWN, FittedSet, weigh
from diagnosis.settings import Settings
from tests.unit.gap_campaigns import campaign, nominal
from tunnel_reference.draw import Mixture, draw_campaign
from tunnel_reference.make import as_campaign, simulate_set
from tunnel_sim.effects import effect_class, known_effects

ERRORS = (0.01, 0.0, -0.015)
KINDS = [effect_class(name) for name in ("gravity_stiffness", "rod_flexibility", "spring_miscalibration")]


@pytest.fixture(scope="module")
def two_off():
    """Three springs, two of them not as stiff as stated, from the reference simulator."""
    drawn = draw_campaign(np.random.default_rng(1), kind="none", mixture=Mixture(variety=0.0))
    stated = drawn.conditions.spring_stiffness
    scale = 1.0 + np.array(ERRORS)[np.unique(stated, return_inverse=True)[1]]
    moved = replace(drawn, conditions=replace(drawn.conditions, stiffness_scale=scale))
    return as_campaign(simulate_set([moved])[0], "two-springs")


def test_two_springs_off_are_unknown_and_said_in_words(two_off):
    found = diagnose(two_off, kinds=KINDS)
    assert tuple(found.causes) == UNKNOWN
    stated = sorted({run.spring_stiffness for run in two_off.runs})
    assert "Two springs that are not as stiff as stated would explain the gap, such as " in found.verdict
    named = [spring for spring in stated if f"{spring:.4g} N m/rad by " in found.verdict]
    assert len(named) == 2


@pytest.mark.slow
def test_without_the_alternative_two_springs_off_take_false_names(two_off, monkeypatch):
    monkeypatch.setattr(investigate, "two_springs", lambda *_: [])
    assert set(diagnose(two_off, kinds=KINDS).causes) == {"gravity_stiffness", "spring_miscalibration"}


def test_two_springs_tell_no_alternative():
    base = nominal(campaign())
    assert len(base.problem.data.springs) == 2
    assert two_springs([], [], base) == []


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
