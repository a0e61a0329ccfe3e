"""The page of the trained agent: its table is that of the stored episodes, and its code prints what is shown."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs.studies.campaign_agent import fill
from docs.studies.learning_curves import curves, from_csv
from docs.studies.learning_curves import fill as filled_with_curves
from docs.studies.quotes import printed, quotes
from docs.studies.trained_policy import stored_agent

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "how-to" / "train-an-agent.md"


def test_the_page_shows_the_stored_episodes() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert fill(page, DOCS) == page
    assert "| trained |" in page


def test_the_page_shows_the_stored_curves() -> None:
    page = PAGE.read_text(encoding="utf-8")
    points = from_csv((DOCS / "how-to" / "train-an-agent-curves.csv").read_text(encoding="utf-8"))
    assert filled_with_curves(page, points) == page
    assert "| 25,600 |" in page
    assert len(points) in (27, 35)  # with one or two trainings of FreeDecay-v0


def test_what_the_page_says_of_the_curves_is_in_the_data() -> None:
    points = from_csv((DOCS / "how-to" / "train-an-agent-curves.csv").read_text(encoding="utf-8"))
    of = {(one.environment, one.policy, one.seed, one.steps): one for one in points}
    limit, best = (of["FreeDecay-v0", f"resonant {how}", 0, 0] for how in ("at 40 m/s", "by spring"))
    greedy = of["Campaign-v0", "greedy", 0, 0]
    played = {one.seed for one in points if (one.environment, one.policy) == ("FreeDecay-v0", "trained")}
    assert 0 in played
    for seed in played:
        line = [one for one in points if one.seed == seed and one.policy == "trained"]
        runs = {one.steps: one for one in line if one.environment == "FreeDecay-v0"}
        gained = {count: one.nats - runs[0].nats for count, one in runs.items()}
        assert all(abs(gain) < 0.4 for count, gain in gained.items() if count <= 12_800)
        assert all(gain > 1.0 for count, gain in gained.items() if count > 50_000)
        assert limit.nats < runs[max(runs)].nats < best.nats - 0.5
    assert of["Campaign-v0", "trained", 1, 32_768].nats > greedy.nats
    assert of["Campaign-v0", "trained", 0, 32_768].nats < greedy.nats


def test_the_curves_are_drawn() -> None:
    points = from_csv((DOCS / "how-to" / "train-an-agent-curves.csv").read_text(encoding="utf-8"))
    drawn = curves(points)
    assert [axes.get_title("left") or axes.get_title() for axes in drawn.axes] == [
        "FreeDecay-v0",
        "Campaign-v0",
    ]
    assert (DOCS / "images" / "train-an-agent-curves.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.slow
def test_the_first_example_prints_what_is_shown(tmp_path: Path) -> None:
    """And an agent read from a file, here the stored one, chooses the same runs."""
    first, reading, *_ = quotes(PAGE.read_text("utf-8"))
    own = stored_agent()
    (tmp_path / "agent.safetensors").write_bytes(own.to_bytes())
    assert printed([first.source, reading.source], tmp_path) == [first.shown, "7 runs, 6.5 nats\n"]
    assert "trained: 7 runs, " in first.shown


@pytest.mark.slow
def test_the_bridge_of_the_page_runs(tmp_path: Path) -> None:
    """With so few steps that it takes seconds."""
    bridge = quotes(PAGE.read_text("utf-8"))[2]
    code, text = bridge.source, bridge.shown
    assert code.count("STEPS = 80_000") == 1
    (said,) = printed([code.replace("80_000", "6_400")], tmp_path)
    assert said.splitlines()[0] == text.splitlines()[0]
    assert re.fullmatch(r"the last 16 runs: \d\.\d nats", said.splitlines()[1])
