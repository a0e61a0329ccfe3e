"""An environment is made by its name alone, in a process that has imported nothing of this program."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[4]
PAGES = ROOT / "docs" / "reference" / "envs"


def printed(code: str, *paths: Path, first: str = "import gymnasium") -> str:
    start = f"import sys; sys.path[:0] = {[str(path) for path in paths]!r}\n{first}\n{code}"
    done = subprocess.run([sys.executable, "-c", start], capture_output=True, text=True, check=False)
    return done.stdout + done.stderr.strip().rpartition("\n")[2]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["FreeDecay-v0", "Campaign-v0"])
def test_the_name_with_its_module_needs_no_import(name: str) -> None:
    code = f'env = gymnasium.make("tunnel_sim.envs:tunnel_sim/{name}")\nprint(env.spec.id, len(env.reset(seed=1)))'
    assert printed(code) == f"tunnel_sim/{name} 2\n"
    many = f'envs = gymnasium.make_vec("tunnel_sim.envs:tunnel_sim/{name}", num_envs=2)\nprint(envs.num_envs)'
    assert printed(many) == "2\n"


def test_gymnasium_reads_no_entry_points(tmp_path: Path) -> None:
    """Where a later version does again, an entry point makes the name alone work: then declare it."""
    about = tmp_path / "planted-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: planted\nVersion: 1\n")
    (about / "entry_points.txt").write_text(
        "[gymnasium.envs]\ntunnel_sim = tunnel_sim.envs:register_environments\n"
    )
    found = "from importlib.metadata import entry_points\nprint(len(entry_points(group='gymnasium.envs')))\n"
    said = printed(found + 'gymnasium.make("tunnel_sim/FreeDecay-v0")', tmp_path)
    assert said.startswith("1\n")
    assert "Namespace tunnel_sim not found" in said


@pytest.mark.parametrize("order", ["import tunnel_sim, gymnasium", "import gymnasium, tunnel_sim"])
def test_the_name_alone_works_beside_the_package_in_any_order(order: str) -> None:
    code = f'{order}\nprint(gymnasium.spec("tunnel_sim/Campaign-v0").id)'
    assert printed(code, ROOT, first="") == "tunnel_sim/Campaign-v0\n"
    assert printed("import tunnel_sim\nprint('gymnasium' in sys.modules)", ROOT, first="") == "False\n"


@pytest.mark.parametrize("page", ["free-decay", "campaign"])
def test_the_pages_make_an_environment_by_a_name_that_works_alone(page: str) -> None:
    """The name without its module needs an import before it."""
    text = (PAGES / f"{page}.md").read_text(encoding="utf-8")
    (row,) = (line for line in text.splitlines() if line.startswith("| made with |"))
    names = re.findall(r'make(?:_vec)?\("([^"]*)"', row)
    assert names
    assert all(name.startswith("tunnel_sim.envs:tunnel_sim/") for name in names)
