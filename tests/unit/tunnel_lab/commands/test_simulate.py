"""``tunnel simulate``: what it writes and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.support.command import Tunnel
from tunnel_sim.files.plan_file import load_plan
from tunnel_sim.vocabulary.plan import CampaignPlan

PLAN = Path(__file__).parents[3] / "data" / "tiny-plan.toml"


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def plan() -> CampaignPlan:
    return load_plan(PLAN)


def test_a_plan_becomes_a_campaign_that_can_be_identified(tunnel: Tunnel, tmp_path: Path) -> None:
    status, out, _ = tunnel("simulate", PLAN, "--out", tmp_path / "c")
    assert status == 0
    assert f"Written: {tmp_path / 'c'} (2 runs)" in out
    assert {"campaign.toml", "truth.json"} <= contents(tmp_path / "c").keys()
    assert tunnel("identify", tmp_path / "c", "--json", tmp_path / "e.json")[0] == 0
    found = json.loads((tmp_path / "e.json").read_text(encoding="utf-8"))["cn_beta"]
    assert abs(found["value"] - 0.495) < 4.0 * found["std"]


def test_the_same_seed_gives_the_same_bytes_and_another_does_not(tunnel: Tunnel, tmp_path: Path) -> None:
    for name, seed in (("a", "5"), ("b", "5"), ("c", "6")):
        assert (
            tunnel("simulate", PLAN, "--out", tmp_path / name, "--seed", seed, "--file-format", "csv")[0] == 0
        )
    a, b, c = (contents(tmp_path / name) for name in "abc")
    assert a == b
    assert a.keys() == c.keys()
    assert a != c
    assert any(name.endswith(".csv") for name in a)


def test_a_campaign_is_not_overwritten_unasked(tunnel: Tunnel, tmp_path: Path) -> None:
    assert tunnel("simulate", PLAN, "--out", tmp_path / "c")[0] == 0
    before = contents(tmp_path / "c")
    status, out, err = tunnel("simulate", PLAN, "--out", tmp_path / "c", "--seed", "9")
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert "--overwrite" in err
    assert contents(tmp_path / "c") == before
    assert tunnel("simulate", PLAN, "--out", tmp_path / "c", "--seed", "9", "--overwrite")[0] == 0
    assert contents(tmp_path / "c") != before


def test_a_folder_below_a_file_is_refused(tunnel: Tunnel, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    status, out, err = tunnel("simulate", PLAN, "--out", tmp_path / "taken" / "c")
    assert (status, out) == (2, "")
    assert err.startswith("tunnel: ")
    assert err.count("\n") == 1
