"""What is too large is refused by its count before any of it is expanded; the page of limits says the same."""

import ast
import json
import re
import resource
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from math import prod
from pathlib import Path

import pytest

from tests.support.small_sweep import SMALL
from tunnel_lab.experiments.runner import processes
from tunnel_lab.experiments.score import score_grid
from tunnel_lab.experiments.score_grid import load_grid, packaged_grid
from tunnel_lab.experiments.sweep import read_sweep
from tunnel_lab.experiments.sweep_cases import Sweep
from tunnel_sim.engine.virtual_campaign import run_settings
from tunnel_sim.files.plan_file import first_twice, load_plan, paper_plan
from tunnel_sim.physics.run_settings import sampling
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError

ROOT = Path(__file__).parents[4]
PAGE = ROOT / "docs" / "reference" / "limits.md"
PLAN = """
name = "p"
seed = 1
springs = [5]
wind_speeds = [0.0]
release_angles_deg = [20.0]
duration = 10.0
[truth]
cn_beta = 0.495
cn_r = -0.114
[sensor]
sample_rate = 1000.0
"""
GRID = """
schema_version = 1
name = "g"
seed = 1
trials = 4
[[decays]]
zeta = [0.01]
frequency = [2.0]
noise = [0.01]
duration = [4.0]
[[campaigns]]
springs = [16.12]
wind_speeds = [25.0]
noise = [0.0015]
duration = [4.0]
"""


def numbers(count: int, *, first: float = 1.0) -> str:
    return str([first + i for i in range(count)])


@contextmanager
def cheap() -> Iterator[None]:
    """Nothing that is refused may take the memory or the time of what it asks for."""
    begun, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    assert time.process_time() - begun < 5.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000  # KiB


def refused(read: Callable[[Path], object], text: str, folder: Path) -> str:
    path = folder / "file.toml"
    path.write_text(text, encoding="utf-8")
    with cheap(), pytest.raises(TunnelError) as caught:
        read(path)
    assert str(path) in str(caught.value)
    return str(caught.value)


PLANS = {
    "speeds": ("wind_speeds = [0.0]", f"wind_speeds = {numbers(100_000)}", "100,000 runs, more than 10,000"),
    "angles": ("= [20.0]", f"= {[i / 1000 for i in range(1, 20_000)]}", "19,999 runs, more than 10,000"),
    "duration": ("10.0", "1e9", "1e+12 samples in a run, more than 20,000,000"),
    "rate": ("= 1000.0", "= 1e8", "1e+09 samples in a run, more than 20,000,000"),
    "runs together": (
        "[0.0]\nrelease_angles_deg = [20.0]\nduration = 10.0",
        "[0.0]\nrelease_angles_deg = [20.0]\nrepeats = 1000\nduration = 100.0",
        "1e+08 samples in the campaign, more than 40,000,000",
    ),
    "few samples of long steps": ("= 1000.0", "= 1e-6", "2e+09 integration steps in the campaign"),
    "no rate at all": ("= 1000.0", "= 5e-324", "'sample_rate' = 4.94066e-324 is beyond 1e-100 to 1e+100"),
    "a rate in no clock": ("= 1000.0", "= 1e99", "[sensor]: 'sample_rate' = 1e+99 should be less than"),
}


@pytest.mark.parametrize("case", PLANS)
def test_a_plan_is_counted_before_it_is_expanded(case: str, tmp_path: Path) -> None:
    old, new, expected = PLANS[case]
    assert old in PLAN
    assert expected in refused(load_plan, PLAN.replace(old, new, 1), tmp_path)


def test_the_limits_leave_room(tmp_path: Path) -> None:
    (tmp_path / "p.toml").write_text(PLAN.replace("10.0", "1e4"), encoding="utf-8")  # 10 million samples
    assert len(load_plan(tmp_path / "p.toml").conditions) == 1
    (tmp_path / "p.toml").write_text(
        PLAN.replace("[20.0]", "[20.0]\nrepeats = 1000").replace("[0.0]", "[0.0, 15.0]"), encoding="utf-8"
    )
    assert len(load_plan(tmp_path / "p.toml").conditions) == 2000


@pytest.mark.parametrize("rate", [5e-324, 1e-7, 1e300, float("inf"), float("nan"), 0.0, -1.0])
def test_no_run_is_sampled_at_an_impossible_rate(rate: float) -> None:
    plan = paper_plan()
    with pytest.raises(TunnelError, match="sample rate"):
        sampling(run_settings(plan.truth, plan.conditions[0]), rate)


MANY = numbers(300)
SWEEPS = {
    "300⁴ cases": (
        "cn_beta = 0.495\ncn_r = -0.114",
        f"cn_beta = {MANY}\ncn_r = {MANY}\nyaw_inertia = {MANY}\nmechanical_damping = {MANY}",
        "truth: 8,100,000,000 values, more than 100,000",
    ),
    "300⁴ sensors": (
        "sample_rate = 500.0\nnoise_std = [0.0002, 0.002]",
        f"sample_rate = {MANY}\nnoise_std = {MANY}\nresolution = {MANY}\nzero = {MANY}",
        "sensor: 8,100,000,000 values, more than 100,000",
    ),
    "effects": ("[0.002, 0.02]", numbers(100_001), "effects: 100,002 values, more than 100,000"),
    "shards": ("replicates = 2", "replicates = 1_000_000", "6,000,000 shards, more than 1,000,000"),
    "checks": ("duration = 2.0", f"duration = {numbers(50_000)}", "combinations of rig and conditions"),
    "runs": ("[0.0, 15.0]", numbers(20_000), "conditions 'conditions': 20,000 runs, more than 10,000"),
    "duration": ("duration = 2.0", "duration = 1e9", "5e+11 samples in a run, more than 20,000,000"),
    "a shard": ("cases_per_shard = 1", "cases_per_shard = 100_000_000", "6e+07 samples in a shard"),
    "rate": ("sample_rate = 500.0", "sample_rate = [500.0, 1e-6]", "integration steps in the campaign"),
}


@pytest.mark.parametrize("case", SWEEPS)
def test_a_sweep_is_counted_before_it_is_expanded(case: str, tmp_path: Path) -> None:
    old, new, expected = SWEEPS[case]
    assert old in SMALL
    text = SMALL.replace(old, new, 1)
    if case == "a shard":
        text = text.replace("replicates = 2\n", "replicates = 5000\n")
    assert expected in refused(read_sweep, text, tmp_path)


def test_the_product_of_a_sweep_is_limited(tmp_path: Path) -> None:
    text = SMALL.replace("replicates = 2", "replicates = 1_000_000").replace("= 0.495", f"= {numbers(100)}")
    assert "600,000,000 cases, more than 100,000,000" in refused(read_sweep, text, tmp_path)


def test_counts_of_a_sweep_are_those_of_its_axes(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(SMALL.replace("= 0.495", "= [0.4, 0.5, 0.6]"), encoding="utf-8")
    sweep = read_sweep(tmp_path / "s.toml")
    assert sweep.size == prod(len(axis) for axis in sweep.axes) * 2
    assert sweep.runs == sum(len(sweep.case(i).plan.conditions) for i in range(sweep.size))


def test_a_sweep_as_json_is_read_as_strictly(tmp_path: Path) -> None:
    """What a scheduler hands out, or a folder's sweep.json holds."""
    (tmp_path / "s.toml").write_text(SMALL, encoding="utf-8")
    good = json.loads(read_sweep(tmp_path / "s.toml").to_json())
    assert Sweep.from_json(json.dumps(good)).size == 12
    for spoilt in (
        {}, {"document": good["document"]}, {"document": good["document"], "rigs": []},
        {"document": good["document"], "rigs": [1]}, {"document": good["document"], "rigs": [{}]},
        {"document": [], "rigs": good["rigs"]},
        {"document": good["document"] | {"replicates": 10**9}, "rigs": good["rigs"]},
        {"document": good["document"] | {"truth": [{"cn_beta": [1.0] * 10**5, "cn_r": [1.0] * 10**3}]},
         "rigs": good["rigs"]},
    ):  # fmt: skip
        with cheap(), pytest.raises(TunnelError, match=r"the sweep as JSON|rig"):
            Sweep.from_json(json.dumps(spoilt))


def test_a_rig_whose_table_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text("dynamics = 1\n", encoding="utf-8")
    text = SMALL + '[[rig]]\nfile = "rig.toml"\nchanges = { dynamics = { yaw_inertia = 0.1 } }\n'
    (tmp_path / "s.toml").write_text(text, encoding="utf-8")
    with pytest.raises(TunnelError, match="section"):
        read_sweep(tmp_path / "s.toml")


GRIDS = {
    "cells": ("zeta = [0.01]", f"zeta = {[i / 20_000 for i in range(1, 20_000)]}", "20,000 cells, more than"),
    "a product": (
        "frequency = [2.0]\nnoise = [0.01]",
        f"frequency = {numbers(3000)}\nnoise = {numbers(3000)}",
        "9,000,001 cells, more than 10,000",
    ),
    "duration": ("duration = [4.0]", "duration = [1e9]", "1e+12 samples in a run"),
    "springs": ("[16.12]", numbers(6000), "campaigns: 12,000 runs, more than 10,000"),
    "rate": ("duration = [4.0]", "duration = [4.0]\nsample_rate = 5e-324", "'sample_rate' = 4.94066e-324"),
}


@pytest.mark.parametrize("case", GRIDS)
def test_a_grid_is_counted_before_it_is_expanded(case: str, tmp_path: Path) -> None:
    old, new, expected = GRIDS[case]
    assert old in GRID
    assert expected in refused(load_grid, GRID.replace(old, new, 1), tmp_path)


def test_the_trials_of_a_score_are_counted_first() -> None:
    """``--trials`` has no limit of its own."""
    grid = replace(packaged_grid(), trials=10**9, trials_of=())
    with cheap(), pytest.raises(TunnelError, match=r"rows .*, more than 1,000,000"):
        score_grid(grid, ("conventional",), processes(0))


def test_repeated_values_are_found_in_one_pass() -> None:
    begun = time.process_time()
    assert first_twice(range(200_000)) is None
    assert first_twice([3, 1, 2, 1, 3]) == 1
    assert time.process_time() - begun < 1.0


def constants() -> dict[str, object]:
    return {name: value for name, value in vars(limits).items() if name.isupper()}


def reasons() -> dict[str, str]:
    """The line under each constant."""
    body = ast.parse(Path(limits.__file__).read_text(encoding="utf-8")).body
    return {
        one.targets[0].id: " ".join(following.value.value.split())
        for one, following in pairwise(body)
        if isinstance(one, ast.Assign) and isinstance(following, ast.Expr)
    }


def test_the_page_says_what_the_constants_say() -> None:
    rows = re.findall(r"^\| `([A-Z_]+)` \| (\S+) \| (.+) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert {name: float(value.replace(",", "")) for name, value, _ in rows} == constants()
    assert {name: reason for name, _, reason in rows} == reasons()
    assert len(rows) == len(constants())
    assert all(": " in reason for reason in reasons().values()), "each says why"


def test_networks_are_warned_of_where_they_are_used() -> None:
    from tunnel_lab.commands import sweep

    assert "no password" in str(sweep.sweep.__doc__)
    assert "**no password**" in PAGE.read_text(encoding="utf-8")
