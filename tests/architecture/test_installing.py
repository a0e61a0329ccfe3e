"""What pages and remedies say about installing: commands that work in a clone, all from one function."""

from __future__ import annotations

import re
import subprocess
import tomllib
from pathlib import Path

import pytest

from tunnel_sim.vocabulary.errors import EXTRAS, installing

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
LISTED = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
FILES = [ROOT / name for name in LISTED.stdout.splitlines()] or [
    path for kind in ("*.md", "*.py", "*.ipynb") for path in ROOT.rglob(kind) if ".venv" not in path.parts
]
TEXTS = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for path in FILES
    if path.suffix in (".md", ".py", ".ipynb", ".j2", ".js", ".toml")
    and path.is_file()
    and path != Path(__file__)
}
PAGES = {name: text for name, text in TEXTS.items() if name.endswith((".md", ".ipynb"))}


def test_no_text_installs_the_project_from_an_index() -> None:
    by_name = re.compile(rf"pip\s+install\s+(-\S+\s+)*['\"]?{PROJECT['name']}")
    assert [name for name, text in TEXTS.items() if by_name.search(text)] == []


def test_every_extra_in_a_text_exists() -> None:
    named = re.compile(r"pip install '?\.\\?\[([a-z,]+)\]")
    found = {
        (name, extra)
        for name, text in TEXTS.items()
        for words in named.findall(text)
        for extra in words.split(",")
    }
    assert len(found) > 10
    assert {(name, extra) for name, extra in found if extra not in PROJECT["optional-dependencies"]} == set()


def test_remedies_have_the_command_from_one_function() -> None:
    written = re.compile(r"(remedy|raise|what|lacks)\b.*pip install '\.\[")
    assert [name for name, text in TEXTS.items() if name.endswith(".py") and written.search(text)] == []


@pytest.mark.parametrize("extra", sorted(EXTRAS))
def test_the_remedy_is_what_the_pages_say(extra: str) -> None:
    command = installing(extra).split(" in ")[0]
    assert command == f".venv/bin/pip install '.[{extra}]'"
    assert "clone" in installing(extra)


def test_pages_name_the_pip_of_the_virtual_environment() -> None:
    """A bare pip would install into another Python than the one whose ``tunnel`` they go on with."""
    bare = re.compile(r"(?<![\w/])pip install '?\.(?:\[|\s|$)")
    own = {name for name, text in PAGES.items() if bare.search(text)}
    # The benchmark's README makes environments of its own.
    assert own <= {"benchmarks/README.md"}
