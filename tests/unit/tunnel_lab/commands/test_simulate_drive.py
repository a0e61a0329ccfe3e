"""``tunnel simulate`` of a plan with a drive: what it writes, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.support.command import Tunnel
from tunnel_lab.plotting.runs import trace_pages
from tunnel_sim.engine.virtual_campaign import simulate_campaign
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.plan_file import load_plan

PLAN = """
name = "driven"
seed = 3
springs = [5]
wind_speeds = [0.0, 15.0]
duration = 6.0
truth = { cn_beta = 0.495, cn_r = -0.114 }
sensor.sample_rate = 100.0
drive = { kind = "multisine", from_hz = 0.5, to_hz = 5.0, amplitudes_nm = [0.4], hold = "zero" }
"""


def test_the_command_writes_the_input_its_hold_and_a_picture(tunnel: Tunnel, tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(PLAN, encoding="utf-8")
    folder, picture = tmp_path / "c", tmp_path / "runs.png"
    status, out, _ = tunnel("simulate", tmp_path / "plan.toml", "--out", folder, "--picture", picture)
    assert status == 0
    assert f"Written: {picture}" in out
    assert picture.read_bytes().startswith(b"\x89PNG")
    campaign = read_campaign(folder)
    expected = simulate_campaign(load_plan(tmp_path / "plan.toml"))
    for run, wanted in zip(campaign.runs, expected.runs, strict=True):
        assert run.drive is not None
        assert wanted.drive is not None
        assert (run.drive.column, run.drive.hold) == ("moment_nm", "zero")
        assert np.array_equal(run.drive.values, wanted.drive.values)
    panels = trace_pages(campaign)[0].axes
    assert [axes.get_ylabel() for axes in panels].count("moment [N m]") == len(campaign.runs)


def test_a_bad_drive_is_one_line_and_writes_nothing(tunnel: Tunnel, tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(PLAN.replace("5.0", "500.0"), encoding="utf-8")
    status, _, err = tunnel("simulate", tmp_path / "plan.toml", "--out", tmp_path / "c")
    assert status == 2
    assert len(err.strip().splitlines()) == 1
    assert "to_hz = 500 is not below half the sample rate" in err
    assert not (tmp_path / "c").exists()
    (tmp_path / "plan.toml").write_text(PLAN, encoding="utf-8")
    status, _, err = tunnel(
        "simulate", tmp_path / "plan.toml", "--out", tmp_path / "c", "--picture", "runs.pdf"
    )
    assert (status, (tmp_path / "c").exists()) == (2, False)
    assert "does not end in .png" in err
