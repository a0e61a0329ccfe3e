"""The tutorials' code runs, and what they show is what it prints."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.architecture.test_readme import assert_same, script_output

ROOT = Path(__file__).parents[2]
PAGES = ROOT / "docs" / "tutorials"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
END = "-- end of a step --"


def steps(page: Path) -> list[tuple[str, str]]:
    """Every step's Python code with the text shown after it."""
    found: list[tuple[str, str]] = []
    for kind, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        if kind == "python":
            found.append((text, ""))
        elif kind == "text":
            found[-1] = (found[-1][0], text)
    return found


def printed(codes: list[str], folder: Path) -> list[str]:
    script = "".join(f"{code}\nprint({END!r})\n" for code in codes)
    return script_output(script, folder).split(END + "\n")[:-1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("the-papers-own-gap", 6),
        ("measured-records", 3),
        ("a-model-of-your-own", 4),
        ("the-papers-networks", 7),
        ("a-driven-rig", 6),
    ],
)
def test_shown_output_is_real_output(name: str, count: int, tmp_path: Path) -> None:
    shown = steps(PAGES / f"{name}.md")
    real = printed([code for code, _ in shown], tmp_path)
    assert len(shown) == len(real) == count
    for (_, text), output in zip(shown, real, strict=True):
        assert_same(text.splitlines(), output.splitlines())


def test_every_page_is_executed() -> None:
    assert {page.stem for page in PAGES.glob("*.md")} == {
        "the-papers-own-gap",
        "a-model-of-your-own",
        "a-driven-rig",
        "measured-records",
        "the-papers-networks",
    }
