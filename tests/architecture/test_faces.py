"""The packages' faces: what they offer, that it loads on first use, and how little importing them costs."""

from __future__ import annotations

import ast
import importlib
import inspect

import pytest

from tests.architecture.test_layers import imported_by

FACES = ("tunnel_sim", "identification", "diagnosis")


def typed_names(package: str) -> set[str]:
    """Names that the type checker sees: those imported under ``if TYPE_CHECKING``."""
    tree = ast.parse(inspect.getsource(importlib.import_module(package)))
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    return {alias.name for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names}


@pytest.mark.parametrize("package", FACES)
def test_what_is_offered_is_typed_and_loads(package: str) -> None:
    face = importlib.import_module(package)
    assert set(face.__all__) == typed_names(package)
    for name in face.__all__:
        offered = getattr(face, name)
        assert getattr(offered, "__name__", name) == name
    assert set(face.__all__) <= set(dir(face))


@pytest.mark.parametrize("package", FACES)
def test_what_is_not_offered_is_refused(package: str) -> None:
    face = importlib.import_module(package)
    with pytest.raises(AttributeError, match=f"'{package}' has no attribute 'identifies'"):
        _ = face.identifies


def test_importing_the_packages_loads_nothing_heavy() -> None:
    modules = imported_by(f"import {', '.join(FACES)}")
    assert set(FACES) <= modules
    assert not modules & {
        "mujoco",
        "scipy",
        "numpy",
        "polars",
        "pydantic",
        "gymnasium",
        "torch",
        "matplotlib",
    }


def test_reading_a_campaign_by_the_face_loads_no_engine() -> None:
    modules = imported_by("from tunnel_sim import Campaign, TunnelError, load_plan, read_campaign")
    assert "polars" in modules
    assert not modules & {"mujoco", "scipy"}
