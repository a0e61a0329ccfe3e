"""An estimate does not depend on the number of threads of the linear algebra library, and starts no more than one.

Truth: the estimate's own digits, and the library's own count.
"""

from __future__ import annotations

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from diagnosis import diagnose
from identification import identify, make_estimator
from tests.reference.free_decays import Setting, campaign

ESTIMATORS = ("output_error", "filter_error", "log_decrement", "conventional", "bayesian")


def test_the_bits_are_the_same_with_one_thread_and_with_two() -> None:
    """Records of more than ten thousand samples, whose sums the library would split."""
    settings = [Setting(16.12, speed) for speed in (0.0, 15.0)]
    data = campaign(settings, duration=11.0, rate=1000.0, noise=5e-4, rng=np.random.default_rng(1))
    for name in ESTIMATORS:
        found = []
        for threads in (1, 2):
            with threadpool_limits(threads, user_api="blas"):
                found.append(make_estimator(name).estimate(data).to_json_dict())
        assert found[0] == found[1], name


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
