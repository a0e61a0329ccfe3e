"""An estimate does not depend on the number of threads of the linear algebra library, and starts no more than one.

Truth: the estimate's own digits, and the library's own count.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from diagnosis import diagnose
from identification import identify

ROOT = Path(__file__).parents[4]
SCRIPT = """
import sys
import numpy as np
from identification import make_estimator
from tests.reference.free_decays import Setting, campaign
settings = [Setting(spring, speed) for spring in (16.12,) for speed in (0.0, 15.0)]
data = campaign(settings, duration=11.0, rate=1000.0, noise=5e-4, rng=np.random.default_rng(1))
for name in sys.argv[1:]:
    print(make_estimator(name).estimate(data).to_json_dict())
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


@pytest.mark.parametrize("face", [identify, diagnose])
def test_the_faces_use_one_thread_and_leave_the_number_as_it_was(face, monkeypatch):
    def counts() -> set[int]:
        return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}

    seen = []

    def as_campaign(_: str) -> None:
        seen.append(counts())
        raise LookupError

    monkeypatch.setitem(face.__wrapped__.__globals__, "as_campaign", as_campaign)
    with threadpool_limits(2, user_api="blas"):
        before = counts()
        with pytest.raises(LookupError):
            face("anywhere")
        assert counts() == before
    assert seen == [{1}]
