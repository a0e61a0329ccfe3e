"""No estimator is worse than when its baseline was stored, beyond sampling error; a spoilt one is caught.

Truth: the forward integrator. Who changes an estimator on purpose writes the baseline anew, see score-grid.toml;
``tunnel score --check packaged`` is the same on the full grid.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from identification.estimators import ALL_ESTIMATORS
from tunnel_lab.experiments.runner import processes
from tunnel_lab.experiments.score import packaged_baseline, read_trials, score_grid
from tunnel_lab.experiments.score_grid import load_grid
from tunnel_lab.experiments.score_view import check

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def baseline():
    return read_trials(HERE / "score-baseline.parquet")


@pytest.fixture(scope="module")
def now(baseline):
    return score_grid(baseline.grid, baseline.estimators, processes(0))[0]


def test_the_baselines_are_of_the_same_estimators_and_of_their_grids(baseline):
    """An estimator that is not scored yet stands in neither."""
    assert set(baseline.estimators) == set(packaged_baseline().estimators) <= set(ALL_ESTIMATORS)
    assert len(baseline.estimators) >= 8
    assert baseline.grid == load_grid(HERE / "score-grid.toml")


@pytest.mark.slow
def test_no_estimator_got_worse(baseline, now):
    verdict = check(baseline, now)
    assert verdict.worse == ()


@pytest.mark.slow
def test_an_estimator_that_is_spoilt_is_caught(baseline, now):
    """Its ζ gets noise of eight of its own standard deviations."""
    for name in baseline.estimators:
        rng = np.random.default_rng(2)
        mine = now.table.filter(pl.col("estimator") == name)
        assert check(baseline, replace(now, estimators=(name,), table=mine)).passed, name
        noise = 8.0 * pl.col("std") * pl.Series(rng.standard_normal(mine.height))
        zeta = pl.when(pl.col("quantity") == "zeta").then(noise).otherwise(0.0)
        spoilt = replace(now, estimators=(name,), table=mine.with_columns(pl.col("value") + zeta))
        assert {finding.quantity for finding in check(baseline, spoilt).worse} == {"zeta"}, name
