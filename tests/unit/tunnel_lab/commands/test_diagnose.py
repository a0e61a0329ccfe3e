"""``tunnel diagnose``: words first, JSON whole, one line for bad input.

Truth: closed forms, and friction planted by the project's own simulator (what is checked here is the command).
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from diagnosis.findings.next_steps import next_steps
from diagnosis.result import Diagnosis
from tests.reference.free_decays import Setting, campaign
from tests.support.command import Tunnel
from tests.support.plans import planned
from tests.unit.tunnel_lab.conftest import PROGRESS
from tunnel_sim.effects import ALL_EFFECTS
from tunnel_sim.engine.virtual_campaign import simulate_campaign
from tunnel_sim.files.campaign_folder import write_campaign

CAUSE = "coulomb_friction"
PLAN = """
name = "dry"
seed = 3
springs = [5, 8]
wind_speeds = [0.0, 15.0]
release_angles_deg = [20.0]
duration = 5.0
truth = { cn_beta = 0.5, cn_r = -0.11 }

[[effects]]
name = "coulomb_friction"
parameters = { friction_moment = 0.01 }
"""


@pytest.fixture(scope="module")
def dry(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four short runs with dry friction."""
    folder = tmp_path_factory.mktemp("diagnose")
    return write_campaign(simulate_campaign(planned(folder, PLAN)), folder / "dry")


@pytest.fixture
def gap_free(tmp_path: Path) -> Path:
    """Two springs, wind off and on, in closed form."""
    settings = [Setting(spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 15.0)]
    data = campaign(settings, duration=5.0, rate=500.0, noise=5e-4, rng=np.random.default_rng(8))
    return write_campaign(data, tmp_path / "free")


@pytest.mark.usefixtures("causes_alone")
def test_a_planted_effect_is_named_in_words_and_in_the_json(
    tunnel: Tunnel, dry: Path, tmp_path: Path
) -> None:
    file = tmp_path / "answer.json"
    status, out, err = tunnel("diagnose", dry, "--effects", f"{CAUSE},quadratic_damping", "--json", file)
    assert status == 0
    assert all(PROGRESS.match(line) for line in err.splitlines())
    document = json.loads(file.read_text(encoding="utf-8"))
    assert document["causes"] == [CAUSE]
    assert out.startswith("What: ")
    assert document["verdict"] in out
    best = document["candidates"][0]
    assert best["effect"] == CAUSE
    assert 0.009 < best["parameters"]["friction_moment"]["value"] < 0.011
    assert {c["effect"] for c in document["candidates"]} <= {CAUSE, "quadratic_damping", "none", "unknown"}
    for text in ("friction_moment", "± ", " N m", "Cnβ [1/rad]", "before", "after", "cannot show", "Where: "):
        assert text in out
    printed = out.splitlines()
    steps = printed[printed.index("What to do next:") + 1 :]
    assert [
        f"{number}. {step}" for number, step in enumerate(next_steps(Diagnosis.from_json_dict(document)), 1)
    ] == steps[:-1]
    assert len(steps) > 2  # and where the document is
    lines = [line.split() for line in printed]
    assert any(words[:1] == [CAUSE] for words in lines)
    for run in document["gap"]["runs"]:
        assert any(words[:1] == [run["id"]] for words in lines)
    after = document["coefficients"]["after"]
    assert abs(after["cn_beta"]["value"] - 0.5) < abs(
        document["coefficients"]["before"]["cn_beta"]["value"] - 0.5
    )


def test_no_gap_is_an_answer_and_no_failure(tunnel: Tunnel, gap_free: Path, tmp_path: Path) -> None:
    words = ("--effects", "sensor_drift", "--json", tmp_path / "answer.json")
    status, out, err = tunnel("diagnose", gap_free, *words)
    assert status == 0
    assert all(PROGRESS.match(line) for line in err.splitlines())
    document = json.loads((tmp_path / "answer.json").read_text(encoding="utf-8"))
    assert document["causes"] == []
    assert document["candidates"][0]["effect"] == "none"
    assert out.startswith("What: No gap")
    assert "Gap (× noise variance)" not in out


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["--effects", "coulomb_fricton"], "did you mean 'coulomb_friction'?"),
        (["--exclude", "mains_hmu"], "did you mean 'mains_hum'?"),
        (["--effects", "mains_hum", "--exclude", "mains_hum"], "no effect is left"),
        (["--exclude", ",".join(kind.name for kind in ALL_EFFECTS)], "no effect is left"),
        (["--json", "nowhere/answer.json"], "its folder does not exist"),
        (["--report", "."], "is a folder"),
    ],
)
def test_bad_options_are_one_line(tunnel: Tunnel, gap_free: Path, words: list[str], part: str) -> None:
    status, out, err = tunnel("diagnose", gap_free, *words)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert part in err


def test_a_folder_without_a_campaign_is_one_line(tunnel: Tunnel, tmp_path: Path) -> None:
    status, out, err = tunnel("diagnose", tmp_path)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert "campaign.toml" in err


def test_one_run_says_what_it_cannot_show(tunnel: Tunnel, tmp_path: Path) -> None:
    data = campaign([Setting(16.12, 0.0)], duration=5.0, rate=500.0, noise=5e-4, rng=np.random.default_rng(2))
    status, out, _ = tunnel("diagnose", write_campaign(data, tmp_path / "one"), "--effects", "sensor_drift")
    assert status == 0
    for text in ("There is one run only", "there is one spring only", "there is no run with the wind on"):
        assert text in out


def test_runs_without_a_stiffness_are_said_to_share_a_spring(
    tunnel: Tunnel, normalised_campaign: Path
) -> None:
    status, out, _ = tunnel("diagnose", normalised_campaign, "--effects", "sensor_drift")
    assert status == 0
    assert "all runs are assumed to have the same spring" in out
    assert "ωn [rad/s]" in out


def test_noise_far_above_the_stated_is_said(tunnel: Tunnel, tmp_path: Path) -> None:
    settings = [Setting(16.12, 0.0), Setting(16.12, 15.0)]
    rng = np.random.default_rng(4)
    data = campaign(settings, duration=5.0, rate=500.0, noise=0.01, stated_noise=0.0005, rng=rng)
    status, out, _ = tunnel("diagnose", write_campaign(data, tmp_path / "noisy"), "--effects", "sensor_drift")
    assert status == 0
    assert "times the level that noise_std and resolution state" in out


@pytest.mark.parametrize("stated", [0.0, None])
def test_records_without_noise_are_said_to_test_the_numerics(
    tunnel: Tunnel, tmp_path: Path, stated: float | None
) -> None:
    data = campaign([Setting(16.12, 0.0)], duration=5.0, rate=500.0, stated_noise=stated)
    folder = write_campaign(data, tmp_path / "pure")
    status, out, _ = tunnel("diagnose", folder, "--effects", "sensor_drift")
    assert status == 0
    assert "almost no noise" in out


@pytest.mark.usefixtures("undrawn")
def test_the_files_are_hashed(tunnel: Tunnel, gap_free: Path, tmp_path: Path) -> None:
    author, page = "A. Smith", tmp_path / "report.html"
    words = ("--effects", "sensor_drift", "--json", tmp_path / "a.json", "--report", page, "--author", author)
    assert tunnel("diagnose", gap_free, *words)[0] == 0
    text = (tmp_path / "a.json").read_text(encoding="utf-8")
    hashes = json.loads(text)["provenance"]["sha256"]
    files = [path for path in gap_free.rglob("*") if path.is_file()]
    assert hashes == {
        path.relative_to(gap_free).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in files
    }
    assert author not in text
    shown = page.read_text(encoding="utf-8")
    assert author in shown
    assert all(digest in shown for digest in hashes.values())


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_runs_are_left_out(tunnel: Tunnel, gap_free: Path, tmp_path: Path, command: str) -> None:
    options = ("--effects", CAUSE) if command == "diagnose" else ()
    file = tmp_path / "answer.json"
    words = ("--leave-out", "r02", "--leave-out", "r04", "--json", file)
    status, out, _ = tunnel(command, gap_free, *words, *options)
    assert status == 0
    assert "r02, r04: left out on request" in out
    (asked,) = [one for one in json.loads(file.read_text())["remarks"] if one["outcome"] == "left out"]
    assert asked["runs"] == ["r02", "r04"]
    file.unlink()
    ids = [word for number in range(1, 5) for word in ("--leave-out", f"r{number:02}")]
    for given, said in ((ids, "every run is left out"), (["--leave-out", "r9"], "there is no run 'r9'")):
        status, out, err = tunnel(command, gap_free, *given, "--json", file, *options)
        assert (status, out) == (2, "")
        assert said in err
        assert err.count("\n") == 1
        assert not file.exists()
