"""The page's sweep file is read, its code runs on a sweep of that file made small, and its commands exist."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from tunnel_lab.experiments.experiment import run_in
from tunnel_lab.experiments.sweep import read_sweep, sweep_of
from tunnel_lab.experiments.sweep_work import RESULT_COLUMNS

PAGE = Path(__file__).parents[4] / "docs" / "how-to" / "sweep.md"
TEXT = PAGE.read_text(encoding="utf-8")


def blocks(kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)


def test_the_file_is_read_and_the_code_runs(here, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (text,) = blocks("toml")
    (tmp_path / "sweep.toml").write_text(text, encoding="utf-8")
    whole = read_sweep(tmp_path / "sweep.toml")
    assert whole.size == 2 * 3 * 2 * 4 * 10
    small = text.replace("replicates = 10", "replicates = 1").replace("duration = 10.0", "duration = 2.0")
    small = small.replace("[0.0002, 0.0005, 0.002]", "0.0005").replace("[0.35, 0.495]", "0.35")
    small = small.replace("[0.0, 0.003]", "0.003")
    small = small.replace('["output_error", "conventional"]', '["conventional"]')
    small = small.replace("records = false", "records = true").replace(
        "coefficient = 0.002", "coefficient = [0.002, 0.003, 0.004, 0.005, 0.006]"
    )
    (tmp_path / "sweep.toml").write_text(small, encoding="utf-8")
    store, _ = run_in(sweep_of(read_sweep(tmp_path / "sweep.toml")), tmp_path / "results", here)
    monkeypatch.chdir(tmp_path)
    found: dict[str, object] = {}
    for code in blocks("python"):
        exec(code, found)
    assert len(found["worst"]) == 7
    kept = store.scan("records").filter(pl.col("case") == 7).collect()
    for run, yaw in zip(found["campaign"].runs, kept["yaw_rad"], strict=True):
        assert np.array_equal(run.record.yaw_rad, yaw.to_numpy())


def test_every_column_is_on_the_page() -> None:
    assert [name for name in RESULT_COLUMNS if f"`{name}`" not in TEXT] == []
