"""The page of the trained agent: its table is that of the stored episodes, and its code prints what is shown."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_tutorials import printed, steps

from docs.studies.campaign_agent import fill

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "how-to" / "train-an-agent.md"


def test_the_page_shows_the_stored_episodes() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert fill(page, DOCS) == page
    assert "| trained |" in page


def test_the_first_example_prints_what_is_shown(tmp_path: Path) -> None:
    (code, text), *_ = steps(PAGE)
    assert printed([code], tmp_path) == [text]


@pytest.mark.slow
def test_the_bridge_of_the_page_runs(tmp_path: Path) -> None:
    code, text = steps(PAGE)[1]
    assert printed([code], tmp_path) == [text]
