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
