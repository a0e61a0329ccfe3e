"""A sweep on disk: killed, interrupted, resumed, refused. The shards themselves are done in this process where that
is not the point."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import polars as pl
import pytest

from tests.support.killed import names_of_the_dead
from tests.support.small_sweep import SMALL, contents, open_store
from tunnel_lab.experiments import experiment as engine
from tunnel_lab.experiments import sweep_work
from tunnel_lab.experiments.experiment import begin, run_in
from tunnel_lab.experiments.runner import processes
from tunnel_lab.experiments.sweep import read_sweep, sweep_of
from tunnel_lab.experiments.sweep_cases import Sweep
from tunnel_sim.vocabulary.errors import TunnelError

ROOT = Path(__file__).parents[4]
PATIENCE_S = 120.0


def started(file: Path, out: Path) -> subprocess.Popen[str]:
    """``tunnel sweep`` on two processes, once its first shard is finished."""
    words = [sys.executable, "-m", "tunnel_lab.cli", "sweep", str(file), "--out", str(out), "--jobs", "2"]
    process = subprocess.Popen(
        words, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, process_group=0
    )
    until = time.monotonic() + PATIENCE_S
    while not list(out.glob("results/part-*")):
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < until
        time.sleep(0.005)
    return process


def running(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def test_killed_and_resumed_is_the_same_to_the_bit(small: Path, sweep: Sweep, here, tmp_path: Path) -> None:
    """Against a sweep that nobody disturbed, in one process and in another order."""
    run_in(sweep_of(sweep), tmp_path / "whole", here)
    process = started(small, tmp_path / "killed")
    process.kill()
    process.communicate()
    finished = {path: path.stat().st_mtime_ns for path in (tmp_path / "killed").glob("results/part-*")}
    assert 0 < len(finished) < sweep.shards, "killed too late to say anything"
    _, outcome = run_in(sweep_of(sweep), tmp_path / "killed", here)
    assert outcome.finished_before == len(finished)
    assert {path: path.stat().st_mtime_ns for path in finished} == finished  # nothing was done twice
    assert contents(tmp_path / "killed") == contents(tmp_path / "whole")
    cases = open_store(tmp_path / "killed").scan().select("case").collect()["case"]
    assert cases.is_sorted()
    assert cases.unique().to_list() == list(range(12))
    until = time.monotonic() + PATIENCE_S
    while running(process.pid) and time.monotonic() < until:
        time.sleep(0.01)
    assert not running(process.pid)  # its workers ended with it


@pytest.mark.slow
def test_ctrl_c_keeps_what_is_finished(small: Path, tmp_path: Path) -> None:
    process = started(small, tmp_path / "out")
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers, too
    _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert said.count("\n") == 1
    assert "interrupted" in said
    assert open_store(tmp_path / "out").finished()


@pytest.mark.slow
def test_a_lost_process_costs_nothing(sweep: Sweep, here, tmp_path: Path) -> None:
    run_in(sweep_of(sweep), tmp_path / "whole", here)
    said: list[str] = []
    killed: list[int] = []

    def kill_one(done: int, total: int) -> None:
        del total
        if done and not killed:
            mine = [p.name for p in Path("/proc").iterdir() if p.name.isdecimal() and _is_worker(p)]
            killed.append(int(mine[0]))
            os.kill(killed[0], signal.SIGKILL)

    run_in(sweep_of(sweep), tmp_path / "out", processes(2, said.append), kill_one)
    assert said == ["a worker process was lost; its tasks are repeated"]
    assert contents(tmp_path / "out") == contents(tmp_path / "whole")


def _is_worker(process: Path) -> bool:
    """Whether it is a worker that this process started."""
    try:
        parent = (process / "stat").read_text().rpartition(")")[2].split()[1]
        return parent == str(os.getpid()) and b"spawn_main" in (process / "cmdline").read_bytes()
    except OSError:
        return False


@pytest.mark.parametrize("step", range(5))
def test_stopped_or_out_of_disk_at_the_beginning_it_continues(
    step: int, sweep: Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = [step]

    def failing(write):
        def tried(*given):
            left[0] -= 1
            if left[0] < 0:
                raise TunnelError("cannot be written (no space left on device)")
            return write(*given)

        return tried

    with monkeypatch.context() as patch:
        for name in ("output_folder", "write_json"):
            patch.setattr(engine, name, failing(getattr(engine, name)))
        with pytest.raises(TunnelError, match="no space left"):
            begin(sweep_of(sweep), tmp_path / "out")
    store = begin(sweep_of(sweep), tmp_path / "out")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(
        ["sweep.json", "results", "records", "checksums"]
    )
    assert store.finished() == set()


def test_half_a_part_is_done_again(sweep: Sweep, here, tmp_path: Path) -> None:
    store, _ = run_in(sweep_of(sweep), tmp_path / "out", here)
    whole = contents(tmp_path / "out")
    part = tmp_path / "out" / "results" / "part-00004.parquet"
    part.write_bytes(part.read_bytes()[:-100])  # a disk that was full, or lost its power
    names_of_the_dead(part.with_name("part-00005.parquet"))[0].write_bytes(b"PAR1")
    assert "part-00004" not in store.finished()
    assert run_in(sweep_of(sweep), tmp_path / "out", here)[1].finished_before == 11
    assert contents(tmp_path / "out") == whole


def test_a_changed_file_is_refused_and_a_comment_is_no_change(sweep: Sweep, here, tmp_path: Path) -> None:
    run_in(sweep_of(sweep), tmp_path / "out", here)
    before = contents(tmp_path / "out")
    for text, said in (
        (SMALL.replace("seed = 1", "seed = 2"), "another sweep, whose seed differs"),
        (SMALL.replace("0.02]", "0.03]"), "another sweep, whose effects differs"),
    ):
        (tmp_path / "changed.toml").write_text(text, encoding="utf-8")
        with pytest.raises(TunnelError, match=said):
            run_in(sweep_of(read_sweep(tmp_path / "changed.toml")), tmp_path / "out", here)
    (tmp_path / "same.toml").write_text("# a comment\n" + SMALL.replace("0.0002", "2e-4"), encoding="utf-8")
    assert (
        run_in(sweep_of(read_sweep(tmp_path / "same.toml")), tmp_path / "out", here)[1].finished_before == 12
    )
    assert contents(tmp_path / "out") == before


def test_other_versions_are_refused(
    sweep: Sweep, here, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(engine, "versions", lambda: {"numpy": "1.0"})
        run_in(sweep_of(sweep), tmp_path / "old", lambda *_: (one for one in ()))
    with pytest.raises(TunnelError, match=r"begun with numpy 1\.0"):
        run_in(sweep_of(sweep), tmp_path / "old", here)
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    with pytest.raises(TunnelError, match="a worker has threads 4, but this sweep uses 1"):
        run_in(sweep_of(sweep), tmp_path / "new", here)
    assert open_store(tmp_path / "new").finished() == set()


def test_a_case_that_cannot_be_simulated_takes_no_other_with_it(tmp_path: Path, here) -> None:
    """At 60 m/s the air's moment is stronger than this spring: the motion grows without bound."""
    text = (
        SMALL.partition("[[effects]]")[0]
        .replace("[0.0, 15.0]", "[0.0, 60.0]")
        .replace("= 0.495", "= [0.1, 5.0]")
    )
    text = text.replace("replicates = 2", "replicates = 1").replace("per_shard = 1", "per_shard = 24")
    (tmp_path / "wild.toml").write_text(text, encoding="utf-8")
    rows = run_in(sweep_of(read_sweep(tmp_path / "wild.toml")), tmp_path / "out", here)[0].scan().collect()
    failed = rows.filter(pl.col("status") == "not_simulated")
    assert set(failed["cn_beta"]) == {5.0}
    assert failed["value"].null_count() == len(failed)
    assert "grows without bound" in failed["message"][0]
    assert rows.filter(cn_beta=0.1, quantity="omega_n")["value"].null_count() == 0


def test_an_estimator_that_crashes_is_a_status(
    sweep: Sweep, here, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Broken:
        name = "conventional"

        def estimate(self, _campaign):
            raise ZeroDivisionError("planted")

    monkeypatch.setattr(sweep_work, "_estimator", lambda _: Broken())
    store, outcome = run_in(sweep_of(sweep), tmp_path / "out", here)
    (failed,) = outcome.failed
    assert (failed.status, failed.count) == ("raised", 12)
    rows = store.scan().collect()
    assert set(rows["status"]) == {"raised"}
    (message,) = set(rows["message"])
    assert re.fullmatch(r"ZeroDivisionError: planted, test_experiment\.py line \d+", message)
    assert failed.first.startswith("Traceback (most recent call last):")
    assert failed.first.endswith("ZeroDivisionError: planted")


def damages(first: Path, second: Path) -> Iterator[None]:
    """A part damaged in its middle, swapped for another, and gone."""
    content = bytearray(first.read_bytes())
    content[len(content) // 2] ^= 1
    first.write_bytes(bytes(content))
    yield
    first.write_bytes(second.read_bytes())
    yield
    first.unlink()
    yield


@pytest.mark.slow
def test_a_part_damaged_anywhere_is_done_again(sweep: Sweep, here, tmp_path: Path) -> None:
    """Not only where its end is missing: a disk may lose a block in the middle."""
    store, _ = run_in(sweep_of(sweep), tmp_path / "out", here)
    whole = contents(tmp_path / "out")
    for dataset in ("results", "records", "checksums"):
        for _ in damages(*sorted((tmp_path / "out" / dataset).iterdir())[:2]):
            assert store.finished() == set(map(sweep_of(sweep).name, range(1, sweep.shards)))
            assert run_in(sweep_of(sweep), tmp_path / "out", here)[1].finished_before == sweep.shards - 1
            assert contents(tmp_path / "out") == whole


def test_checksums_are_those_of_sha256sum(sweep: Sweep, here, tmp_path: Path) -> None:
    run_in(sweep_of(sweep), tmp_path / "out", here)
    names = [f"checksums/{path.name}" for path in (tmp_path / "out" / "checksums").iterdir()]
    done = subprocess.run(
        ["sha256sum", "--check", *names], cwd=tmp_path / "out", capture_output=True, text=True, check=False
    )
    assert done.returncode == 0
    assert done.stdout.count("OK") == 2 * sweep.shards


@pytest.mark.parametrize("key", ["sweep", "made_with", "schema_version"])
@pytest.mark.parametrize(
    "value", [None, [], {}, 1, "x", "gone", {"document": {}}, {"document": {}, "rigs": [[]]}]
)
def test_a_sweep_json_that_is_incomplete_is_one_line(
    sweep: Sweep, tmp_path: Path, key: str, value: object
) -> None:
    begin(sweep_of(sweep), tmp_path / "out")
    path = tmp_path / "out" / "sweep.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    if value == "gone":
        del document[key]
    else:
        document[key] = value
    if (key, value) == ("schema_version", engine.SCHEMA_VERSION) or (
        key == "made_with" and isinstance(value, dict)
    ):
        return  # still what a folder may hold
    path.write_text(json.dumps(document), encoding="utf-8")
    for read in (open_store, lambda folder: begin(sweep_of(sweep), folder)):
        with pytest.raises(TunnelError, match=r"the sweep as JSON|sweep\.json"):
            read(tmp_path / "out")
