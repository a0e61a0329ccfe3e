"""The oldest versions that ``pyproject.toml`` accepts, as constraints for pip.

``python -m tests.oldest > oldest.txt`` and ``pip install '.[dev]' --constraint oldest.txt`` make an environment of
exactly these versions; pip refuses where two of them exclude each other.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

PROJECT = Path(__file__).parents[1] / "pyproject.toml"


def oldest() -> Iterator[tuple[str, str]]:
    """Requirement and constraint of every package that the project or one of its extras names."""
    project = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    for requirements in (project["dependencies"], *project["optional-dependencies"].values()):
        for requirement in requirements:
            if requirement.startswith(project["name"]):  # extras that another one includes
                continue
            package, _, limits = re.fullmatch(r"([\w.-]+)(\[.*?\])?(.*)", requirement).groups()
            floor = re.search(r"[>=]=([\d.]+)", limits)
            if floor is None:
                raise ValueError(f"{PROJECT}: {requirement!r} names no oldest version; write {package}>=…")
            yield requirement, f"{package}=={floor[1].rstrip('.')}"


if __name__ == "__main__":
    print("\n".join(constraint for _, constraint in oldest()))
