"""Gymnasium is imported by the environments alone, and the environments are found without MuJoCo."""

from __future__ import annotations

import grimp

from tests.architecture.test_layers import PACKAGES, imported_by

HOMES = ("tunnel_sim.envs", "tunnel_lab.envs")


def test_only_the_environments_import_gymnasium() -> None:
    graph = grimp.build_graph(*PACKAGES, include_external_packages=True, cache_dir=None)
    importers = graph.find_modules_that_directly_import("gymnasium")
    assert "tunnel_sim.envs.free_decay" in importers
    assert {name for name in importers if not name.startswith(HOMES)} == set()


def test_simulating_never_imports_gymnasium() -> None:
    modules = imported_by("import tunnel_sim, tunnel_sim.engine.simulate, tunnel_sim.engine.virtual_campaign")
    assert "mujoco" in modules
    assert "gymnasium" not in modules


def test_registering_imports_no_engine() -> None:
    modules = imported_by("import tunnel_sim.envs")
    assert "gymnasium" in modules
    assert not modules & {"mujoco", "scipy", "torch", "matplotlib"}
