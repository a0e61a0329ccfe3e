"""What a release needs: the recipe, the image and the wheels agree with pyproject.toml."""

from __future__ import annotations

import re
import shlex
import tomllib
from datetime import UTC, date, datetime
from pathlib import Path

import pytest

from tests.architecture.test_landing import unknown
from tunnel_sim.engine.model import BUILT_FOR

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
CITATION = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
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


def test_the_engine_is_the_version_that_the_plugin_is_built_against():
    """An exact version, the same in the building and in the running environment, and in all extras."""
    project = PROJECT["project"]
    named = [*PROJECT["build-system"]["requires"], *project["dependencies"]]
    named += [line for extra in project["optional-dependencies"].values() for line in extra]
    pins = {line.partition("==")[2] for line in named if line.startswith("mujoco")}
    assert pins == {BUILT_FOR} == {requirements("host")["mujoco-python"]}
    assert re.fullmatch(r"\d+\.\d+\.\d+", BUILT_FOR)


def test_the_citation_has_the_version_of_the_project():
    assert f"version: {PROJECT['project']['version']}\n" in CITATION


def test_the_citation_has_the_date_of_a_release_only() -> None:
    """As the changelog: a version that is not released has no date there, and a release has one that has been."""
    version = re.escape(PROJECT["project"]["version"])
    (stated,) = re.findall(rf"^## {version} \((.*)\)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    days = re.findall(r"^date-released: (.*)$", CITATION, re.MULTILINE)
    assert days == ([] if stated == "unreleased" else [stated])
    assert all(date(2025, 1, 1) < date.fromisoformat(day) <= datetime.now(UTC).date() for day in days)


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


def docker_lines(text: str) -> list[list[str]]:
    """The words of every line of a text that runs docker; a comment of the Dockerfile may be one."""
    return [
        shlex.split(line.lstrip("# "))
        for line in text.splitlines()
        if line.lstrip("# ").startswith("docker ")
    ]


def test_the_page_of_the_image_shows_commands_that_exist():
    """Docker itself is not run: its lines are compared with the Dockerfile, the rest with the command line."""
    page = docker_lines((ROOT / "docs" / "how-to" / "docker.md").read_text(encoding="utf-8"))
    dockerfile = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    (build,) = [words for words in page if words[1] == "build"]
    runs = [words for words in page if words[1] == "run" and len(words) > 3]
    image = build[build.index("-t") + 1]
    assert 'ENTRYPOINT ["/opt/tunnel/bin/tunnel"]' in dockerfile
    assert len(runs) >= 4
    for words in runs:
        assert "$PWD:/data" in words
        assert unknown(shlex.join(["tunnel", *words[words.index(image) + 1 :]])) == []
    # The head of the Dockerfile shows some of the page's.
    shown = docker_lines(dockerfile)
    assert build in shown
    assert any(words in runs for words in shown if "bench" in words)


@pytest.mark.parametrize("package", PROJECT["tool"]["scikit-build"]["wheel"]["packages"])
def test_every_package_says_that_it_is_typed(package):
    assert (ROOT / package / "py.typed").is_file()
