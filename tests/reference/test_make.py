"""Sets of campaigns on disk."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.reference.rigs import rig
from tunnel_reference import draw, make
from tunnel_reference.draw import DEFAULT_SHARES, Mixture
from tunnel_reference.forms import FAMILIES
from tunnel_sim.files.campaign_io import read_campaign
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
def test_a_set_is_written_in_the_campaign_format_and_is_reproducible(tmp_path):
    arguments = ["--count", "3", "--seed", "5", "--kinds", "none:1,single:2"]
    for name in ("a", "b"):
        assert make.main([str(tmp_path / name), *arguments]) == 0
    truths = [json.loads((tmp_path / "a" / f"c000{i}" / "truth.json").read_text()) for i in (1, 2, 3)]
    assert sorted(t["kind"] for t in truths) == ["none", "single", "single"]
    for number, truth in enumerate(truths, 1):
        one, two = (read_campaign(tmp_path / name / f"c000{number}") for name in ("a", "b"))
        assert len(truth["effects"]) == (truth["kind"] == "single")
        for left, right in zip(one.runs, two.runs, strict=True):
            assert np.array_equal(left.record.yaw_rad, right.record.yaw_rad)


def test_a_folder_with_something_in_it_is_refused(tmp_path, capsys):
    (tmp_path / "kept.txt").write_text("mine")
    assert make.main([str(tmp_path), "--count", "1", "--seed", "1"]) == 2
    assert "not empty" in capsys.readouterr().err


@pytest.mark.parametrize(("text", "complaint"), [("singel", "did you mean"), ("pair:-1", "bad weight"),
                                                 ("pair:x", "bad weight")])  # fmt: skip
def test_bad_kinds_are_refused(text, complaint):
    with pytest.raises(TunnelError, match=complaint):
        make.parse_shares(text)
