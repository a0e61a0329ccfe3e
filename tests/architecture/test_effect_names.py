"""What is said of an effect is said in its own file: no other code is steered by an effect's name."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from tests.architecture.test_layers import PACKAGES
from tunnel_sim.effects import ALL_EFFECTS

ROOT = Path(__file__).parents[2]
NAMES = {kind.name for kind in ALL_EFFECTS}
CLASSES = {kind.__name__ for kind in ALL_EFFECTS}
#: The effects themselves, the moment law, some of whose terms bear the same names, and the independent simulator,
#: which has forms of its own for them.
HOMES = (ROOT / "tunnel_sim" / "effects", ROOT / "tunnel_sim" / "physics", ROOT / "tunnel_reference")
FILES = [
    path
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
    if not any(path.is_relative_to(home) for home in HOMES)
]


def names_in(source: str) -> list[str]:
    """String constants that are an effect's name or one of its parameters, and imports of an effect's class."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            found += [node.value] if node.value.split(".")[0] in NAMES else []
        if isinstance(node, ast.ImportFrom) and node.module:
            found += [alias.name for alias in node.names if alias.name in CLASSES]
    return found


def test_no_effect_is_named_outside_its_home() -> None:
    assert len(FILES) > 100  # the walk walks
    texts = {path.relative_to(ROOT): path.read_text(encoding="utf-8") for path in FILES}
    mentioned = re.compile("|".join(NAMES | CLASSES))  # most files are not worth parsing
    found = {path: names_in(text) for path, text in texts.items() if mentioned.search(text)}
    assert found
    assert {path: names for path, names in found.items() if names} == {}


@pytest.mark.parametrize(
    "source",
    [
        'if name == "mains_hum": pass',
        'fit.value("unsteady_aero_lag.lag")',
        "from tunnel_sim.effects.sensor import MainsHum",
    ],
)
def test_a_name_would_be_noticed(source: str) -> None:
    assert names_in(source)


def test_examples_in_messages_are_no_names() -> None:
    assert names_in('remedy = "write --effect coulomb_friction:friction_moment=0.004"') == []
