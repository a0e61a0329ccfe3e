"""``tunnel plan``: what it writes and prints, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.support.command import Tunnel
from tunnel_lab.commands.simulate import rig_time
from tunnel_sim.files.plan_file import load_plan, read_plan

PLAN = """
name = "free"
seed = 3
springs = [5]
wind_speeds = [0.0, 15.0]
release_angles_deg = [10.0, 20.0]
repeats = 2
duration = 12.0
truth = { cn_beta = 0.495, cn_r = -0.114 }
sensor.sample_rate = 100.0
"""
LIMITS = ("--moment", "0.5", "--amplitude", "0.3")


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    path = tmp_path / "free.toml"
    path.write_text(PLAN, encoding="utf-8")
    return path


def test_the_driven_plan_takes_the_same_rig_time_and_the_table_says_what_it_gains(
    tunnel: Tunnel, plan: Path, tmp_path: Path
) -> None:
    out = tmp_path / "driven.toml"
    status, text, _ = tunnel("plan", plan, "--drive", *LIMITS, "--out", out, "--format", "json")
    assert status == 0
    free, driven, ratio = json.loads(text)["rows"]
    assert (free["runs"], driven["runs"]) == (8, 2)
    assert free["rig time [min]"] == driven["rig time [min]"] == 16.6
    for name in ("std Cnβ [1/rad]", "std Cnr [1/rad]"):
        assert free[name] / driven[name] == pytest.approx(ratio[name], abs=0.02)
        assert ratio[name] > 1.0
    made = load_plan(out)
    assert [c.id.split("-d")[0] for c in made.conditions] == ["s5-v0", "s5-v15"]
    assert all(c.drive is not None and c.drive.column == "moment_nm" for c in made.conditions)
    assert rig_time(read_plan(out)) == pytest.approx(rig_time(read_plan(plan)))


def test_rig_time_and_buffeting_can_be_given(tunnel: Tunnel, plan: Path, tmp_path: Path) -> None:
    out = tmp_path / "driven.toml"
    options = ("--minutes", "12", "--buffeting", "0.02", "--goal", "cn_r")
    status, text, _ = tunnel("plan", plan, "--drive", *LIMITS, *options, "--out", out)
    assert status == 0
    assert "repeated to the same rig time" in text
    assert f"Written: {out}" in text
    assert " N m peak; response up to " in text
    made = read_plan(out)
    assert rig_time(made) == pytest.approx(720.0)
    assert [effect.parameters["intensity"] for effect in made.effects] == [0.02]


def test_a_driven_plan_and_the_plan_itself_are_refused(tunnel: Tunnel, plan: Path, tmp_path: Path) -> None:
    status, _, err = tunnel("plan", plan, "--drive", *LIMITS, "--out", plan)
    assert (status, plan.read_text(encoding="utf-8")) == (2, PLAN)
    assert "is the plan itself" in err
    plan.write_text(PLAN + 'drive = { kind = "sine", frequency_hz = 2.0, amplitudes_nm = [0.1] }\n')
    status, _, err = tunnel("plan", plan, "--drive", *LIMITS, "--out", tmp_path / "driven.toml")
    assert status == 2
    assert "has a [drive] already" in err
