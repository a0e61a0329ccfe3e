"""An estimate does not depend on the number of threads of the linear algebra library. Truth: its own digits."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]
SCRIPT = """
import sys
import numpy as np
from identification import identify
from tests.reference.free_decays import Setting, campaign
settings = [Setting(spring, speed) for spring in (16.12,) for speed in (0.0, 15.0)]
data = campaign(settings, duration=11.0, rate=1000.0, noise=5e-4, rng=np.random.default_rng(1))
for name in sys.argv[1:]:
    print(identify(data, name, throw=False).to_json_dict())
"""
ESTIMATORS = ("output_error", "filter_error", "log_decrement", "conventional", "bayesian")


def test_the_bits_are_the_same_with_one_thread_and_with_two() -> None:
    """Records of more than ten thousand samples, whose sums the library would split."""
    found = []
    for threads in ("1", "2"):
        counts = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), threads)
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, *ESTIMATORS],
            cwd=ROOT, env={**os.environ, **counts, "PYTHONPATH": str(ROOT)},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        found.append(done.stdout.splitlines())
    one, two = found
    assert len(one) == len(ESTIMATORS)
    for name, first, second in zip(ESTIMATORS, one, two, strict=True):
        assert first == second, name
