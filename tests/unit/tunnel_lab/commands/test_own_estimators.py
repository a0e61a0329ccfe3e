"""An estimator of one's own, in a file of the current folder or registered, in every command that takes one."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from identification import estimators, identify, make_estimator, register_estimator
from identification.datasets import measured_campaign
from identification.estimators.matrix_pencil import MatrixPencil
from tests.support.driven_runs import driven
from tests.support.small_sweep import SMALL
from tunnel_lab.experiments import runner
from tunnel_lab.experiments.experiment import run_in
from tunnel_lab.experiments.runner import processes
from tunnel_lab.experiments.score import score_grid
from tunnel_lab.experiments.score_grid import load_grid
from tunnel_lab.experiments.sweep import read_sweep, sweep_of
from tunnel_sim import TunnelError

MODULE = '''
from dataclasses import replace

from identification.estimators.matrix_pencil import MatrixPencil


class Mine:
    """The matrix pencil under another name."""

    name = "mine"

    def estimate(self, campaign):
        return replace(MatrixPencil().estimate(campaign), estimator=self.name)


class Broken:
    name = "broken"

    def estimate(self, campaign):
        return one_of(campaign.runs)


def one_of(runs):
    return runs["first"]


class Loud:
    name = "loud"

    def __init__(self, volume):
        self.volume = volume

    def estimate(self, campaign):
        raise NotImplementedError


class Leaves:
    name = "leaves"

    def estimate(self, campaign):
        raise SystemExit(3)


class NotANumber(Mine):
    name = "not_a_number"

    def estimate(self, campaign):
        found = super().estimate(campaign)
        runs = [replace(run, zeta=replace(run.zeta, value=float("nan"))) for run in found.runs]
        return replace(found, runs=tuple(runs))


class Bare(Mine):
    name = "bare"

    def estimate(self, campaign):
        found = super().estimate(campaign)
        return replace(found, runs=tuple(replace(run, zeta=None) for run in found.runs))


class Dies:
    name = "dies"

    def estimate(self, campaign):
        import os

        os._exit(9)
'''
GRID = """
schema_version = 1
name = "quick"
seed = 4
trials = 4
[[decays]]
zeta = [0.01]
frequency = [3.0]
noise = [0.005]
duration = [3.0]
sample_rate = 200.0
"""
ONE_CASE = SMALL.partition('[[effects]]\nname = "coulomb_friction"')[0].replace(
    "replicates = 2", "replicates = 1"
).replace("[0.0002, 0.002]", "0.002")  # fmt: skip
RAISED = 'own_method.py", line 24, in one_of\n    return runs["first"]'


@pytest.fixture(autouse=True)
def _forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a test registers and imports is unknown to the next."""
    monkeypatch.setattr(estimators, "_registered", {})
    monkeypatch.setattr(sys, "path", sys.path[:])
    monkeypatch.delitem(sys.modules, "own_method", raising=False)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with a module, a grid and a sweep."""
    (tmp_path / "own_method.py").write_text(MODULE, encoding="utf-8")
    (tmp_path / "grid.toml").write_text(GRID, encoding="utf-8")
    (tmp_path / "small.toml").write_text(ONE_CASE, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def in_a_process(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    start = "import sys; from tunnel_lab.cli import main; sys.exit(main())"
    guarded = cwd / "start.py"  # worker processes import it again
    guarded.write_text(f"if __name__ == '__main__':\n    {start}\n", encoding="utf-8")
    return subprocess.run(
        [sys.executable, str(guarded), *words], cwd=cwd, capture_output=True, text=True, check=False
    )


@pytest.mark.usefixtures("folder")
def test_identify_takes_it(tunnel, tiny_campaign: Path) -> None:
    for words in (("-e", "own_method:Mine"), ("--budget", "--model", "own_method:Mine")):
        status, out, err = tunnel("identify", tiny_campaign, *words)
        assert (status, err.count("Traceback")) == (0, 0)
        assert "mine" in out


@pytest.mark.usefixtures("folder")
def test_identify_shows_the_line_that_raised(tunnel, tiny_campaign: Path) -> None:
    status, out, err = tunnel("identify", tiny_campaign, "-e", "own_method:Broken")
    assert (status, out) == (1, "")
    assert RAISED in err
    assert "tunnel: broken raised an exception: TypeError: tuple indices" in err
    assert "own_method.py line 24; identification.check_estimator" in err


@pytest.mark.usefixtures("folder")
def test_score_takes_it_into_its_processes(tunnel) -> None:
    status, out, err = tunnel("score", "grid.toml", "--jobs", "1", "-e", "own_method:Mine,own_method:Broken")
    assert status == 0
    assert " mine " in out
    assert "broken raised an exception 4 times; counted as failures. The first:" in err
    assert err.count("Traceback") == 1
    assert RAISED in err


@pytest.mark.usefixtures("folder")
def test_one_that_leaves_the_program_ends_identify_with_one(tunnel, tiny_campaign: Path) -> None:
    status, out, err = tunnel("identify", tiny_campaign, "-e", "own_method:Leaves")
    assert (status, out) == (1, "")
    assert "tunnel: leaves raised an exception: SystemExit: 3, own_method.py line" in err


def test_a_module_that_leaves_the_program_is_one_line(tunnel, folder: Path, tiny_campaign: Path) -> None:
    (folder / "own_method.py").write_text('raise SystemExit("bye")\n', encoding="utf-8")
    status, out, err = tunnel("identify", tiny_campaign, "-e", "own_method:Mine")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "own_method:Mine: cannot be loaded (SystemExit: bye, own_method.py line 1)" in err


@pytest.mark.usefixtures("folder")
def test_any_code_that_leaves_the_program_is_said(tunnel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever code of one's own is called, its exit is not taken for success."""

    def leaves() -> None:
        raise SystemExit(0)

    monkeypatch.setattr("tunnel_lab.experiments.score_grid.packaged_grid", leaves)
    status, out, err = tunnel("score", "-e", "hilbert")
    assert (status, out) == (1, "")
    assert err.startswith("tunnel: the command was ended by its own code (SystemExit: 0, test_own_est")


@pytest.mark.usefixtures("folder")
def test_what_a_class_does_not_give_is_not_a_failure(tunnel) -> None:
    """The class gives ωn and no ζ, and says that nothing failed."""
    score = ("score", "--jobs", "0", "grid.toml", "-e", "own_method:Bare,own_method:Mine")
    status, out, err = tunnel(*score)
    assert (status, err) == (0, "")
    given = {
        (words[0], word) for words in map(str.split, out.splitlines()) for word in words if word in "ζωn"
    }
    assert given >= {("bare", "ωn"), ("mine", "ωn"), ("mine", "ζ")}
    assert ("bare", "ζ") not in given
    assert "Not given by bare: ζ.\n" in out
    status, out, err = tunnel(*score[:-1], "own_method:Leaves")
    assert status == 0
    assert "leaves raised an exception 4 times; counted as failures. The first:" in err
    assert "Not given" not in out
    assert out.count(" 4/4") == 2


def test_a_sweep_and_a_score_leave_out_the_same(tunnel, folder: Path) -> None:
    sys.path.insert(0, str(folder))
    names = [estimators.register_from(f"own_method:{kind}") for kind in ("Bare", "Mine")]
    run_in(sweep_of(read_sweep(folder / "small.toml", names)), folder / "out", processes(0))
    status, out, err = tunnel("sweep", "--summary", "out")
    assert (status, err) == (0, "")
    assert "Not given by bare: ζ, zero.\n" in out
    assert "Not given by mine: zero.\n" in out


@pytest.mark.usefixtures("folder")
def test_an_exception_fails_the_check(tunnel) -> None:
    here = ("--jobs", "0", "grid.toml")
    assert tunnel("score", *here, "-e", "own_method:Mine", "--write-baseline", "base.parquet")[0] == 0
    status, _, err = tunnel("score", "--jobs", "0", "--check", "base.parquet")
    assert (status, err.count("\n")) == (2, 1)
    assert "the baseline has mine, which no installed package adds; name your own class again with -e" in err
    status, out, err = tunnel("score", "--jobs", "0", "--check", "base.parquet", "-e", "own_method:Mine")
    assert (status, err) == (0, "")
    assert "to the last bit" in out
    both = ("-e", "own_method:Mine", "-e", "own_method:Broken")
    status, out, err = tunnel("score", "--jobs", "0", "--check", "base.parquet", *both)
    assert status == 1
    assert RAISED in err


@pytest.mark.usefixtures("folder")
def test_a_wrong_return_is_one_line_in_every_command(tunnel, tiny_campaign: Path) -> None:
    said = r"estimator not_a_number: zeta of run \S+ with campaign .* is nan ± .*; give None and a status"
    status, out, err = tunnel("identify", tiny_campaign, "-e", "own_method:NotANumber")
    assert (status, out, err.count("\n")) == (1, "", 1)
    assert re.match(f"tunnel: {said}", err)
    status, out, err = tunnel("score", "grid.toml", "--jobs", "0", "-e", "own_method:NotANumber")
    assert status == 0
    assert "not_a_number returned no valid estimate 4 times; counted as failures. The first:\n" in err
    assert re.search(said, err)
    assert "Traceback" not in err


def test_a_wrong_return_fails_a_sweep(folder: Path) -> None:
    sys.path.insert(0, str(folder))
    names = [estimators.register_from(f"own_method:{kind}") for kind in ("NotANumber", "Mine")]
    store, outcome = run_in(sweep_of(read_sweep(folder / "small.toml", names)), folder / "out", processes(0))
    (failed,) = outcome.failed
    assert (failed.status, failed.of_the_estimator) == ("wrong_return", True)
    rows = store.scan().collect().filter(estimator="not_a_number")
    assert (set(rows["status"]), failed.count) == ({"wrong_return"}, rows["case"].n_unique())
    assert "is nan ±" in rows["message"][0]


@pytest.mark.usefixtures("folder")
def test_a_process_that_dies_is_one_line(tunnel, monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that an estimator ends is not a traceback, and its work is tried again."""
    monkeypatch.setattr(runner, "PATIENCE", 2)  # of the three times
    status, out, err = tunnel("score", "grid.toml", "--jobs", "1", "-e", "own_method:Dies")
    lost, last = err.splitlines()
    assert (status, out) == (2, "")
    assert lost == "tunnel: a worker process was lost; its tasks are repeated"
    assert last.startswith(
        "tunnel: worker processes died 2 times without finishing a task; give fewer --jobs"
    )


@pytest.mark.slow
def test_sweep_takes_it_into_its_processes(folder: Path) -> None:
    words = ("sweep", "small.toml", "--out", "out", "--jobs", "1", "-e", "own_method:Mine")
    done = in_a_process(*words, cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")
    rows = pl.read_parquet(folder / "out" / "results" / "*.parquet")
    assert set(rows["estimator"]) == {"conventional", "mine"}
    mine = rows.filter((pl.col("estimator") == "mine") & (pl.col("quantity") == "zeta"))
    assert mine["value"].null_count() == 0
    assert set(mine["status"]) == {"ok"}
    (folder / "own_method.py").write_text(MODULE + "\nMORE = 1\n", encoding="utf-8")
    again = in_a_process(*words, cwd=folder)
    assert again.returncode == 2
    assert "the file of estimator mine has changed since the sweep was begun; name another" in again.stderr


def test_a_sweep_file_may_name_a_registered_one(folder: Path) -> None:
    file = folder / "small.toml"
    file.write_text(SMALL.replace('["conventional"]', '["mine"]'), encoding="utf-8")
    with pytest.raises(TunnelError, match="unknown estimator 'mine'"):
        read_sweep(file)
    sys.path.insert(0, str(folder))
    assert estimators.register_from("own_method:Mine") == "mine"
    assert read_sweep(file).document.estimators == ["mine"]


def test_a_registered_class_is_known_by_its_name() -> None:
    @register_estimator
    class Late:
        """One that came late."""

        name = "late"

        def estimate(self, campaign: Any) -> Any:
            return MatrixPencil().estimate(campaign)

    assert "late" in estimators.known_estimators()
    assert identify(measured_campaign("rotary-pendulum"), "late").runs[0].omega_n is not None
    assert isinstance(make_estimator("late"), Late)
    assert estimators.summary_of("late") == "One that came late"


def test_a_class_that_no_process_can_import_is_said(folder: Path) -> None:
    register_estimator(type("Local", (MatrixPencil,), {"name": "local"}))
    with pytest.raises(TunnelError, match=r"estimator local: other processes cannot import.*use 0 processes"):
        score_grid(load_grid(folder / "grid.toml"), ["local"], processes(1))
    results, _ = score_grid(load_grid(folder / "grid.toml"), ["local"], processes(0))
    assert results.table["value"].null_count() == 0


def test_a_driven_run_goes_to_a_class_that_takes_it() -> None:
    class Plain:
        name = "plain"

        def estimate(self, campaign: Any) -> Any:
            from dataclasses import replace

            from identification.estimators.output_error import OutputError

            return replace(OutputError().estimate(campaign), estimator=self.name)

    class Driven(Plain):
        name = "driven"
        takes_driven = True

    given = driven("moment, then released")
    with pytest.raises(TunnelError, match=r"plain takes free decays only; .* states takes_driven = True"):
        identify(given, Plain())
    assert identify(given, Driven()).runs[0].omega_n is not None
    register_estimator(Driven)
    assert "driven" in estimators.estimators_of_driven_runs()


BAD_WORDS = (
    ("own_method:Nine", "own_method:Nine: cannot be loaded (AttributeError: module 'own_method' has no"),
    (
        "gone_module:Mine",
        "gone_module:Mine: cannot be loaded (ModuleNotFoundError: No module",
    ),
    (
        "own_method.py:Mine",
        "own_method.py:Mine: names a file, not a module; leave out .py: own_method:Mine",
    ),
    ("own_method:", "own_method:: names no class; give it as module:Class"),
    (":Mine", ":Mine: names no module; give it as module:Class"),
    ("own_method:one_of", "is not a class of an estimator; state a name and a method estimate"),
    ("own_method:Loud", "estimator loud: cannot be made without arguments (TypeError"),
    ("min", "there is no estimator 'min'; use one of"),
    ("hilbrt", "did you mean 'hilbert', or give module:Class of your own"),
)


@pytest.mark.parametrize(
    ("command", "word", "said"),
    [*(("identify", *one) for one in BAD_WORDS), *((other, *BAD_WORDS[-1]) for other in ("score", "sweep"))],
)
def test_a_bad_word_is_one_line(
    tunnel, folder: Path, tiny_campaign: Path, command: str, word: str, said: str
) -> None:
    before = {"identify": [tiny_campaign], "score": [], "sweep": ["small.toml", "--out", "out"]}[command]
    status, out, err = tunnel(command, *before, "-e", word)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert said in err
    assert not (folder / "out").exists()


def test_the_name_of_a_packaged_one_is_refused() -> None:
    with pytest.raises(TunnelError, match="estimator hilbert: is the name of a packaged estimator"):
        register_estimator(type("Mine", (MatrixPencil,), {"name": "hilbert"}))
