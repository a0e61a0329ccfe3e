"""A small sweep, and how to do it in this process."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.small_sweep import SMALL
from tunnel_lab.experiments.experiment import ONE_THREAD
from tunnel_lab.experiments.sweep import read_sweep
from tunnel_lab.experiments.sweep_cases import Sweep


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """The file of a sweep of 12 cases, a shard each."""
    path = tmp_path / "small.toml"
    path.write_text(SMALL, encoding="utf-8")
    return path


@pytest.fixture
def sweep(small: Path) -> Sweep:
    """The same, read."""
    return read_sweep(small)


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch):
    """Shards done one after the other in this process, the last first."""
    for name in ONE_THREAD:
        monkeypatch.setenv(name, "1")

    def workers(work, shards):
        for index in reversed(shards):
            yield index, work(index)

    return workers
