"""A sweep small enough for tests."""

from __future__ import annotations

from pathlib import Path

from tunnel_lab.experiments.experiment import Parts
from tunnel_lab.experiments.sweep import stored_sweep, sweep_of

SMALL = """
name = "small"
seed = 1
replicates = 2
estimators = ["conventional"]
records = true
cases_per_shard = 1

[conditions]
springs = [8]
wind_speeds = [0.0, 15.0]
release_angles_deg = [20.0]
duration = 2.0

[truth]
cn_beta = 0.495
cn_r = -0.114

[sensor]
sample_rate = 500.0
noise_std = [0.0002, 0.002]

[[effects]]
name = "none"
[[effects]]
name = "coulomb_friction"
parameters = { friction_moment = [0.002, 0.02] }
"""


def contents(folder: Path) -> dict[str, bytes]:
    """Bytes of what every file, which must be the same in every run of a sweep."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def open_store(folder: Path) -> Parts[int]:
    """The results in the folder of a sweep."""
    return Parts(folder, sweep_of(stored_sweep(folder)))
