"""Which cases a sweep file stands for, and that their seeds depend on what they hold. Truth: counts by hand."""

from __future__ import annotations

from collections import Counter
from itertools import product
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import tomli_w

from tests.support.small_sweep import SMALL
from tunnel_lab.experiments import sweep_work
from tunnel_lab.experiments.estimate_rows import Failure
from tunnel_lab.experiments.sweep import read_sweep
from tunnel_lab.experiments.sweep_cases import Sweep
from tunnel_lab.experiments.sweep_view import lines_of
from tunnel_lab.experiments.sweep_work import NOT_SIMULATED, run_shard
from tunnel_sim.engine.virtual_campaign import simulate_campaign
from tunnel_sim.files.plan_file import load_plan
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.between_runs import Scatter


def variant(folder: Path, *changes: tuple[str, str]) -> Sweep:
    text = SMALL
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "variant.toml"
    path.write_text(text, encoding="utf-8")
    return read_sweep(path)


def seeds(sweep: Sweep) -> list[int]:
    return [sweep.case(index).plan.seed for index in range(sweep.size)]


def test_every_combination_once(sweep: Sweep) -> None:
    assert (sweep.size, sweep.runs, sweep.shards) == (12, 24, 12)
    found = Counter(
        (
            case.plan.sensor.noise_std,
            case.plan.effects[0].parameters["friction_moment"] if case.plan.effects else 0.0,
        )
        for case in map(sweep.case, range(sweep.size))
    )
    assert found == dict.fromkeys(product((0.0002, 0.002), (0.0, 0.002, 0.02)), 2)
    assert len(set(seeds(sweep))) == 12


def test_all_axes_multiply(tmp_path: Path) -> None:
    sweep = variant(
        tmp_path,
        ("cn_beta = 0.495", "cn_beta = [0.3, 0.4, 0.5]"),
        ("duration = 2.0", "duration = [2.0, 3.0]"),
        ("[conditions]", '[[rig]]\nname = "a"\n[[rig]]\nname = "b"\n'
         "changes = { dynamics = { yaw_inertia = 0.2 } }\n[conditions]"),
    )  # fmt: skip
    assert sweep.size == 2 * 2 * 2 * 3 * 3 * 2
    inertia = {case.rig_name: case.plan.truth.yaw_inertia for case in map(sweep.case, range(sweep.size))}
    assert inertia == {"a": load_rig().dynamics.yaw_inertia, "b": 0.2}


def test_shards_hold_every_case_once_in_order(tmp_path: Path) -> None:
    sweep = variant(tmp_path, ("cases_per_shard = 1", "cases_per_shard = 5"))
    assert sweep.shards == 3
    assert [case.index for index in range(3) for case in sweep.shard(index)] == list(range(12))


def test_a_shard_holds_a_few_seconds_of_work(tmp_path: Path) -> None:
    sweep = variant(tmp_path, ("cases_per_shard = 1\n", ""), ("duration = 2.0", "duration = 10.0"))
    assert sweep.cases_per_shard == 25  # of two runs of 10,000 steps: 500,000 steps


def test_seeds_hang_on_what_a_case_holds_not_on_its_place(sweep: Sweep, tmp_path: Path) -> None:
    wider = variant(tmp_path, ("noise_std = [0.0002, 0.002]", "noise_std = [0.001, 0.0002, 0.002]"))
    other = variant(tmp_path, ('"conventional"', '"output_error"'), ('name = "small"', 'name = "other"'))
    assert set(seeds(sweep)) < set(seeds(wider))
    assert seeds(other) == seeds(sweep)
    assert not set(seeds(sweep)) & set(seeds(variant(tmp_path, ("seed = 1", "seed = 2"))))
    assert not set(seeds(sweep)) & set(seeds(variant(tmp_path, ("cn_r = -0.114", "cn_r = -0.115"))))


def test_the_sweep_survives_its_way_to_a_worker(sweep: Sweep) -> None:
    there = Sweep.from_json(sweep.to_json())
    assert there.to_json() == sweep.to_json()
    assert there.case(7).plan == sweep.case(7).plan


def test_a_case_can_be_simulated_by_itself(sweep: Sweep, tmp_path: Path) -> None:
    """Its description as a plan gives the record that the sweep keeps, to the bit."""
    case = sweep.case(5)
    (tmp_path / "plan.toml").write_text(tomli_w.dumps(dict(case.document)), encoding="utf-8")
    campaign = simulate_campaign(load_plan(tmp_path / "plan.toml"))
    kept = pl.read_parquet(run_shard(sweep, 5).files["records"])
    for run, (name, yaw) in zip(campaign.runs, kept.select("run", "yaw_rad").iter_rows(), strict=True):
        assert run.id == name
        assert np.array_equal(run.record.yaw_rad, np.array(yaw))


@pytest.mark.parametrize(("speed", "name"), [(0.0, "s8-v0-a20"), (15.0, "s8-v15-a20")])
def test_the_truth_of_a_run_is_the_nominal_models(sweep: Sweep, speed: float, name: str) -> None:
    """Against the equation of motion written out; stiffness, inertia and damping by hand from rig and file."""
    rig = load_rig()
    q = 0.5 * rig.air.density * rig.body.frontal_area * rig.body.length
    stiffness = 44.84 - q * speed**2 * 0.495
    damping = rig.dynamics.mechanical_damping + q * speed * rig.body.length * 0.114
    omega_n = (stiffness / rig.dynamics.yaw_inertia) ** 0.5
    rows = pl.read_parquet(run_shard(sweep, 0).files["results"]).filter(pl.col("run") == name)
    truths = dict(rows.select("quantity", "truth").iter_rows())
    assert truths["omega_n"] == pytest.approx(omega_n, rel=1e-12)
    assert truths["zeta"] == pytest.approx(damping / (2.0 * rig.dynamics.yaw_inertia * omega_n), rel=1e-12)


SCATTER = (
    '[scatter]\nwind_speed = [0.0, 0.003, 0.01]\nspring_stiffness_drift = -0.02\n[[effects]]\nname = "none"'
)


def test_scatter_is_an_axis_whose_absence_keeps_the_seeds(sweep: Sweep, tmp_path: Path) -> None:
    scattering = variant(tmp_path, ('[[effects]]\nname = "none"', SCATTER))
    assert scattering.size == 3 * sweep.size
    found = Counter(case.plan.scatter for case in map(scattering.case, range(scattering.size)))
    assert found == {
        Scatter(wind_speed=width, spring_stiffness_drift=-0.02): sweep.size for width in (0.0, 0.003, 0.01)
    }
    assert not set(seeds(sweep)) & set(seeds(scattering))
    alone = variant(tmp_path, ('[[effects]]\nname = "none"', SCATTER.replace("= -0.02", "= 0.0")))
    assert set(seeds(sweep)) < set(seeds(alone))
    case = scattering.case(scattering.size - 1)
    (tmp_path / "plan.toml").write_text(tomli_w.dumps(dict(case.document)), encoding="utf-8")
    assert load_plan(tmp_path / "plan.toml").scatter == case.plan.scatter


def test_scatter_is_in_the_results_and_an_axis_of_the_summary(tmp_path: Path) -> None:
    text = SMALL.replace('[[effects]]\nname = "none"', SCATTER).replace("records = true", "records = false")
    text = text.replace("replicates = 2", "replicates = 1")
    (tmp_path / "scatter.toml").write_text(text.replace("cases_per_shard = 1", "cases_per_shard = 50"))
    sweep = read_sweep(tmp_path / "scatter.toml")
    rows = pl.read_parquet(run_shard(sweep, 0).files["results"])
    assert set(rows["scatter_wind_speed"]) == {0.0, 0.003, 0.01}
    assert set(rows["scatter_spring_stiffness_drift"]) == {-0.02}
    assert set(rows["scatter_zero"]) == {0.0}
    lines = lines_of(rows.filter(pl.col("quantity") == "cn_r"), "conventional", "cn_r")
    along = [line for line in lines if line.axis == "scatter_wind_speed"]
    assert [(line.at, line.score.count) for line in along] == [(0.0, 2), (0.003, 2), (0.01, 2)]
    again = lines_of(rows.filter(pl.col("quantity") == "cn_r"), "conventional", "cn_r")
    assert [line.score.count for line in again if line.axis == "noise_std"] == [3, 3]


LONG = """
name = "long"
seed = 3
replicates = 1
estimators = ["matrix_pencil"]
cases_per_shard = 20
[conditions]
springs = [8]
wind_speeds = [0.0, 15.0]
release_angles_deg = [20.0]
duration = 45.0
[truth]
cn_beta = 0.495
cn_r = -0.114
[sensor]
sample_rate = 50.0
noise_std = [0.0, 0.001, 0.002]
resolution = 0.0
[scatter]
wind_speed = [0.0, 0.01]
[[effects]]
name = "none"
[[effects]]
name = "coulomb_friction"
parameters.friction_moment = 0.002
"""


def test_the_bound_is_that_of_a_long_lightly_damped_decay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Against std(ζ)/ζ = 4 (S/A) √(σ/fs) and std(f)/f = ζ std(ζ)/ζ, for light damping (Kay 1993)."""
    # the bounds are those of the plan, and simulating it takes nearly all of the time
    monkeypatch.setattr(sweep_work, "_simulate", lambda cases, _: [Failure(NOT_SIMULATED, "-")] * len(cases))
    (tmp_path / "long.toml").write_text(LONG, encoding="utf-8")
    rows = pl.read_parquet(run_shard(read_sweep(tmp_path / "long.toml"), 0).files["results"])
    still = rows.filter((pl.col("wind_speed") == 0.0) & pl.col("run").is_not_null())
    assert set(rows.filter(pl.col("noise_std") == 0.0)["bound"]) == {None}
    for noise in (0.001, 0.002):
        part = still.filter(pl.col("noise_std") == noise)
        truths, bounds = (dict(part.select("quantity", name).iter_rows()) for name in ("truth", "bound"))
        rate = truths["zeta"] * truths["omega_n"]
        relative = 4.0 * noise / np.radians(20.0) * np.sqrt(rate / 50.0)
        assert bounds["zeta"] / truths["zeta"] == pytest.approx(relative, rel=0.05)
        assert bounds["omega_n"] / truths["omega_n"] == pytest.approx(truths["zeta"] * relative, rel=0.05)
    # the same whatever effect acts; that of the coefficients grows with the noise and with the scatter
    by_effect = rows.group_by("noise_std", "scatter_wind_speed", "run", "quantity").agg(
        pl.col("bound").n_unique()
    )
    assert set(by_effect["bound"]) == {1}
    known = rows.filter((pl.col("quantity") == "cn_beta") & (pl.col("effect") == "none"))
    bounds = {(n, s): b for n, s, b in known.select("noise_std", "scatter_wind_speed", "bound").iter_rows()}
    assert bounds[0.002, 0.0] == pytest.approx(2.0 * bounds[0.001, 0.0], rel=1e-9)
    # an error of the speed of 1 % is one of 2 % in the only wind-on run
    assert bounds[0.001, 0.01] == pytest.approx(np.hypot(0.02 * 0.495, bounds[0.001, 0.0]), rel=0.01)
