"""Times in a unit other than seconds are refused with both rates. Truth: one over the step."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tunnel_sim.files.run_checks import uniform_times
from tunnel_sim.vocabulary.errors import TunnelError


@pytest.mark.parametrize(("step", "rate"), [(20.0, "0.05 Hz"), (2e4, "5e-05 Hz"), (2e-5, "50000 Hz")])
def test_times_in_another_unit_are_refused_with_the_rate_they_would_mean(step: float, rate: str) -> None:
    said = f"which is {rate} if it is seconds, but [sensor] sample_rate is 50 Hz"
    with pytest.raises(TunnelError, match=re.escape(said)):
        uniform_times(step * np.arange(10.0), 50.0, "r1.csv")
    uniform_times(0.02 * np.arange(10.0), 50.0, "r1.csv")
