"""The source files of the project: their modules, their parsed text and their imports."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCES = (
    "tunnel_sim",
    "tunnel_reference",
    "identification",
    "diagnosis",
    "tunnel_lab",
    "benchmarks",
    "mjcf",
)
"""The folders of the sources; tests and pages are not among them."""


@cache
def modules() -> Mapping[str, Path]:
    """Every Python file of the sources, by the name of its module."""
    return {_name(path): path for folder in SOURCES for path in sorted((ROOT / folder).rglob("*.py"))}


@cache
def parsed(path: Path) -> ast.Module:
    """The syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


def _name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(path: Path) -> Iterator[str]:
    """The modules of the sources that a file imports anywhere, within functions and for type checking, too."""
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in modules())
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                found = name if name in modules() else str(node.module)
                if found in modules():
                    yield found


def circles(graph: Mapping[str, frozenset[str]]) -> list[list[str]]:
    """The groups of nodes that lead back to themselves, sorted; a node that leads to itself alone is not one."""
    # a node that leads to no other node is on no circle; few nodes are left once these are gone
    while ends := {node for node, onward in graph.items() if not onward & graph.keys()}:
        graph = {node: onward - ends for node, onward in graph.items() if node not in ends}

    def reached(start: str) -> frozenset[str]:
        seen, ahead = set[str](), [*graph[start]]
        while ahead:
            node = ahead.pop()
            if node not in seen:
                seen.add(node)
                ahead += graph[node]
        return frozenset(seen)

    onward = {node: reached(node) for node in graph}
    groups = {
        tuple(sorted({node, *(other for other in onward[node] if node in onward[other])})) for node in graph
    }
    return sorted(list(group) for group in groups if len(group) > 1)
