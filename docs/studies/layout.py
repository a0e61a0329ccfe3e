"""Draw the layout of the code: the rooms of every package, in the order of the import contracts.

    python -m docs.studies.layout

writes docs/images/layout.svg. Rooms and order come from the contracts in pyproject.toml, texts from the docstrings
of the rooms; a test compares the picture with them.
"""

from __future__ import annotations

import ast
import tomllib
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill

from identification.show.style import COLOURS, figure, styled

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "docs" / "images" / "layout.svg"
PACKAGES = {
    "tunnel_lab": "commands, report, bench, experiments",
    "diagnosis": "where the model departs, why, and the share explained",
    "identification": "the coefficients, with their uncertainty",
    "tunnel_sim": "the rig, its effects, its records",
}
"""From the highest layer to the lowest; a package imports only from those below it."""
WAYS = {
    "diagnosis": "the way of an answer: rooms up to patch → compose.py → findings, a file each → result.py"
}
"""By package, the way of its result through rooms and modules, if the order of imports does not show it."""


@dataclass(frozen=True)
class Room:
    """A folder of a package, or a module at its top.

    Args:
        layer: its place in the package's contract; a room imports only from rooms with a greater number.
        summary: first line of its docstring.
    """

    package: str
    name: str
    layer: int
    summary: str

    @property
    def is_folder(self) -> bool:
        """Whether the room contains modules."""
        return (ROOT / self.package / self.name).is_dir()


def rooms() -> list[Room]:
    """All rooms named in the import contracts of the packages drawn."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = {c["containers"][0]: c["layers"] for c in contracts if "containers" in c}
    found = []
    for package in PACKAGES:
        for depth, together in enumerate(layers[package]):
            for name in together.split(" | "):
                folder = ROOT / package / name
                file = folder / "__init__.py" if folder.is_dir() else folder.with_suffix(".py")
                words = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
                found.append(Room(package, name, depth, words.splitlines()[0].replace("`", "")))
    return found


@styled
def draw(path: Path) -> None:
    """Draw the rooms as an SVG, folders as boxes, the lowest on the left."""
    import matplotlib as mpl

    fig = figure(11.0, 6.2)
    ax = fig.add_axes((0.01, 0.01, 0.98, 0.98))
    ax.set(xlim=(0, 100), ylim=(0, 100))
    ax.axis("off")
    fig.set_layout_engine("none")
    found = rooms()
    for row, (package, summary) in enumerate(PACKAGES.items()):
        top, colour = 98.0 - 25.0 * row, COLOURS[row]
        ax.text(0.5, top, package, weight="bold", va="top", color=colour, fontsize=11)
        ax.text(17.0, top - 0.3, summary, va="top", fontsize=9)
        ax.text(97.6, top - 0.6, WAYS.get(package, ""), ha="right", va="top", fontsize=7)
        folders = [room for room in found if room.package == package and room.is_folder][::-1]
        others = [room.name for room in found if room.package == package and not room.is_folder]
        width = 97.0 / len(folders)
        for column, room in enumerate(folders):
            left = 1.0 + width * column
            box = mpl.patches.FancyBboxPatch(
                (left + 0.4, top - 19.6), width - 0.8, 15.2, "round,pad=0,rounding_size=1",
                facecolor=colour, alpha=0.15, edgecolor=colour,
            )  # fmt: skip
            ax.add_patch(box)
            middle = left + width / 2.0
            ax.text(middle, top - 6.4, room.name, ha="center", va="center", fontsize=9)
            words = fill(room.summary, int(1.85 * width))
            ax.text(middle, top - 8.4, words, ha="center", va="top", fontsize=6, linespacing=1.1)
        listed = "modules beside the rooms, from low to high: " + ", ".join(others[::-1])
        ax.text(1.5, top - 21.4, listed, va="center", fontsize=7)
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "layout"}):
        fig.savefig(path, format="svg", metadata={"Date": None})


if __name__ == "__main__":
    draw(PICTURE)
