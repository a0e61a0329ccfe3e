"""Numbers of effects and estimators in pages are those of the registries; a failure says where they are not."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from identification import ALL_ESTIMATORS
from tunnel_sim.effects import ALL_EFFECTS

ROOT = Path(__file__).parents[2]
WORDS = {"six": 6, "seven": 7, "eight": 8, "nine": 9, "ten": 10, "eleven": 11, "twelve": 12}
OF_THEIR_TIME = {"CHANGELOG.md", "docs/neural-posterior.md"}
"""Pages on what was there at a release, or when a study was made; decisions are such pages too."""
TOTALS = (
    r"(?:which|any|all|one) of (?:the |its )?(?P<number>\w+) \[?{what}\b",
    r"\b(?:all|among|and|the) (?P<number>\w+) (?:built-in )?\[?{what}\b(?! (?:of|which|that|considered))",
)
"""How a text states a total: "which of 29 effects", "all nine estimators"."""
REGISTRIES = {"effects": len(ALL_EFFECTS), "estimators": len(ALL_ESTIMATORS)}


def totals(text: str, what: str) -> Iterator[tuple[int, int]]:
    """Line and number of every total of a kind in a text."""
    for pattern in TOTALS:
        for found in re.finditer(pattern.format(what=what), text, re.IGNORECASE):
            number = WORDS.get(found["number"].lower(), found["number"])
            if str(number).isdecimal() and int(number) > 5:
                yield text.count("\n", 0, found.start()) + 1, int(number)


def pages() -> list[Path]:
    found = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    names = {page: page.relative_to(ROOT).as_posix() for page in found}
    return sorted(
        page
        for page, name in names.items()
        if name not in OF_THEIR_TIME and not name.startswith(("docs/decisions/", "docs/_build/"))
    )


@pytest.mark.parametrize("what", REGISTRIES)
def test_every_total_in_a_page_is_that_of_the_registry(what: str) -> None:
    stated = [
        (page.relative_to(ROOT).as_posix(), line, number)
        for page in pages()
        for line, number in totals(page.read_text(encoding="utf-8"), what)
    ]
    assert len(stated) >= 1
    wrong = [f"{name}:{line} says {number}" for name, line, number in stated if number != REGISTRIES[what]]
    assert wrong == [], f"there are {REGISTRIES[what]} {what}"


def test_a_wrong_total_is_found() -> None:
    assert list(totals("one\nwhich of 25 effects is", "effects")) == [(2, 25)]
    assert list(totals("compares all eight estimators", "estimators")) == [(1, 8)]
    assert list(totals("two effects of the 3 effects", "effects")) == []
