"""A long record is imported within the memory that the requirement allows.

Truth: the memory that the operating system counts.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest

SAMPLES = 10_000_000
SCRIPT = """
import resource, sys
from tunnel_sim.files import import_records
import_records([sys.argv[1]], sys.argv[2])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.slow
def test_ten_million_samples(tmp_path: Path) -> None:
    time = np.arange(SAMPLES) / 1e4
    angle = 20.0 * np.exp(-0.004 * time) * np.cos(2.0 * np.pi * time)
    angle += 0.03 * np.random.default_rng(1).standard_normal(SAMPLES)
    pl.DataFrame({"Time (s)": time, "Yaw (deg)": angle}).write_csv(tmp_path / "long.csv", float_precision=5)
    command = [sys.executable, "-c", SCRIPT, tmp_path / "long.csv", tmp_path / "rig"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert int(done.stdout) < 1.5 * 2**20  # KiB
