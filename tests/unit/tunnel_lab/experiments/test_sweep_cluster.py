"""The Dask cluster as on several machines: a scheduler and workers of their own, one of them killed for good."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.small_sweep import contents
from tunnel_lab.cli import main
from tunnel_lab.experiments.experiment import run_in
from tunnel_lab.experiments.runner import on_cluster
from tunnel_lab.experiments.sweep import sweep_of
from tunnel_lab.experiments.sweep_cases import Sweep

ROOT = Path(__file__).parents[4]
WORKERS = 3
pytestmark = pytest.mark.slow


def dask(*words: str) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "dask", *words]
    return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@pytest.fixture
def processes() -> Iterator[list[subprocess.Popen[bytes]]]:
    """What is started goes in here, and ends with the test."""
    started: list[subprocess.Popen[bytes]] = []
    yield started
    for process in started:
        process.kill()
        process.wait()


@pytest.fixture
def address(processes: list[subprocess.Popen[bytes]], tmp_path: Path) -> str:
    """A scheduler without workers."""
    file = tmp_path / "scheduler.json"
    processes.append(dask("scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)))
    until = time.monotonic() + 60.0
    while not file.exists() or not file.read_text():
        assert time.monotonic() < until
        time.sleep(0.05)
    return str(json.loads(file.read_text())["address"])


def worker(address: str) -> subprocess.Popen[bytes]:
    return dask("worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard")


def test_workers_missing_and_lost_are_survived(
    sweep: Sweep, here, tmp_path: Path, address: str, processes: list[subprocess.Popen[bytes]]
) -> None:
    run_in(sweep_of(sweep), tmp_path / "alone", here)
    said: list[str] = []
    killed: list[int] = []

    def say(line: str) -> None:
        said.append(line)
        if "no worker is connected" in line:
            processes.extend(worker(address) for _ in range(WORKERS))

    def kill_one(done: int, total: int) -> None:
        if 0 < done < total and not killed:
            processes[1].kill()
            killed.append(done)

    store, _ = run_in(
        sweep_of(sweep), tmp_path / "cluster", on_cluster(address, 1, say, poll_s=1.0), kill_one
    )
    assert said[0].startswith("no worker is connected to tcp://")
    assert killed
    assert killed[0] < sweep.size
    assert contents(tmp_path / "cluster") == contents(tmp_path / "alone")
    assert len(store.finished()) == sweep.shards


def test_a_scheduler_that_goes_away_is_one_line(
    small: Path, tmp_path: Path, address: str, processes: list[subprocess.Popen[bytes]], capsys
) -> None:
    from distributed import Future

    processes.append(worker(address))

    with pytest.MonkeyPatch.context() as patch:
        original = Future.result

        def result(future, *given, **named):
            processes[0].kill()
            return original(future, *given, **named)

        patch.setattr(Future, "result", result)
        status = main(["sweep", str(small), "--out", str(tmp_path / "out"), "--scheduler", address])
    said = capsys.readouterr().err.splitlines()
    assert status == 2
    assert said[-1].startswith("tunnel: the scheduler is gone; finished work is kept")


def test_a_local_cluster_gives_the_same(small: Path, sweep: Sweep, here, tmp_path: Path) -> None:
    run_in(sweep_of(sweep), tmp_path / "alone", here)
    command = [
        sys.executable,
        "-m",
        "tunnel_lab.cli",
        "sweep",
        str(small),
        "--scheduler",
        "local",
        "--jobs",
        "3",
    ]
    done = subprocess.run(
        [*command, "--out", str(tmp_path / "local")], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert contents(tmp_path / "local") == contents(tmp_path / "alone")
