"""All parts of the page on the paper, each finished once: an interrupted run continues."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import resources
from pathlib import Path

from pydantic import ValidationError

from tunnel_lab.paper.section import Section
from tunnel_sim.files.leftovers import clear_leftovers
from tunnel_sim.files.reading import read_json
from tunnel_sim.files.writing import output_folder, write_encoded, write_json
from tunnel_sim.vocabulary.errors import TunnelError

Part = Callable[[Path], Section]
PAGE = "index.html"
_PARTS = "parts"
_REMEDY = "delete it, and the part is computed again"


def parts() -> dict[str, Part]:
    """The parts by name, in the order of the page."""
    from tunnel_lab.paper import network_parts, rig_parts

    return {
        "table-1": rig_parts.table_1,
        "table-2": rig_parts.table_2,
        "equations": rig_parts.equations,
        "figure-1": rig_parts.figure_1,
        "figure-2": rig_parts.figure_2,
        "figure-3": network_parts.figure_3,
        "table-3": network_parts.table_3,
        "table-4": network_parts.table_4,
    }


def write_paper(
    folder: Path, found: Mapping[str, Part], *, progress: Callable[[int, int, str], None] = lambda *_: None
) -> tuple[Path, dict[str, Section]]:
    """Compute what is missing, and write the page.

    Args:
        folder: of the page, its pictures and finished parts; made where it does not exist.
        found: parts by name.
        progress: called with the number finished, of how many, and the next part's name.

    Returns:
        The page, and the sections by name.

    Raises:
        TunnelError: when the folder cannot be written to, or holds a part that is not of this version.
    """
    kept = output_folder(output_folder(folder) / _PARTS)
    for place in (folder, kept):
        clear_leftovers(place)
    sections = {}
    for number, (name, part) in enumerate(found.items()):
        progress(number, len(found), name)
        sections[name] = _section(kept / f"{name}.json", folder, part)
    progress(len(found), len(found), "")
    page = write_encoded(folder / PAGE, lambda stream: stream.write(render(sections).encode()))
    return page, sections


def _section(path: Path, folder: Path, part: Part) -> Section:
    """A part that is kept with its pictures, or computed and kept; the pictures are written first."""
    if path.exists():
        document = read_json(path, remedy=_REMEDY)
        try:
            section = Section.model_validate_json(path.read_bytes())
        except ValidationError as error:
            reason = error.errors()[0]["msg"]
            raise TunnelError(
                f"is not a part of this page ({reason})", where=str(path), remedy=_REMEDY
            ) from None
        if document and all((folder / picture.file).is_file() for picture in section.pictures):
            return section
    section = part(folder)
    write_json(path, section.model_dump(mode="json"))
    return section


def render(sections: Mapping[str, Section]) -> str:
    """The page as HTML; its pictures stand beside it.

    Args:
        sections: by name, in order.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = resources.files("tunnel_lab.paper").joinpath("page.html.j2").read_text("utf-8")
    return environment.from_string(template).render(sections=sections)
