"""What a release needs: the recipe, the image and the wheels agree with pyproject.toml."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
CONDA = {"torch": "pytorch", "matplotlib": "matplotlib-base", "mujoco": "mujoco-python"}
"""Packages that conda-forge calls otherwise."""


def requirements(section: str) -> dict[str, str]:
    """Packages of a section of the recipe, and their versions."""
    text = (ROOT / "recipe" / "meta.yaml").read_text()
    block = re.search(rf"^  {section}:\n((?:    - .*\n)+)", text, re.MULTILINE)
    assert block is not None
    lines = [line.strip().removeprefix("- ").split(maxsplit=1) for line in block[1].splitlines()]
    return {name: "".join(version) for name, *version in lines}


def test_the_recipe_has_the_dependencies_and_the_version_of_the_project():
    wanted = {}
    for line in PROJECT["project"]["dependencies"]:
        name, version = re.fullmatch(r"([\w-]+)(.*)", line).groups()
        wanted[CONDA.get(name, name)] = version.removeprefix("==")
    wanted["python"] = PROJECT["project"]["requires-python"]
    assert requirements("run") == wanted
    assert f'version = "{PROJECT["project"]["version"]}"' in (ROOT / "recipe" / "meta.yaml").read_text()


def test_the_citation_has_the_version_of_the_project():
    assert f"version: {PROJECT['project']['version']}\n" in (ROOT / "CITATION.cff").read_text()


def test_the_image_runs_without_root_and_installs_extras_that_exist():
    lines = (ROOT / "Dockerfile").read_text().splitlines()
    last = lines[max(i for i, line in enumerate(lines) if line.startswith("FROM ")) :]
    users = [line.split()[1] for line in last if line.startswith("USER ")]
    assert users
    assert users[-1] not in ("root", "0")
    assert not any(line.startswith("RUN apt-get") for line in last), "the final image needs no compiler"
    extras = re.search(r"/source\[([a-z,]+)\]", "\n".join(lines))
    assert extras is not None
    assert set(extras[1].split(",")) <= set(PROJECT["project"]["optional-dependencies"])


@pytest.mark.parametrize("package", PROJECT["tool"]["scikit-build"]["wheel"]["packages"])
def test_every_package_says_that_it_is_typed(package):
    assert (ROOT / package / "py.typed").is_file()
