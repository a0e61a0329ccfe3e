"""The how-to pages: what they show is what the tool does, and their links lead somewhere."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from test_readme import assert_same, output_of, toml_block
from test_tutorials import printed, steps

from tunnel_lab.scoring.packaged import packaged_baseline

PAGES = Path(__file__).parents[2] / "docs" / "how-to"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def test_the_budget_shown_is_the_real_one(tmp_path: Path) -> None:
    page = (PAGES / "state-uncertainties.md").read_text(encoding="utf-8")
    blocks = BLOCK.findall(page)
    (known,) = [text for kind, text in blocks if kind == "toml"]
    (session,) = [text for kind, text in blocks if kind == "console"]
    (tmp_path / "known.toml").write_text(known, encoding="utf-8")
    (tmp_path / "plan.toml").write_text(toml_block("wind_speeds"), encoding="utf-8")
    said = re.split(r"^\$ ", session, flags=re.MULTILINE)[1:]
    assert len(said) == 2
    for text in said:
        typed, *shown = text.splitlines()
        assert_same(shown, output_of(typed, tmp_path))


def test_the_figures_for_choosing_are_those_of_the_packaged_score(tmp_path: Path) -> None:
    shown = steps(PAGES / "choose-an-estimator.md")
    real = printed([code for code, _ in shown], tmp_path)
    assert len(shown) == len(real) >= 3
    for (_, text), output in zip(shown, real, strict=True):
        assert_same(text.splitlines(), output.splitlines())


def test_every_estimator_that_is_scored_has_its_line() -> None:
    page = (PAGES / "choose-an-estimator.md").read_text(encoding="utf-8")
    scored = packaged_baseline().estimators
    assert len(scored) >= 8
    assert [name for name in scored if f"| `{name}` |" not in page] == []


@pytest.mark.parametrize("page", sorted(PAGES.glob("*.md")), ids=lambda page: page.stem)
def test_the_links_lead_somewhere(page: Path) -> None:
    links = [link for link in re.findall(r"\]\(([^)]+)\)", page.read_text()) if "://" not in link]
    assert [link for link in links if not (page.parent / link.partition("#")[0]).exists()] == []
