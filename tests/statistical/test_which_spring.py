"""Which of the springs is off, on campaigns of the reference simulator with dry friction.

Truth: one of two springs is 2 % off; two springs do not show which. With a third spring they can.
"""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.findings.averaged_coefficients import coefficients, possible_answers
from diagnosis.search.investigate import investigate
from identification import identify
from tests.reference.rigs import rig
from tunnel_reference.draw import CampaignDraw, EffectDraw
from tunnel_reference.forms import forms_of
from tunnel_reference.make import as_campaign
from tunnel_reference.severity import read_and_fit, simulate_motions
from tunnel_sim.effects import effect_class

CN_BETA, ERROR = 0.55, 0.02
KINDS = [effect_class(name) for name in ("coulomb_friction", "spring_miscalibration", "quadratic_damping")]

pytestmark = pytest.mark.slow


def with_friction(springs, wrong, error, seed):
    """Wind off and on with every spring; ``wrong`` is the place of the spring that is off."""
    stiffness, speed = np.repeat(springs, 2), np.tile([0.0, 15.0], len(springs))
    conditions = rig(stiffness, speed, np.full(speed.size, 0.35), 10.0, cn_beta=CN_BETA)
    effects = [EffectDraw(forms_of("coulomb_friction")[0], {}, 1, 0.0, 0.01)]
    if error:
        one = forms_of("spring_miscalibration")[0]
        effects.append(EffectDraw(one, {"spring": float(wrong)}, int(np.sign(error)), 0.0, abs(error)))
    draw = CampaignDraw("pair", replace(conditions, stated_noise=4e-4), tuple(effects), seed)
    (motion,) = simulate_motions([draw], fine=False)
    return as_campaign(read_and_fit(draw, motion), "which")


@pytest.mark.parametrize(
    ("wrong", "error", "seed"), [(0, 0.02, 1), (1, 0.02, 2), (0, -0.02, 3), (1, -0.02, 4)]
)
def test_both_of_two_springs_are_named_and_the_interval_covers_the_truth(wrong, error, seed):
    study = investigate(with_friction((16.12, 44.84), wrong, error, seed), KINDS)
    assert study.causes == ("coulomb_friction", "spring_miscalibration")
    found = study.answer.choices
    errors = sorted(one.hypothesis.fit.value("spring_miscalibration.error") for one in found)
    assert errors == pytest.approx(sorted([error, 1.0 / (1.0 + error) - 1.0]), abs=5e-4)
    assert [one.probability for one in found] == pytest.approx([0.5, 0.5], abs=0.02)
    stated = coefficients(possible_answers(study, KINDS), study.campaign)["cn_beta"]
    low, high = stated.interval or (stated.value - 1.96 * stated.std, stated.value + 1.96 * stated.std)
    assert low < CN_BETA < high
    assert all(low < one.hypothesis.fit.value("cn_beta") < high for one in found)


@pytest.mark.parametrize(("wrong", "seed"), [(0, 5), (2, 6)])
def test_a_third_spring_tells_which_one_is_off(wrong, seed):
    springs = (16.12, 21.02, 44.84)
    study = investigate(with_friction(springs, wrong, ERROR, seed), KINDS)
    assert study.causes == ("coulomb_friction", "spring_miscalibration")
    assert not study.answer.choices
    stated = dict(study.chosen.problem.fixed)["spring_miscalibration.spring_stiffness"]
    assert study.similarity.own(stated, "N m/rad") == pytest.approx(springs[wrong])


@pytest.mark.parametrize(("error", "said"), [(0.02, True), (-0.02, True), (0.0, False)])
def test_identify_says_that_two_springs_disagree(error, said):
    found = identify(with_friction((16.12, 44.84), 1, error, 7))
    assert any("do not show which" in one.what for one in found.remarks) == said
