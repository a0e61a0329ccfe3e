"""The layers of decision 0001: contracts on the sources, and what a fresh interpreter really imports."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import grimp
import pytest

from tests.marks import slow

ROOT = Path(__file__).parents[2]
TOOLS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]
PACKAGES = tuple(TOOLS["importlinter"]["root_packages"])
# An editable installation would lead import-linter back to the original sources, wherever it is started.
LINT_IMPORTS = """
import sys
sys.meta_path = [finder for finder in sys.meta_path if "editable" not in type(finder).__module__]
sys.path.insert(0, "")
from importlinter.cli import lint_imports
sys.exit(lint_imports(no_cache=True))
"""

#: What runs the engine or Gymnasium itself and says so; no command of ``tunnel`` but its own loads it.
ENGINE_ROOMS = (
    "diagnosis.patch.",
    "tunnel_lab.envs.",
    "tunnel_lab.show.live",
)


def lint_imports(folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", LINT_IMPORTS], cwd=folder, capture_output=True, text=True, check=False
    )


@cache
def imports() -> grimp.ImportGraph:
    """Which module imports which, of the sources."""
    return grimp.build_graph(*PACKAGES, include_external_packages=True, cache_dir=None)


def imported_by(script: str) -> set[str]:
    """Names of all modules loaded once a script has run in a fresh interpreter."""
    report = "\nimport sys\nprint(*sorted(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", script + report], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return set(done.stdout.splitlines()[-1].split())


def test_every_package_is_checked_and_shipped() -> None:
    found = {path.parent.name for path in ROOT.glob("*/__init__.py")} - {"tests", "benchmarks", "docs"}
    assert found - {"mjcf"} == set(PACKAGES)
    assert set(TOOLS["scikit-build"]["wheel"]["packages"]) == {*PACKAGES, "mjcf"}
    assert set(TOOLS["mypy"]["packages"]) == {*PACKAGES, "docs.studies"}
    (imported,) = re.findall(r"^import (diagnosis.*)$", (ROOT / ".ci" / "run").read_text(), re.MULTILINE)
    assert set(imported.split(", ")) == set(PACKAGES)


def test_the_import_contracts_hold() -> None:
    done = lint_imports(ROOT)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("identification/estimate.py", "import mujoco"),
        slow("identification/estimate.py", "import tunnel_sim.engine.model"),
        slow("tunnel_sim/vocabulary/record.py", "import identification.estimate"),
        slow("identification/estimate.py", "import tunnel_lab.terminal.outputs"),
        slow("tunnel_sim/physics/steps.py", "import tunnel_sim.effects.base"),
        slow("identification/statistics.py", "import identification.signal.frequency"),
        ("diagnosis/result.py", "import diagnosis.compose"),
        ("tunnel_reference/forms.py", "import tunnel_sim.physics.run_settings"),
        slow("tunnel_lab/cli.py", "import tunnel_reference.forms"),
        slow("tunnel_lab/bench/work.py", "import tunnel_lab.cli"),
    ],
)
def test_a_planted_breach_is_caught(tmp_path: Path, module: str, line: str) -> None:
    for package in PACKAGES:
        ignored = shutil.ignore_patterns("__pycache__", "data")
        shutil.copytree(ROOT / package, tmp_path / package, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    target = tmp_path / module
    target.write_text(target.read_text() + f"\n{line}\n")
    done = lint_imports(tmp_path)
    assert done.returncode == 1, done.stdout
    assert "BROKEN" in done.stdout


def test_the_reference_simulator_rests_on_values_alone() -> None:
    graph = imports()
    foreign = {
        name
        for module in graph.modules
        if module.startswith("tunnel_reference")
        for name in graph.find_upstream_modules(module)
        if name.split(".")[0] in {*PACKAGES, "mujoco", "scipy"}
    }
    own = ("tunnel_reference", "tunnel_sim.vocabulary")
    assert {name for name in foreign if not name.startswith(own)} == set()
    assert "tunnel_sim.vocabulary.campaign" in foreign


def test_mujoco_is_imported_only_where_the_engine_runs() -> None:
    graph = imports()
    importers = graph.find_modules_that_directly_import("mujoco")
    assert "tunnel_sim.engine.simulate" in importers
    outside = {name for name in importers if not name.startswith("tunnel_sim.")}
    # Inside functions, in a process of their own where they draw; live, the engine runs in front of the user.
    shown = {f"tunnel_lab.show.{name}" for name in ("film", "live")}
    # A model of one's own, with the causes written into it, is simulated by the engine itself.
    patch = {f"diagnosis.patch.{name}" for name in ("elements", "patched_model", "written_model")}
    assert outside <= shown | patch


def test_reading_and_identifying_a_campaign_never_imports_the_engine() -> None:
    modules = imported_by(
        "from identification import identify\n"
        "from identification.datasets import measured_campaign\n"
        "campaign = measured_campaign('rotary-pendulum')\n"
        "assert identify(campaign, 'output_error').runs\n"
        "assert identify(campaign, 'neural_network', throw=False).runs\n"
    )
    assert "identification" in modules
    assert not modules & {"mujoco", "gymnasium", "torch", "matplotlib"}


def test_no_module_of_the_upper_layers_loads_heavy_packages_at_import() -> None:
    modules = imported_by(
        "import importlib, pkgutil\n"
        "for package in ('diagnosis', 'identification', 'tunnel_lab'):\n"
        "    found = pkgutil.walk_packages(importlib.import_module(package).__path__, package + '.')\n"
        "    for module in found:\n"
        f"        if not module.name.startswith({ENGINE_ROOMS}):\n"
        "            importlib.import_module(module.name)\n"
    )
    assert {"diagnosis", "identification", "tunnel_lab"} <= modules
    assert not modules & {"mujoco", "gymnasium", "torch", "matplotlib", "scipy.signal", "scipy.stats"}


def test_commands_do_not_import_each_other() -> None:
    graph = imports()
    commands = {name for name in graph.modules if name.startswith("tunnel_lab.commands.")}
    assert len(commands) >= 10
    for name in sorted(commands):
        assert graph.find_modules_directly_imported_by(name) & commands == set(), name
