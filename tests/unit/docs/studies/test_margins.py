"""Numbers that remember what they would be at half and at twice the size of a constant."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from scipy.special import chdtri

from diagnosis import Settings
from docs.studies.margins import Watched, main, table, watched


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


def test_campaigns_counted_before_are_not_diagnosed_again(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "campaign.toml").touch()
    counted = {
        str(tmp_path / "a"): {"weighing.leak": [7, 0, 2]},
        str(tmp_path / "b"): {"weighing.leak": [3, 1, 0]},
    }
    assert "| `weighing.leak` | 10 | 1 | 1 | 2 | 1 |" in table([tmp_path], 10, counted)


def test_counts_that_cannot_be_read_are_refused_in_one_line(tmp_path, monkeypatch, capsys):
    (tmp_path / "campaign.toml").touch()
    (tmp_path / "counts.json").write_text("{", "utf-8")
    monkeypatch.setattr(sys, "argv", ["margins", str(tmp_path), "--kept", str(tmp_path / "counts.json")])
    with pytest.raises(SystemExit, match="2"):
        main()
    assert "cannot read the counts in" in capsys.readouterr().err
