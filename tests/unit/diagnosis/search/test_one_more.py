"""One effect more: its starting points, and the sets to which it is added."""

from dataclasses import replace

from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.starting_points import starting_points
from diagnosis.model.parameters import Point
from diagnosis.search import one_more
from diagnosis.search.grow import grow
from diagnosis.search.hypothesis import Hypothesis
from tests.support.gap_campaigns import nominal, whole_runs
from tests.unit.diagnosis.search.test_grow import campaign, within_noise
from tunnel_sim.effects import effect_class, effect_from


def test_a_fit_that_ends_worse_than_without_the_effect_starts_again_nearby(monkeypatch):
    """From an offset that leaves no wind, derivatives run away."""
    kind = effect_class("wind_speed_offset")
    base = nominal(campaign(effect_from(kind.name, {"offset": 0.5})))
    (start,) = starting_points(base, kind)
    common = start.point.common.copy()
    common[start.scaled] = -40.0
    far = replace(start, point=Point(common, start.point.per_run))
    assert fit(far.problem, far.point, base=base).total > base.total
    monkeypatch.setattr(one_more, "starting_points", lambda *_: [far])
    assert within_noise(grow(whole_runs(base, [kind]))[0].fit)


def test_a_second_effect_is_added_to_the_textbook_form_as_well(monkeypatch):
    tried = []
    monkeypatch.setattr(one_more, "_worth_fitting", lambda parent, _kinds: tried.append(parent) or [])
    one_more.sets_with_one_more([Hypothesis(("a",), 1, 2), Hypothesis(("a", "b"), 3, 4)], [], None)
    assert [(h.effects, h.fit) for h in tried] == [(("a",), 1), (("a", "b"), 3), (("a",), 2)]
