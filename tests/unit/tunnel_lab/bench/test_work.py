"""Commands in processes of their own. Truth: the files that they write, and the processes of the machine."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tunnel_lab.bench import work
from tunnel_sim.vocabulary.errors import TunnelError

PLAN = 'name = "long"\nseed = 1\nsprings = [5]\nwind_speeds = [0.0]\nrelease_angles_deg = [20.0]\nduration = 9e4\n'


@pytest.fixture
def log(tmp_path: Path) -> Iterator[Path]:
    yield tmp_path / "work.log"
    work.stop(tmp_path / "work.log")


def wait(log: Path, ready: Callable[[work.Work], bool], seconds: float = 60.0) -> work.Work:
    end = time.monotonic() + seconds
    while not ready(found := work.work_of(log)):
        assert time.monotonic() < end, found
        time.sleep(0.05)
    return found


def test_there_is_no_work_without_a_log(tmp_path: Path) -> None:
    assert work.work_of(tmp_path / "none.log") == work.Work()
    (tmp_path / "odd.log").write_text("something else\n")
    assert work.work_of(tmp_path / "odd.log") == work.Work()


def test_a_command_prints_into_its_log_and_ends_with_its_status(log: Path) -> None:
    work.start(["springs"], log)
    found = wait(log, lambda one: not one.running)
    assert (found.command, found.status, found.error) == ("tunnel springs", 0, "")
    assert any("Izz" in line for line in found.lines)
    work.start(["identify", "nowhere"], log)
    found = wait(log, lambda one: not one.running)
    assert found.status == 2
    assert found.error.startswith("nowhere: no such folder")


@pytest.mark.slow
def test_a_command_is_paused_goes_on_and_is_stopped_and_leaves_nothing(log: Path, tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(f"{PLAN}truth.cn_beta = 0.4\ntruth.cn_r = -0.1\n")
    work.start(["simulate", str(tmp_path / "plan.toml"), "--out", str(tmp_path / "out")], log)
    process = wait(log, lambda one: one.running).process
    with pytest.raises(TunnelError, match="is running already"):
        work.start(["springs"], log)
    work.pause(log)
    time.sleep(0.2)
    assert work.work_of(log).paused
    spent = sum(os.times()[:2]), Path(f"/proc/{process}/stat").read_text().split()[13]
    time.sleep(1.0)
    assert Path(f"/proc/{process}/stat").read_text().split()[13] == spent[1]
    work.go_on(log)
    assert not work.work_of(log).paused
    child = work._started.pop(log)  # as a server that was started anew after a crash
    work.stop(log)
    child.wait()
    found = wait(log, lambda one: not one.running)
    assert found.status in (130, None)
    assert found.error
    assert sorted(path.name for path in tmp_path.iterdir()) == ["plan.toml", "work.log"]
