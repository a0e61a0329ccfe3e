"""The page on the paper: its sections, each computed once; an interrupted run can be continued."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import resources
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Literal

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from identification.show.quantity import Quantity
from tunnel_sim.files.reading import read_json
from tunnel_sim.files.writing import clear_leftovers, output_folder, write_encoded, write_json
from tunnel_sim.vocabulary.errors import TunnelError

PAGE = "index.html"
_PARTS = "parts"
_PACKAGE = "virtual-wind-tunnel"
_REMEDY = "delete it, and the part is computed again"
_STRICT = ConfigDict(extra="forbid")
Outcome = Literal["reproduced", "in part", "not reproducible", "corrected"]


@dataclass(frozen=True)
class PaperPicture:
    """A PNG in the page's folder, for figures with a PDF beside it, and its caption."""

    __pydantic_config__ = _STRICT

    file: Annotated[str, Field(pattern=r"^[a-z0-9-]+\.png$")]
    caption: str


@dataclass(frozen=True)
class PaperSection:
    """A table or figure of the paper and this project's result: each in one line."""

    __pydantic_config__ = _STRICT

    title: str
    about: str
    theirs: str
    ours: str
    outcome: Outcome
    words: tuple[str, ...]
    headings: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    pictures: tuple[PaperPicture, ...] = ()


def signed(value: float, digits: int) -> str:
    """A number with its sign, except zero.

    Args:
        value: value in any unit.
        digits: number of digits after the point.
    """
    rounded = round(value, digits)
    return f"{rounded:+.{digits}f}".replace("-", "−") if rounded else f"{0.0:.{digits}f}"


def scaled(quantity: Quantity | None, factor: float) -> Quantity | None:
    """An estimate in another unit.

    Args:
        factor: the old unit in the new unit.
    """
    return None if quantity is None else Quantity(factor * quantity.value, factor * quantity.known_std, "")


Part = Callable[[Path], PaperSection]
"""Computes a part, with its pictures in a folder."""


def write_paper(
    folder: Path,
    parts: Mapping[str, Part],
    names: Sequence[str],
    *,
    progress: Callable[[int, int, str], None] = lambda *_: None,
) -> tuple[Path, dict[str, PaperSection]]:
    """Compute the missing parts, and write the page.

    Args:
        folder: folder of the page, its pictures and finished parts; made if it does not exist.
        parts: all parts by name, in the order of the page.
        names: parts to compute unless finished; finished parts remain in the page.
        progress: function called with the number finished, the total, and the next part's name.

    Raises:
        TunnelError: when the folder cannot be written to, or a finished part is damaged.
    """
    kept = output_folder(output_folder(folder) / _PARTS)
    for place in (folder, kept):
        clear_leftovers(place)
    sections: dict[str, PaperSection] = {}
    for name, part in parts.items():
        path = kept / f"{name}.json"
        section = None
        document = read_json(path, remedy=_REMEDY) if path.exists() else {}
        if document.get("version") == version(_PACKAGE):
            try:
                section = TypeAdapter(PaperSection).validate_json(json.dumps(document.get("section")))
            except ValidationError as error:
                what = f"is not a part of the page ({error.errors()[0]['msg']})"
                raise TunnelError(what, where=str(path), remedy=_REMEDY) from None
            if not all((folder / picture.file).is_file() for picture in section.pictures):
                section = None
        if section is None and name in names:
            progress(len([finished for finished in names if finished in sections]), len(names), name)
            section = part(folder)
            write_json(path, {"version": version(_PACKAGE), "section": asdict(section)})
        if section is not None:
            sections[name] = section
    progress(len(names), len(names), "")
    page = write_encoded(folder / PAGE, lambda stream: stream.write(render(sections).encode()))
    return page, sections


def render(sections: Mapping[str, PaperSection]) -> str:
    """The page as HTML, with its pictures in the same folder."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = resources.files("tunnel_lab.paper").joinpath("page.html.j2").read_text("utf-8")
    return environment.from_string(template).render(sections=sections)
