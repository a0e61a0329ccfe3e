"""The line through the logarithms of the peaks; truth: SciPy's linear regression."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import linregress

from identification.decay.peaks import _line


def test_the_gradient_and_its_deviation_are_those_of_a_linear_regression() -> None:
    rng = np.random.default_rng(5)
    x = np.sort(rng.uniform(3.0, 40.0, 11))
    y = 0.7 - 0.03 * x + 0.2 * rng.standard_normal(11)
    expected = linregress(x, y)
    assert _line(x, y) == pytest.approx((expected.slope, expected.stderr))
