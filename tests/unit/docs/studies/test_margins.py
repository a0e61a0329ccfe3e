"""Numbers that remember what they would be at half and at twice the size of a constant."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import chdtri

from diagnosis import Settings
from docs.studies.margins import Watched, watched


def number(value=4.0, name="C"):
    return Watched(value, {name: (0.5 * value, 2.0 * value)})


@pytest.mark.parametrize(
    ("made", "half", "twice"),
    [
        (3.0 * number() + 1.0, 7.0, 25.0),
        (1.0 - number() / 2.0, 0.0, -3.0),
        (np.float64(3.0) * number(), 6.0, 24.0),
        (number() ** 2, 4.0, 64.0),
        (np.log(number()), np.log(2.0), np.log(8.0)),
        (chdtri(2, number(1e-3)), chdtri(2, 5e-4), chdtri(2, 2e-3)),
    ],
)
def test_what_is_computed_from_a_constant_follows_it(made, half, twice):
    assert made.at["C"] == pytest.approx((half, twice))


def test_two_constants_are_moved_one_at_a_time():
    made = number(4.0, "A") * number(3.0, "B")
    assert (float(made), made.at) == (12.0, {"A": (6.0, 24.0), "B": (6.0, 24.0)})


def test_comparisons_that_come_out_differently_are_counted_by_constant():
    _, counts = watched()
    assert np.float64(5.0) > number()  # not at twice
    assert number() < 100.0  # always
    assert np.array_equal(np.array([3.0, 7.0]) > number(), [False, True])  # otherwise at both
    assert counts["C"] == [3, 1, 2]


def test_every_setting_that_is_not_whole_is_watched():
    settings, _ = watched()
    before = Settings().weighing.steepness
    assert settings.weighing.steepness.at == {"weighing.steepness": (0.5 * before, 2.0 * before)}
    assert settings == Settings()
    whole = {name for name, value in settings.values().items() if not isinstance(value, Watched)}
    assert whole == {name for name, value in Settings().values().items() if isinstance(value, int)}
