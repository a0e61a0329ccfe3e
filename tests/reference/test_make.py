"""Sets of campaigns."""

from __future__ import annotations

import numpy as np
import pytest

from tests.reference.rigs import rig
from tunnel_reference import draw, make
from tunnel_reference.draw import DEFAULT_SHARES, Mixture
from tunnel_reference.forms import FAMILIES
from tunnel_sim.vocabulary.errors import TunnelError


def test_kinds_follow_their_shares():
    kinds = make.plan_kinds(230, DEFAULT_SHARES)
    assert len(kinds) == 230
    for kind, share in DEFAULT_SHARES.items():
        assert abs(kinds.count(kind) - 230 * share) < 1.0


def test_single_effects_come_equally_often():
    draws = make.draw_set(3 * len(FAMILIES), 1, {"single": 1.0}, Mixture())
    names = [d.effects[0].form.family for d in draws]
    assert {names.count(name) for name in names} == {3}


@pytest.fixture
def short_runs(monkeypatch):
    """Campaigns of four short runs, so that a set is made quickly."""
    c = rig((21.02, 67.98, 21.02, 67.98), (0.0, 0.0, 25.0, 15.0), (0.35,) * 4)
    monkeypatch.setattr(draw, "draw_conditions", lambda _rng: c)


@pytest.mark.slow
@pytest.mark.usefixtures("short_runs")
def test_a_set_is_reproducible():
    def made():
        return make.simulate_set(make.draw_set(3, 5, {"none": 1.0, "single": 2.0}, Mixture()))

    first, second = made(), made()
    truths = [make.truth_of(one) for one in first]
    assert sorted(t["kind"] for t in truths) == ["none", "single", "single"]
    for truth, one, two in zip(truths, first, second, strict=True):
        assert len(truth["effects"]) == (truth["kind"] == "single")
        left, right = make.as_campaign(one, "one"), make.as_campaign(two, "two")
        for run, same in zip(left.runs, right.runs, strict=True):
            assert np.array_equal(run.record.yaw_rad, same.record.yaw_rad)


@pytest.mark.parametrize(("text", "complaint"), [("singel", "did you mean"), ("pair:-1", "bad weight"),
                                                 ("pair:x", "bad weight")])  # fmt: skip
def test_bad_kinds_are_refused(text, complaint):
    with pytest.raises(TunnelError, match=complaint):
        make.parse_shares(text)
