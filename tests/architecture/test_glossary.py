"""The glossary names everything that the packages offer."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

import tunnel_lab
from identification import ALL_ESTIMATORS
from tests.architecture.test_faces import FACES
from tunnel_sim.effects import ALL_EFFECTS

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "glossary.md"
ROWS = re.findall(r"^\|.*\|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
CODE = re.compile(r"`([^`]+)`")
SAID = {name for row in ROWS for name in CODE.findall(row)} | {kind.name for kind in ALL_EFFECTS}


@pytest.mark.parametrize("package", FACES)
def test_every_name_offered_is_explained(package: str) -> None:
    offered = set(importlib.import_module(package).__all__)
    assert offered
    assert offered - SAID == set()


def test_the_laboratory_offers_no_names() -> None:
    assert not hasattr(tunnel_lab, "__all__")


def test_every_estimator_is_explained() -> None:
    assert set(ALL_ESTIMATORS) <= SAID


def test_every_channel_is_explained() -> None:
    assert {kind.channel for kind in ALL_EFFECTS} <= SAID


def test_no_term_is_explained_twice() -> None:
    terms = [row.split("|")[1].strip() for row in ROWS if not row.startswith(("|---", "| term"))]
    assert len(terms) == len(set(terms))
