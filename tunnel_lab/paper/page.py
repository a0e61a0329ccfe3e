"""All parts of the page on the paper, each finished once: an interrupted run continues."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from importlib import resources
from importlib.metadata import version
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from tunnel_lab.paper.section import Section
from tunnel_sim.files.leftovers import clear_leftovers
from tunnel_sim.files.reading import read_json
from tunnel_sim.files.writing import output_folder, write_encoded, write_json
from tunnel_sim.vocabulary.errors import TunnelError

Part = Callable[[Path], Section]
PAGE = "index.html"
_PARTS = "parts"
_PACKAGE = "virtual-wind-tunnel"
_REMEDY = "delete it, and the part is computed again"


def parts() -> dict[str, Part]:
    """The parts by name, in the order of the page."""
    from tunnel_lab.paper import networks, rig

    return {
        "table-1": rig.table_1,
        "table-2": rig.table_2,
        "equations": rig.equations,
        "figure-1": rig.figure_1,
        "figure-2": rig.figure_2,
        "figure-3": networks.figure_3,
        "table-3": networks.table_3,
        "table-4": networks.table_4,
        "figures-4-to-6": networks.figures_4_to_6,
    }


def write_paper(
    folder: Path, names: Sequence[str], *, progress: Callable[[int, int, str], None] = lambda *_: None
) -> tuple[Path, dict[str, Section]]:
    """Compute what is missing, and write the page.

    Args:
        folder: of the page, its pictures and finished parts; made where it does not exist.
        names: parts to compute where they are not finished; finished ones stay in the page.
        progress: called with the number finished, of how many, and the next part's name.

    Returns:
        The page, and its sections by name.

    Raises:
        TunnelError: when the folder cannot be written to, or a kept part is damaged.
    """
    kept = output_folder(output_folder(folder) / _PARTS)
    for place in (folder, kept):
        clear_leftovers(place)
    sections: dict[str, Section] = {}
    for name, part in parts().items():
        path = kept / f"{name}.json"
        section = _finished(path, folder)
        if section is None and name in names:
            progress(len([one for one in names if one in sections]), len(names), name)
            section = part(folder)
            write_json(path, {"version": version(_PACKAGE), "section": asdict(section)})
        if section is not None:
            sections[name] = section
    progress(len(names), len(names), "")
    page = write_encoded(folder / PAGE, lambda stream: stream.write(render(sections).encode()))
    return page, sections


def _finished(path: Path, folder: Path) -> Section | None:
    """A part of this version that is kept with all its pictures."""
    if not path.exists():
        return None
    document = read_json(path, remedy=_REMEDY)
    if document.get("version") != version(_PACKAGE):
        return None
    try:
        section = TypeAdapter(Section).validate_json(json.dumps(document.get("section")))
    except ValidationError as error:
        reason = error.errors()[0]["msg"]
        raise TunnelError(f"is not a part of the page ({reason})", where=str(path), remedy=_REMEDY) from None
    return section if all((folder / picture.file).is_file() for picture in section.pictures) else None


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
