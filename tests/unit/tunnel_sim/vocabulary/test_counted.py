"""Numbers of things in words: one gap, two gaps, and no text with a plural of its own making."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tunnel_sim.vocabulary.errors import counted

ROOT = Path(__file__).parents[4]
NOUNS = (
    "actions|campaigns|cases|cells|channels|characters|columns|cycles|estimates|files|folders|gaps|jumps|lines|numbers|"
    "readings|records|rows|runs|samples|seeds|shards|springs|tests|texts|values|windows"
)
PLURAL = re.compile(rf"^ (?:(?:more|further|finished|repeated|missing|driven) )?(?:{NOUNS})\b")
TWO_OR_MORE = {
    "tunnel_lab/commands/about.py",  # the self-check's runs
    "tunnel_lab/commands/demo.py",  # runs of plans in the package
    "tunnel_lab/commands/train.py",  # samples that train a network
    "tunnel_lab/commands/paper.py",  # characters beyond the limit
    "tunnel_lab/plotting/runs.py",  # records that do not fit on a figure
    "tunnel_sim/engine/model_files.py",  # more than one folder
    "tunnel_sim/files/exporting.py",  # samples beyond the rows of a sheet
    "tunnel_sim/files/importing/columns.py",  # columns of which one has to be chosen
    "tunnel_sim/files/importing/raw_records.py",  # columns of which one has to be chosen, and samples of a record
    "tunnel_sim/files/readers.py",  # more than one input
    "tunnel_sim/files/plausible.py",  # a decimal
    "tunnel_sim/physics/expression.py",  # characters beyond the limit
    "tunnel_sim/vocabulary/inputs.py",  # samples of a record
    "tunnel_sim/vocabulary/record.py",  # samples of a record
    "diagnosis/model/joint.py",  # springs that differ
    "identification/examination/self_excited.py",  # cycles of a steady oscillation
    "diagnosis/findings/causes.py",  # springs of which one is off
    "diagnosis/findings/spring_choices.py",  # the same
    "tunnel_sim/files/importing/inputs.py",  # columns of which one has to be chosen
    "diagnosis/findings/remainder.py",  # one run has words of its own
    "diagnosis/findings/cautions.py",  # one run has words of its own
    "diagnosis/findings/place.py",  # one run has words of its own
}
"""Files whose counts are never one, and why."""


@pytest.mark.parametrize(("count", "words"), [(0, "0 gaps"), (1, "1 gap"), (2, "2 gaps"), (11, "11 gaps")])
def test_one_is_singular(count: int, words: str) -> None:
    assert counted(count, "gap") == words


def plurals(source: str) -> Iterator[int]:
    """Lines of formatted texts in which a value is followed by a noun in the plural."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.JoinedStr):
            for value, text in zip(node.values, node.values[1:], strict=False):
                counts = isinstance(value, ast.FormattedValue) and isinstance(text, ast.Constant)
                if counts and PLURAL.match(str(text.value)):
                    name = ast.unparse(value.value)
                    if not name.rpartition(".")[2].strip("_").isupper():
                        yield node.lineno


def test_that_scan_finds_plurals() -> None:
    assert list(plurals('f"in {n} gaps"')) == [1]
    assert list(plurals("f\"{counted(n, 'gap')} long; {LIMIT} samples at most\"")) == []


def test_no_text_has_a_plural_of_its_own_making() -> None:
    found = {
        file.relative_to(ROOT).as_posix(): lines
        for package in ("tunnel_lab", "tunnel_sim", "identification", "diagnosis")
        for file in (ROOT / package).rglob("*.py")
        if (lines := list(plurals(file.read_text(encoding="utf-8"))))
    }
    assert {file: lines for file, lines in found.items() if file not in TWO_OR_MORE} == {}
