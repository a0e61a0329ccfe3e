"""The words of a finding read its own fields and the judgement; only a composition takes the whole diagnosis."""

from __future__ import annotations

import ast

from tests.support.sources import ROOT, parsed

COMPOSITIONS = {"cards", "head", "next_steps", "schema", "sections", "verdict"}
"""They join several findings: the verdict, the head, next steps, cards, sections and the schema."""
FINDINGS = ROOT / "diagnosis" / "findings"


def imported(name: str) -> set[str]:
    """The modules of the room that a module of it imports."""
    return {
        (node.module or "").rpartition(".")[2]
        for node in ast.walk(parsed(FINDINGS / f"{name}.py"))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("diagnosis.findings.")
    }


def test_only_compositions_take_the_whole_diagnosis() -> None:
    names = {path.stem for path in FINDINGS.glob("*.py")}
    assert len(names) > 30
    assert {name for name in names if "whole" in imported(name)} == COMPOSITIONS


def test_no_finding_knows_a_composition() -> None:
    findings = {path.stem for path in FINDINGS.glob("*.py")} - COMPOSITIONS
    assert {name for name in findings if imported(name) & COMPOSITIONS} == set()
