"""Commands that take long say how far they are; what NumPy warns of does not reach a user."""

from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from diagnosis.likelihood.normal_equations import by_run
from identification import identify
from identification.estimators import SUMMARIES
from tests.reference.free_decays import Setting, campaign
from tunnel_lab.commands import identify as command
from tunnel_sim import TunnelError
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.importing.condition_table import ConditionTable

ROOT = Path(__file__).parents[4]


@pytest.mark.parametrize("estimator", ["output_error", "hilbert", "conventional"])
def test_an_identification_reports_every_run(estimator: str) -> None:
    assert estimator in SUMMARIES
    settings = [Setting(spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 12.0)]
    data = campaign(settings, duration=6.0, rate=250.0, noise=5e-4, rng=np.random.default_rng(3))
    seen: list[tuple[int, int]] = []
    identify(data, estimator, progress=lambda done, total: seen.append((done, total)))
    assert seen == [(n, 4) for n in range(5)]


def test_the_command_shows_bars_of_reading_and_identifying(tiny_campaign, monkeypatch, tunnel) -> None:
    from tunnel_lab.terminal import progress

    shown, real = [], progress.bar
    monkeypatch.setattr(command, "bar", lambda what, *rest: shown.append(what) or real(what, *rest))
    monkeypatch.setattr(progress, "bar", lambda what, *rest: shown.append(what) or real(what, *rest))
    status, _, err = tunnel("identify", tiny_campaign)
    assert (status, err, shown) == (0, "", ["reading runs", "identifying runs"])


def test_a_run_that_grows_without_bound_raises_no_warning() -> None:
    huge = np.full((20, 2), 1e200)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        by_run([(huge, huge + np.eye(20, 2))], [np.full(20, 1e200)])


def test_a_warning_of_numpy_does_not_reach_standard_error(tiny_campaign: Path) -> None:
    script = (
        "import sys, numpy, identification; real = identification.identify\n"
        "def noisy(*a, **k): numpy.float64(1e308) * numpy.float64(10.0); return real(*a, **k)\n"
        "identification.identify = noisy\n"
        "from tunnel_lab.cli import main; sys.exit(main())"
    )
    words = [sys.executable, "-c", script, "identify", str(tiny_campaign)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_ids_that_look_the_same_are_the_same(tiny_campaign: Path, tmp_path: Path) -> None:
    import shutil

    shutil.copytree(tiny_campaign, tmp_path / "c")
    path = tmp_path / "c" / "campaign.toml"
    run = path.read_text("utf-8").split("[[runs]]")
    first = run[1].split('id = "')[1].split('"')[0]
    second = run[2].split('id = "')[1].split('"')[0]
    text = path.read_text("utf-8").replace(f'id = "{first}"', 'id = "caf\u00e9"', 1)
    path.write_text(text.replace(f'id = "{second}"', 'id = "cafe\u0301"', 1), "utf-8")
    with pytest.raises(TunnelError, match="is used twice, with its accents encoded differently"):
        read_campaign(tmp_path / "c")


def test_a_table_of_conditions_finds_a_file_whose_accents_are_taken_apart(tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text("file,wind_speed\ncaf\u00e9.csv,3.0\n", encoding="utf-8")
    table = ConditionTable(tmp_path / "runs.csv")
    assert table.of(Path("cafe\u0301.csv"), "r") == {"wind_speed": 3.0}
