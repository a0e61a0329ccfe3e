"""Chooses the tests of a mutant: those that ran its line, those of its module, those that ran its file."""

from __future__ import annotations

import ast
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

from coverage import CoverageData

from tests.mutation.draw import PACKAGES, Mutant

READS_SOURCES = "tests/architecture/test_values.py"
"""A test of every class that reads the source as text, which no coverage shows."""


class Chooser:
    """Coverage by test and the tests' durations of one or more runs of the suite.

    Args:
        root: of the project.
        work: folder with ``coverage`` and ``*.xml`` as `tests.mutation` left them.
        budget: of the tests of one mutant in each round, seconds as recorded.
    """

    def __init__(self, root: Path, work: Path, budget: float) -> None:
        self._root, self._budget = root, budget
        self._data = CoverageData(str(work / "coverage"))
        self._data.read()
        self._seconds = _durations(work)
        self._by_file: dict[str, list[str]] = defaultdict(list)
        for path in self._data.measured_files():
            for name in {n for names in self._data.contexts_by_lineno(path).values() for n in names if n}:
                self._by_file[name.partition("::")[0]].append(name.rpartition("|")[0])

    def rounds(self, mutant: Mutant) -> tuple[list[str], list[str], list[str]]:
        """Tests that ran the statement, test files that import the module, other tests that ran the file."""
        lines = self._data.contexts_by_lineno(mutant.path)
        own = _statement((self._root / mutant.path).read_text("utf-8"), mutant.span[0][0])
        first = self._tests(name for line in own for name in lines.get(line, ()))
        whole = self._tests(name for names in lines.values() for name in names)
        if not whole:
            whole = self._tests(self._importers(mutant.path))
        head = self._cheapest(first)
        return head, self._importing(mutant.path, set(head)), self._cheapest(whole - set(head))

    def _tests(self, contexts: Iterable[str]) -> set[str]:
        """Tests of some contexts; what a fixture ran belongs to every test of its file."""
        found: set[str] = set()
        for context in contexts:
            name, _, phase = context.rpartition("|")
            if phase == "run":
                found.add(name)
            elif name:
                found.update(self._by_file[name.partition("::")[0]])
        return {name for name in found if name in self._seconds}

    def _importing(self, path: str, done: set[str]) -> list[str]:
        """Tests of the files that import a module; of a file without a record all, unseen.

        Also those that run no line of the project: what they test may be made where the file is imported.
        """
        files = _importing_tests(self._root, path)
        known = {name for name in self._seconds if name.partition("::")[0] in files}
        seen = {name.partition("::")[0] for name in known}
        unseen = (file for file in files if file not in seen)
        return [*unseen, *self._cheapest(known - done), READS_SOURCES]

    def _importers(self, path: str) -> Iterable[str]:
        """Contexts of the modules that import a module none of whose lines ran inside a test."""
        for other in (p for package in PACKAGES for p in (self._root / package).rglob("*.py")):
            if _imports(other, path):
                lines = self._data.contexts_by_lineno(str(other.relative_to(self._root)))
                yield from (context for names in lines.values() for context in names)

    def _cheapest(self, tests: set[str]) -> list[str]:
        """Tests within the budget, those of one file together, the cheapest file first."""
        chosen, spent = [], 0.0
        for name in sorted(tests, key=lambda test: (self._seconds[test], test)):
            spent += self._seconds[name]
            if chosen and spent > self._budget:
                break
            chosen.append(name)
        cost: dict[str, float] = defaultdict(float)
        for name in chosen:
            cost[name.partition("::")[0]] += self._seconds[name]
        return sorted(chosen, key=lambda test: (cost[test.partition("::")[0]], test))


def _imports(file: Path, path: str) -> bool:
    """Whether a file names a module, in full or as a part of its package."""
    dotted = path.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
    parent, _, name = dotted.rpartition(".")
    text = file.read_text("utf-8")
    return dotted in text or (f"from {parent} import" in text and name in text)


def _importing_tests(root: Path, path: str) -> list[str]:
    """Test files that import a module."""
    files = sorted((root / "tests").rglob("test_*.py"), key=lambda file: ("unit" not in file.parts, file))
    return [str(file.relative_to(root)) for file in files if _imports(file, path)]


def _statement(text: str, line: int) -> range:
    """Lines of the innermost statement at a line; of a compound one its head only."""
    found = range(line, line + 1)
    for node in ast.walk(ast.parse(text)):  # outer statements come before those inside them
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or node.lineno):
            body = getattr(node, "body", None)
            end = body[0].lineno - 1 if body else node.end_lineno or node.lineno
            if line <= max(end, node.lineno):
                found = range(node.lineno, max(end, node.lineno) + 1)
    return found


def _durations(work: Path) -> dict[str, float]:
    """Seconds by test of those that passed; the latest report of a file tells which tests it has."""
    by_file: dict[str, dict[str, float]] = {}
    for report in sorted(work.glob("*.xml"), key=lambda path: (len(path.name), path.name)):
        found: dict[str, dict[str, float]] = defaultdict(dict)
        for case in ET.parse(report).getroot().iter("testcase"):
            path = str(case.get("classname")).replace(".", "/") + ".py"
            if not len(case):
                found[path][f"{path}::{case.get('name')}"] = float(case.get("time") or 0.0)
        by_file |= found
    return {name: seconds for tests in by_file.values() for name, seconds in tests.items()}
