"""What a study answers when it is asked for a cause: the better of two explanations by the same effects."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from diagnosis.attribution.decide import Weighed
from diagnosis.attribution.hypothesis import Hypothesis
from diagnosis.attribution.random_moments import RandomAnswer
from diagnosis.investigate import _polished
from tests.unit.gap_campaigns import campaign, nominal, studied
from tunnel_sim.effects import effect_class, effect_from

if TYPE_CHECKING:
    from diagnosis.fitting.least_squares import Fit
    from diagnosis.study import Study


def _with_excess(fitted: Fit, excess: float) -> Fit:
    return replace(fitted, chi2=fitted.chi2 / fitted.chi2.sum() * (1.0 + excess) * fitted.count)


@pytest.fixture(scope="module")
def study() -> Study:
    """The nominal fit's excess is 1, and a fit with vortex shedding leaves half of it."""
    data = campaign(effect_from("quadratic_damping", {"coefficient": 0.003}))
    base = nominal(data)
    found = studied(data, _with_excess(base, 1.0))
    steady = _with_excess(base, 0.5)
    return replace(found, hypotheses=(Hypothesis(("vortex_shedding",), steady),))


@pytest.mark.parametrize(("share", "is_random"), [(0.4, True), (0.6, False)])
def test_a_random_moment_answers_where_it_leaves_less_than_the_steady_one(
    study: Study, share: float, is_random: bool
) -> None:
    moment = RandomAnswer(effect_class("vortex_shedding"), None, None, share)  # type: ignore[arg-type]
    asked = replace(study, random=(moment,)).random_answer(("vortex_shedding",))
    assert (asked is moment) == is_random


@pytest.mark.parametrize("random", [False, True])
def test_the_answer_is_polished_unless_a_random_moment_gives_it(
    study: Study, monkeypatch: pytest.MonkeyPatch, random: bool
) -> None:
    polished = replace(study.hypotheses[0], textbook=study.nominal)
    monkeypatch.setattr("diagnosis.investigate.polish", lambda _: polished)
    moment = RandomAnswer(effect_class("vortex_shedding"), None, None, 0.4)  # type: ignore[arg-type]
    found = _polished(study.hypotheses, Weighed(("vortex_shedding",), 0.5, 0.9), (moment,) if random else ())
    assert found == (study.hypotheses if random else (polished,))
