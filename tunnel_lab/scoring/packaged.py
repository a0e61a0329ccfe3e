"""Packaged scores of the estimators of this version: a baseline and a breakdown."""

from __future__ import annotations

from importlib import resources
from typing import TYPE_CHECKING

from tunnel_lab.scoring.results import Results, read_trials

if TYPE_CHECKING:
    import polars as pl


def packaged_baseline() -> Results:
    """The trials of all estimators on the packaged grid, which ``tunnel score --check packaged`` compares with."""
    with resources.as_file(resources.files("tunnel_lab") / "data" / "score-baseline.parquet") as path:
        return read_trials(path)


def packaged_breakdown() -> pl.DataFrame:
    """Results of ``tunnel score --breakdown``; columns as in its Parquet file."""
    import polars as pl

    with resources.as_file(resources.files("tunnel_lab") / "data" / "score-breakdown.parquet") as path:
        return pl.read_parquet(path)
