"""Every decision that code, tests or pages cite has a page; the index has every page and every old number."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
DECISIONS = ROOT / "docs" / "decisions"
FOLDERS = (
    "benchmarks",
    "diagnosis",
    "docs",
    "identification",
    "mjcf",
    "tests",
    "tunnel_lab",
    "tunnel_reference",
    "tunnel_sim",
)
_CITED = re.compile(r"[Dd]ecisions?((?:\s*(?:,|and|or)?\s*\[?\b0\d{3}\b\]?(?:\([^)]*\))?)+)")
_SETTING = re.compile(r"\bdecision=\"(0\d{3})\"")


def pages() -> set[str]:
    return {path.name[:4] for path in DECISIONS.glob("0*.md")}


def cited() -> set[tuple[str, str]]:
    """File and number of every citation."""
    sources = [*ROOT.glob("*.md"), *ROOT.glob("*.toml")]
    for folder in FOLDERS:
        sources += [
            path for ending in ("py", "c", "h", "md") for path in (ROOT / folder).rglob(f"*.{ending}")
        ]
    cases = set()
    for path in sources:
        text = path.read_text("utf-8")
        for numbers in [*_CITED.findall(text), *_SETTING.findall(text)]:
            cases |= {(str(path.relative_to(ROOT)), number) for number in re.findall(r"\b0\d{3}\b", numbers)}
    return cases


def test_every_cited_decision_has_a_page() -> None:
    known = pages()
    citations = cited()
    assert len({file for file, _ in citations}) > 20  # the patterns still match
    assert {(file, number) for file, number in citations if number not in known} == set()


def test_the_index_has_every_page_once_and_a_page_for_every_old_number() -> None:
    index, old = (DECISIONS / "README.md").read_text("utf-8").split("## Old numbers")
    known = pages()
    assert sorted(re.findall(r"^\| \[(0\d{3})\]\(\1-", index, re.MULTILINE)) == sorted(known)
    merged = {number for row in re.findall(r"^\| (0.*?) \|", old, re.MULTILINE) for number in row.split(", ")}
    assert not merged & known
    numbers = {f"{number:04d}" for number in range(1, 58)}
    assert numbers - merged - known == {"0051"}  # no page ever had it
