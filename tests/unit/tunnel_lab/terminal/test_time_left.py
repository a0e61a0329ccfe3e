"""The time left of a diagnosis. Truth: a lognormal distribution drawn here, and a clock of the test's own."""

from __future__ import annotations

import io

import numpy as np
import pytest
from rich.console import Console

from tunnel_lab.terminal import progress
from tunnel_lab.terminal.time_left import LEFT, Reached


@pytest.mark.parametrize("begun", [0.5, 40.0])
@pytest.mark.parametrize("passed", [0.0, 3.0, 10.0])
def test_the_range_holds_eight_of_ten_of_the_times_that_have_not_passed(begun: float, passed: float) -> None:
    reached = Reached("effects", begun)
    low, high = np.log(LEFT["effects"])
    drawn = begun * np.exp(
        np.random.default_rng(1).normal(0.5 * (low + high), (high - low) / 2.5631, 200_000)
    )
    now = begun * (1.0 + passed)
    left = begun + drawn[begun + drawn > now] - now
    found = reached.left(now)
    assert found is not None
    assert np.mean(left < found[0]) == pytest.approx(0.1, abs=0.005)
    assert np.mean(left > found[1]) == pytest.approx(0.1, abs=0.005)


def test_nothing_is_said_at_first_and_where_a_stage_takes_unusually_long() -> None:
    assert Reached().words(3.0) == "time left not known yet"
    assert Reached("noise", 1.0).words(1.0) == "time left not known yet"
    reached = Reached("effects", 2.0)
    assert reached.left(3.0) is not None
    assert reached.words(2.0 + 100.0 * 2.0) == "time left not known"


def test_every_stage_with_a_range_is_one_of_the_diagnosis_and_they_shrink() -> None:
    order = [name for name in progress.STEPS if name in LEFT]
    assert set(order) == set(LEFT)
    assert LEFT["where"][1] > LEFT["effects"][1] > LEFT["random moments"][1] > LEFT["remainder"][1]


@pytest.mark.parametrize(
    ("left", "words"),
    [
        ((0.2, 0.9), "less than 1 s left"),
        ((1.6, 12.4), "about 2 to 12 s left"),
        ((1.0, 33.0), "about 1 to 35 s left"),
        ((21.0, 64.0), "about 20 to 65 s left"),
        ((30.0, 30.4), "about 30 s left"),
        ((58.0, 301.0), "about 60 s to 5 min left"),
        ((130.0, 301.0), "about 2 to 5 min left"),
    ],
)
def test_the_range_is_rounded(monkeypatch: pytest.MonkeyPatch, left: tuple[float, float], words: str) -> None:
    monkeypatch.setattr(Reached, "left", lambda *_: left)
    assert Reached("where", 1.0).words(1.0) == words


def test_a_terminal_shows_the_step_the_set_and_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Console(file=io.StringIO(), force_terminal=True, width=160, color_system=None)
    clock = [100.0]
    monkeypatch.setattr(progress, "console", lambda **_: terminal)
    monkeypatch.setattr(progress.time, "perf_counter", lambda: clock[0])
    with progress.step_display() as show:
        show("noise")
        for at, report in ((102.0, "where"), (104.0, "effects"), (105.0, "free_play")):
            clock[0] = at
            show(report)
        clock[0] = 109.0
    shown = terminal.file.getvalue()
    assert "time left not known" in shown
    left = Reached("effects", 4.0).words(9.0)
    assert left.startswith("about ")
    assert "fitting sets of effects: free_play" in shown
    assert left in shown
