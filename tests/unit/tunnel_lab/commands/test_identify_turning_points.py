"""A table of turning points on the command line. Truth: the decay whose extremes were written."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.support.command import Tunnel
from tests.unit.identification.signal.test_turning_points import OMEGA, ZETA, points


def table(folder: Path, head: str, delimiter: str = "\t") -> Path:
    given = points(1)
    rows = "\n".join(
        delimiter.join((f"{t:.3f}", f"{np.rad2deg(y):.4f}", "0.02", "0.115"))
        for t, y in zip(given.time_s, given.angle_rad, strict=True)
    )
    path = folder / "peaks.txt"
    path.write_text(f"{head}\n{rows}\n" if head else f"{rows}\n")
    return path


@pytest.mark.parametrize(
    ("head", "delimiter"),
    [
        ("Time(s), Angle(deg), dTime(1/2 frame)(s), dAngle(0.1deg)", "\t"),  # names between other delimiters
        ("t [s];angle [deg];σ_t [s];σ_angle [deg]", ";"),
        ("time,angle_deg,dtime,dangle_deg", ","),
    ],
)
def test_identify_gives_frequency_and_damping(
    tunnel: Tunnel, tmp_path: Path, head: str, delimiter: str
) -> None:
    path = table(tmp_path, head, delimiter)
    status, out, err = tunnel("identify", path, "--json", tmp_path / "out.json")
    assert status == 0
    assert "peaks: 60 turning points" in out
    assert "the times scatter as stated" in out
    assert "the angles scatter as stated" in out
    assert "need the angle between them too" in out
    assert "peaks: text" in err
    document = json.loads((tmp_path / "out.json").read_text())
    (run,) = document["runs"]
    for name, truth in (("omega_n", OMEGA), ("zeta", ZETA)):
        assert abs(run[name]["value"] - truth) < 4.0 * run[name]["std"]
    assert document["estimator"] == "turning_points"
    assert json.loads(tunnel("identify", path, "--json", "-")[1]) == document


@pytest.mark.parametrize("command", ["diagnose", "import"])
def test_other_commands_say_what_can_be_done(
    tunnel: Tunnel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    path = table(tmp_path, "t [s]\tangle [deg]\tdt [s]\tdangle [deg]")
    rest = ("--out", "rig", "--yes") if command == "import" else ()
    status, out, err = tunnel(command, path, *rest)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "contains 60 turning points" in err
    assert "use tunnel identify FILE for ωn and ζ" in err
    assert [one.name for one in tmp_path.iterdir()] == ["peaks.txt"]


def test_options_that_need_a_record_are_refused(tunnel: Tunnel, tmp_path: Path) -> None:
    path = table(tmp_path, "t [s]\tangle [deg]\tdt [s]\tdangle [deg]")
    assert tunnel("identify", path, "--estimator", "conventional")[0] == 2
    assert tunnel("identify", path, "--budget")[0] == 2
