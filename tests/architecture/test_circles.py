"""Imports and includes lead one way: no file depends on itself through others, for type checking neither."""

from __future__ import annotations

import re

import pytest

from tests.support.sources import ROOT, circles, imported, modules

PLUGIN = ROOT / "mjcf" / "plugin"


def test_no_circle_of_imports() -> None:
    graph = {module: frozenset(imported(path)) - {module} for module, path in modules().items()}
    assert sum(map(len, graph.values())) > 2000
    assert circles(graph) == []


def test_no_circle_of_includes() -> None:
    """A source file and its header count as one."""
    stems = {path.stem for path in PLUGIN.glob("*.[ch]")}
    graph = {stem: frozenset(stems & {*included(stem)} - {stem}) for stem in stems}
    assert sum(map(len, graph.values())) > 20
    assert circles(graph) == []


def included(stem: str) -> list[str]:
    """The stems of the files that a source file and its header include."""
    texts = [path.read_text(encoding="utf-8") for path in PLUGIN.glob(f"{stem}.[ch]")]
    return re.findall(r'^#include "(\w+)\.[ch]"', "\n".join(texts), re.MULTILINE)


@pytest.mark.parametrize(
    ("graph", "found"),
    [
        ({"a": "b", "b": "c", "c": ""}, []),
        ({"a": "b", "b": "a", "c": "a"}, [["a", "b"]]),
        ({"a": "b", "b": "c", "c": "a", "d": "e", "e": "d"}, [["a", "b", "c"], ["d", "e"]]),
    ],
)
def test_a_circle_is_found(graph: dict[str, str], found: list[list[str]]) -> None:
    assert circles({node: frozenset(onward) for node, onward in graph.items()}) == found
