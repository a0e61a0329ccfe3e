"""``paper.md``: its figures are those of the pages, and its references and pictures exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from identification import ALL_ESTIMATORS
from tunnel_sim.effects import ALL_EFFECTS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
TEXT = " ".join((ROOT / "paper.md").read_text(encoding="utf-8").split())
BLIND = (DOCS / "blind-check.md").read_text(encoding="utf-8")
REAL = (DOCS / "real-records.md").read_text(encoding="utf-8")
CAUSES = (DOCS / "benchmark-of-causes.md").read_text(encoding="utf-8")


def found(pattern: str, page: str) -> tuple[str, ...]:
    match = re.search(pattern, page, re.MULTILINE)
    assert match is not None, pattern
    return match.groups()


def test_the_figures_of_the_blind_check_are_those_of_its_page() -> None:
    right, of, low, high = found(r"^\| all \| (\d+) \| (\d+) \| .*? \| ([\d.]+)–([\d.]+) % \|$", BLIND)
    assert f"{right} of {of} sets were exactly right (95 % interval {low} to {high} %)" in TEXT
    caught, acting, false, named = found(
        r"^\| all \| \d+/\d+, .*? \| (\d+)/(\d+), .*? \| (\d+)/(\d+), ", BLIND
    )
    assert f"{caught} of {acting} were found, and {false} of {named} named causes were false" in TEXT
    for row in ("none acts", "outside the vocabulary"):
        assert found(rf"^\| {row} \| (\d+) \| (\d+) \|", BLIND) == ("14", "14")


def test_the_figures_of_the_real_records_are_those_of_their_page() -> None:
    right, of = found(r"^\*\*(\d+) of (\d+) are right\.\*\*", REAL)
    assert f"{right} of {of} are answered rightly" in TEXT


def test_the_figures_of_the_benchmark_are_those_of_its_page() -> None:
    best = max(
        re.findall(r"^\| (.*?) \| (\d+)/(\d+) \(", CAUSES, re.MULTILINE)[:5], key=lambda row: int(row[1])
    )
    if "`tunnel diagnose` has not been run" in CAUSES:
        assert f"the best names the exact set in {best[1]}/{best[2]}" in TEXT
        assert "has not been run on it yet" in TEXT
    else:
        assert "has not been run" not in TEXT
        assert f"{best[1]}/{best[2]}" in TEXT


def test_the_counts_are_those_of_the_code() -> None:
    assert f"{len(ALL_EFFECTS)} effects" in TEXT
    assert len(ALL_ESTIMATORS) == 9
    assert "nine estimators" in TEXT


def test_references_and_pictures_exist() -> None:
    keys = set(re.findall(r"^@\w+\{(\w+),", (ROOT / "paper.bib").read_text(encoding="utf-8"), re.MULTILINE))
    assert set(re.findall(r"@([a-z]+\d{4})", TEXT)) == keys
    for picture in re.findall(r"\]\((docs/[^)]+)\)", TEXT):
        assert (ROOT / picture).is_file()


@pytest.mark.parametrize(
    "heading", ["Summary", "Statement of need", "State of the field", "Method", "Checks"]
)
def test_the_article_has_every_section(heading: str) -> None:
    assert re.search(rf"^# {heading}$", (ROOT / "paper.md").read_text(encoding="utf-8"), re.MULTILINE)
