"""Sentences of a diagnosis are with its findings: no numerics hold one."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from diagnosis.findings import cautions, place

ROOT = Path(__file__).parents[2] / "diagnosis"
CALLS = ("TunnelError", "Remark")
"""What is said of bad input and in the examination is written where it arises."""
EXCEPTIONS = {
    # what the input's gain is, and effects of a spring whose root moves
    "diagnosable.py": 2,
    # what an effect is like, which is no part of a diagnosis
    "identifiability.py": 2,
    # the description of an effect in an effects file
    "remainder/formula.py": 1,
}
"""Number of sentences by module, which may only become less."""


def text_of(node: ast.AST) -> str:
    """The text of a string or an f-string, its values left out; empty for other nodes."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)
    return ""


def sentences(source: str) -> list[str]:
    """Texts of several words that end in a full stop, but for docstrings and the arguments of `CALLS`."""
    tree, passed = ast.parse(source), set[ast.AST]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            passed.add(node.value)
        elif isinstance(node, ast.JoinedStr):
            passed.update(node.values)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in CALLS:
            passed.update(ast.walk(node))
    texts = (text_of(node).rstrip() for node in ast.walk(tree) if node not in passed)
    return [text for text in texts if text.endswith(".") and " " in text]


def modules() -> list[Path]:
    """The modules outside the rooms that hold sentences.

    Those are the findings, the settings, whose origins are a page, and the nominal models and the rivals, each of
    which brings what is said of it alone in its one file.
    """
    rooms = {"findings", "settings", "model", "rivals"}
    return [path for path in sorted(ROOT.rglob("*.py")) if rooms.isdisjoint(path.relative_to(ROOT).parts)]


def test_no_other_room_holds_a_sentence() -> None:
    found = {path.relative_to(ROOT).as_posix(): sentences(path.read_text("utf-8")) for path in modules()}
    beyond = {name: said for name, said in found.items() if len(said) > EXCEPTIONS.get(name, 0)}
    assert beyond == {}


def test_no_exception_is_left_over() -> None:
    assert {name for name in EXCEPTIONS if not sentences((ROOT / name).read_text("utf-8"))} == set()


def test_the_room_of_findings_holds_them() -> None:
    assert len(modules()) > 60
    assert len(sentences((ROOT / "findings" / "cautions.py").read_text("utf-8"))) > 20


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ('x = f"The gap is {size:.2f} rad."', 1),
        ('x = ("It is", "Read it again. ")', 1),
        ('"""It is a module."""\ndef f():\n    """It does."""\n', 0),
        ('raise TunnelError(f"{x} is bad.", remedy="Mend it.")', 0),
        ('x = ".5", "a.", "held out of the fit"', 0),
    ],
)
def test_a_sentence_is_told_from_other_text(source: str, count: int) -> None:
    assert len(sentences(source)) == count


def test_every_kind_of_fact_has_a_sentence_and_every_sentence_a_fact() -> None:
    known = {
        *cautions.CAUTIONS, *cautions.NOISE, *cautions.REMARKS, *cautions.PATCH, *place.REASONS,
    }  # fmt: skip
    used, texts = set(), set()
    told = [path for path in ROOT.rglob("*.py") if "Fact(" in path.read_text("utf-8") or path in modules()]
    for path in told:
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            texts.add(text_of(node))
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Fact":
                kind = node.args[0]
                used |= {kind.value} if isinstance(kind, ast.Constant) else set()
    assert len(used) > 40
    assert used <= known
    assert known <= texts  # and no sentence waits for a fact that nobody finds
