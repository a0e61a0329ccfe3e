"""Draws mutants at random: a place in the source first, then one of cosmic-ray's replacements of it."""

from __future__ import annotations

import ast
import io
import keyword
import random
import re
import tokenize
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from cosmic_ray.ast import ast_nodes, get_ast_from_path
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

PACKAGES = ("tunnel_sim", "identification", "diagnosis", "tunnel_lab")
_EVALUATES_ANNOTATIONS = re.compile(r"^\s*(?:from|import) (?:typer|pydantic)\b", re.MULTILINE)
_LAZY = "from __future__ import annotations"
_INERT = {"name", "newline", "string", "endmarker", "fstring_string", "fstring_start", "fstring_end"}
_INERT_MARKS = set("()[]{},:.;@=") | {"->", "..."}
_BITS = {"RShift", "LShift", "BitOr", "BitAnd", "BitXor"}
_WORDS = {"and", "or", "not", "is", "if", "while", "for", "True", "False", "break", "continue", "except"}
Span = tuple[tuple[int, int], tuple[int, int]]


@dataclass(frozen=True)
class Mutant:
    """One change of one place.

    Args:
        path: of the module, from the root of the project.
        operator: cosmic-ray's name of it.
        occurrence: which of the operator's places in the module.
        span: first and last line and column of the place.
    """

    path: str
    operator: str
    occurrence: int
    span: Span

    def source(self, text: str) -> str | None:
        """The module with the change, None where it cannot be made."""
        try:
            changed: str | None = mutate_code(text, get_operator(self.operator)(), self.occurrence)
        except AttributeError:  # cosmic-ray cannot replace an exception with dots in its name
            return None
        return changed

    def words(self, root: Path) -> str:
        """File, line and the line before and after."""
        text = (root / self.path).read_text("utf-8")
        changed = self.source(text) or ""
        pairs = zip(text.splitlines(), changed.splitlines(), strict=False)
        line, (old, new) = next(
            ((n, pair) for n, pair in enumerate(pairs, 1) if pair[0] != pair[1]), (self.span[0][0], ("", ""))
        )
        return f"{self.path}:{line}: {old.strip()}  ->  {new.strip()}"


def draw(root: Path, count: int, seed: int, under: Sequence[str] = PACKAGES) -> list[Mutant]:
    """Mutants that compile and that no rule below calls equivalent.

    Args:
        root: of the project.
        count: how many.
        seed: of the draw.
        under: folders whose modules take part.

    Returns:
        Mutants in the order drawn; no place twice.
    """
    rng = random.Random(seed)
    paths = [p for name in under for p in sorted((root / name).rglob("*.py"))]
    weights = [_weight(path) for path in paths]
    found: dict[tuple[Path, Span], Mutant] = {}
    while len(found) < count:
        path = rng.choices(paths, weights)[0]
        places = _places(path, root)
        if not places:
            continue
        span = rng.choice(sorted(places))
        mutant = rng.choice(places[span])
        if (path, span) not in found and _compiles(mutant, path):
            found[path, span] = mutant
    return list(found.values())


def _weight(path: Path) -> int:
    """Operators, numbers and words in the file that an operator could change: a file's chance."""
    tokens = tokenize.generate_tokens(io.StringIO(path.read_text("utf-8")).readline)
    return sum(
        token.type == tokenize.NUMBER
        or (token.type == tokenize.OP and token.string not in _INERT_MARKS)
        or (keyword.iskeyword(token.string) and token.string in _WORDS)
        for token in tokens
    )


@cache
def _places(path: Path, root: Path) -> dict[Span, list[Mutant]]:
    """Every mutant of a module by its place."""
    own = [node for node in ast_nodes(get_ast_from_path(path)) if _can_change(node)]
    dead = _equivalent_spans(path.read_text("utf-8"))
    found: dict[Span, list[Mutant]] = defaultdict(list)
    for name, operator in _operators():
        spans = (span for node in own for span in operator.mutation_positions(node))
        for occurrence, span in enumerate(spans):
            if not any(start <= span[0] and span[1] <= end for start, end in dead):
                found[span].append(Mutant(str(path.relative_to(root)), name, occurrence, span))
    return dict(found)


def _can_change(node: object) -> bool:
    kind = getattr(node, "type", "")
    return kind not in _INERT and not (kind == "operator" and getattr(node, "value", "") in _INERT_MARKS)


def _operators() -> Iterator[tuple[str, object]]:
    """cosmic-ray's operators without arguments; no bit operator where arithmetic stood: floats refuse those."""
    for name in operator_names():
        pair = re.search(r"ReplaceBinaryOperator_(\w+?)_(\w+)$", name)
        if pair and (pair[1] in _BITS) != (pair[2] in _BITS):
            continue
        kind = get_operator(name)
        if not kind.arguments():
            yield name, kind()


def _equivalent_spans(text: str) -> list[Span]:
    """Where a change cannot matter: annotations nothing evaluates, and the test of ``TYPE_CHECKING``.

    Annotations count as evaluated in modules that import typer or pydantic, or that lack the future import.
    """
    nodes: list[ast.expr] = []
    lazy = _LAZY in text and not _EVALUATES_ANNOTATIONS.search(text)
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            nodes.append(node.test)
        elif lazy and isinstance(node, ast.arg | ast.AnnAssign) and node.annotation:
            nodes.append(node.annotation)
        elif lazy and isinstance(node, ast.FunctionDef) and node.returns:
            nodes.append(node.returns)
    return [
        ((n.lineno, n.col_offset), (n.end_lineno or n.lineno, n.end_col_offset or n.col_offset))
        for n in nodes
    ]


def _compiles(mutant: Mutant, path: Path) -> bool:
    changed = mutant.source(path.read_text("utf-8"))
    if changed is None:
        return False
    try:
        compile(changed, str(path), "exec")
    except (SyntaxError, ValueError):
        return False
    return True
