"""A wrong spring so large that the nominal model loses the phase, in runs that differ by chance as on a rig.

Truth: the forward integrator, a spring 3 % softer than stated, and every run with a speed (0.3 %) and a stiffness
(0.05 %) of its own.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import diagnose, vocabulary
from diagnosis.findings.closing import closed_study
from diagnosis.likelihood.starting_points import loses_phase
from diagnosis.result import Diagnosis
from diagnosis.search.investigate import investigate
from tests.support.gap_campaigns import CN_BETA, CN_R, campaign, nominal
from tunnel_sim.effects import Effect, effect_from
from tunnel_sim.vocabulary.between_runs import Repeatability
from tunnel_sim.vocabulary.campaign import Campaign

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

STATED = tuple((spring, speed) for spring in (16.12, 21.02, 44.84) for speed in (0.0, 13.9, 19.4))
SOFT, BY = 44.84, 0.03
WIND, SPRING = 0.003, 0.0005
CAUSES = vocabulary(("coulomb_friction", "spring_miscalibration", "wind_speed_scatter", "stiffness_scatter"))


def differing(seed: int, *effects: Effect, by: float = BY, stated: bool = False) -> Campaign:
    """Nine runs, their differences stated or not, one spring softer by a share than stated."""
    rng = np.random.default_rng(seed)
    actual = []
    for stiffness, speed in STATED:
        spring, wind = rng.standard_normal(2)
        soft = 1.0 - by * (stiffness == SOFT)
        actual.append((stiffness * soft * (1.0 + SPRING * spring), speed * (1.0 + WIND * wind)))
    data = campaign(*effects, conditions=actual, seed=seed)
    runs = tuple(
        replace(run, spring_stiffness=k, wind_speed=v) for run, (k, v) in zip(data.runs, STATED, strict=True)
    )
    known = Repeatability(wind_speed=WIND, spring_stiffness=SPRING) if stated else data.repeatability
    return replace(data, runs=runs, repeatability=known)


def assert_right(answer: Diagnosis) -> None:
    """Coefficients within 3.5 deviations of the truth, which are neither too wide nor too narrow."""
    for name, truth, greatest in (("cn_beta", CN_BETA, 0.003), ("cn_r", CN_R, 0.003)):
        found = answer.coefficients.after[name]
        assert abs(found.value - truth) < 3.5 * found.known_std
        assert found.known_std < greatest


@pytest.fixture(scope="module")
def answer() -> Diagnosis:
    """The answer where nothing is stated."""
    return diagnose(differing(7), kinds=CAUSES, rivals=())


@pytest.mark.slow
def test_differences_are_told_from_effects_after_stretches(answer: Diagnosis) -> None:
    assert loses_phase(nominal(differing(7)))
    assert set(answer.causes) - {"wind_speed_scatter", "stiffness_scatter"} == {"spring_miscalibration"}
    assert len(answer.causes) > 1
    assert answer.decided
    assert answer.candidates[0].probability > 0.9
    assert_right(answer)


@pytest.mark.slow
def test_stated_differences_do_not_absorb_the_gap(answer: Diagnosis) -> None:
    stated = diagnose(differing(7, stated=True), kinds=CAUSES, rivals=())
    assert stated.causes == ("spring_miscalibration",)
    assert stated.decided
    assert stated.gap.closed > 0.99
    assert stated.gap.excess_before == pytest.approx(answer.gap.excess_before, rel=0.5)
    assert_right(stated)


@pytest.mark.slow
def test_differences_as_stated_are_no_gap() -> None:
    """A small cause beside them is not credited with them."""
    friction = effect_from("coulomb_friction", {"friction_moment": 0.0005})
    study = investigate(differing(7, friction, by=0.0, stated=True), CAUSES, rivals=())
    assert "coulomb_friction" in study.causes
    assert study.nominal.problem.scatter
    assert closed_study(study) is study
