"""``tunnel score``: what it prints, keeps and refuses; unchanged code passes, planted regressions do not."""

from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from identification.estimators.matrix_pencil import MatrixPencil
from identification.show.quantity import Quantity
from tests.support.command import Tunnel
from tunnel_lab.cli import main

GRID = """
schema_version = 1
name = "quick"
seed = 4
trials = 30
[[decays]]
zeta = [0.05]
frequency = [1.0, 3.0]
noise = [0.005]
duration = [5.0]
sample_rate = 200.0
"""
pytestmark = pytest.mark.usefixtures("unrendered")
HERE = ("--jobs", "0", "--estimator", "matrix_pencil")


@pytest.fixture
def grid(tmp_path: Path) -> Path:
    path = tmp_path / "grid.toml"
    path.write_text(GRID)
    return path


@pytest.fixture(scope="module")
def baseline(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("baseline")
    grid, path = folder / "grid.toml", folder / "base.parquet"
    grid.write_text(GRID)
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        assert main(["score", str(grid), *HERE, "--write-baseline", str(path)]) == 0
    assert err.getvalue() == ""
    assert f"Written: {path}" in out.getvalue()
    return path


def planted(monkeypatch: pytest.MonkeyPatch, change: Callable[..., Quantity | None]) -> None:
    """Have every run's ζ passed through ``change(quantity, rng)``."""
    rng = np.random.default_rng(1)
    real = MatrixPencil.estimate

    def estimate(self: MatrixPencil, campaign: object) -> object:
        found = real(self, campaign)  # type: ignore[arg-type]
        runs = tuple(replace(run, zeta=change(run.zeta, rng)) for run in found.runs)
        return replace(found, runs=runs)

    monkeypatch.setattr(MatrixPencil, "estimate", estimate)


def test_figures_come_with_their_sampling_errors_and_are_kept(
    tunnel: Tunnel, grid: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "scores"
    status, out, err = tunnel("score", grid, *HERE, "--trials", "3", "--out", folder, "--cells")
    assert (status, err) == (0, "")
    assert "Single decays (2 cells)" in out
    assert out.count("ζ 0.05, 3 Hz, S/A 0.5 %, 5 s") == 1
    written = {"trials.parquet", "scores.parquet", "score.png", "score.pdf", "index.html"}
    assert {path.name for path in folder.iterdir()} == written
    assert (folder / "score.png").read_bytes()[:4] == b"\x89PNG"
    frame = pl.read_parquet(folder / "scores.parquet")
    assert frame.height == 2 * 2
    assert (frame["rmse_over_bound_std_error"] > 0.0).all()
    status, _, err = tunnel("score", grid, *HERE, "--trials", "3", "--out", folder)
    assert status == 2
    assert "exists already" in err
    (folder / "score.png").unlink()
    (folder / "parts").mkdir()  # a full disk stopped it while it wrote the results
    assert tunnel("score", grid, *HERE, "--trials", "3", "--out", folder)[0] == 0
    assert {path.name for path in folder.iterdir()} == written
    for name in ("parts", "mine"):
        (folder / name).mkdir()
    assert tunnel("score", grid, *HERE, "--trials", "3", "--out", folder)[0] == 2


@pytest.mark.slow
def test_other_records_pass_within_sampling_error(tunnel: Tunnel, baseline: Path) -> None:
    status, out, _ = tunnel("score", "--check", baseline, *HERE, "--seed", "5")
    assert status == 0
    assert "beyond sampling error" in out


def noisier(size: float) -> Callable[..., Quantity | None]:
    """Noise of ``size`` standard deviations beside the estimate's own."""
    return lambda zeta, rng: replace(zeta, value=zeta.value + size * zeta.std * rng.standard_normal())


def biased(zeta: Quantity, _: object) -> Quantity:
    assert zeta.std is not None
    return replace(zeta, value=zeta.value + 0.8 * zeta.std)


def overconfident(zeta: Quantity, _: object) -> Quantity:
    assert zeta.std is not None
    return replace(zeta, std=0.5 * zeta.std)


@pytest.mark.parametrize(
    ("change", "seed"),
    [
        pytest.param(noisier(1.5), "4", id="noise, same records"),
        # Unpaired, 60 estimates find noise of 1.5 deviations in none of 12 sets of records, of 3 in all.
        pytest.param(noisier(3.0), "5", id="noise, other records", marks=pytest.mark.slow),
        *(
            pytest.param(change, seed, id=f"{change.__name__}, {records}", marks=pytest.mark.slow)
            for change in (biased, overconfident)
            for seed, records in (("4", "same records"), ("5", "other records"))
        ),
    ],
)
def test_a_planted_regression_exits_with_one(
    tunnel: Tunnel,
    baseline: Path,
    monkeypatch: pytest.MonkeyPatch,
    change: Callable[..., Quantity | None],
    seed: str,
) -> None:
    planted(monkeypatch, change)
    status, out, err = tunnel("score", "--check", baseline, *HERE, "--seed", seed)
    assert (status, err) == (1, "")
    assert "Worse than the baseline: matrix_pencil" in out


def test_a_new_estimator_is_said_to_be_unchecked(tunnel: Tunnel, baseline: Path) -> None:
    status, out, _ = tunnel("score", "--check", baseline, *HERE, "-e", "conventional", "--trials", "3")
    assert status == 0
    assert "not checked: conventional" in out


def test_a_baseline_of_other_cells_or_of_a_vanished_estimator_is_refused(
    tunnel: Tunnel, grid: Path, baseline: Path, tmp_path: Path
) -> None:
    other = tmp_path / "other.toml"
    other.write_text(GRID.replace("0.05", "0.02"))
    status, _, err = tunnel("score", other, "--check", baseline, *HERE, "--trials", "2")
    assert status == 2
    assert "is not in the grid" in err
    frame = pl.read_parquet(baseline).with_columns(pl.lit("gone_one").alias("estimator"))
    frame.write_parquet(tmp_path / "gone.parquet")
    status, _, err = tunnel("score", grid, "--check", tmp_path / "gone.parquet", "--jobs", "0")
    assert status == 2
    assert "gone_one, which no installed package adds" in err
