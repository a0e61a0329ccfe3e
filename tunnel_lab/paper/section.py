"""A section of the page on the paper: words, a table and pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from identification.estimate import Quantity

_STRICT = ConfigDict(extra="forbid")
Outcome = Literal["reproduced", "in part", "not reproducible", "corrected"]


@dataclass(frozen=True)
class Picture:
    """A picture of the page.

    Args:
        file: its name in the page's folder, a PNG; a PDF of that name stands beside figures.
        caption: what it shows.
    """

    __pydantic_config__ = _STRICT

    file: Annotated[str, Field(pattern=r"^[a-z0-9-]+\.png$")]
    caption: str


@dataclass(frozen=True)
class Section:
    """What one table or figure of the paper says, and what is found here.

    Args:
        title: such as ``Table II``.
        about: what it is of.
        theirs: the paper's result in a line.
        ours: ours in a line.
        outcome: whether the paper's result is found here too.
        words: paragraphs.
        headings: of the table's columns; none where there is no table.
        rows: cells as text.
        pictures: below the table.
    """

    __pydantic_config__ = _STRICT

    title: str
    about: str
    theirs: str
    ours: str
    outcome: Outcome
    words: tuple[str, ...]
    headings: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    pictures: tuple[Picture, ...] = ()


def signed(value: float, digits: int) -> str:
    """A number with its sign; zero has none.

    Args:
        value: in any unit.
        digits: after the point.
    """
    rounded = round(value, digits)
    return f"{rounded:+.{digits}f}".replace("-", "−") if rounded else f"{0.0:.{digits}f}"


def scaled(quantity: Quantity | None, factor: float) -> Quantity | None:
    """An estimate in another unit.

    Args:
        factor: the old unit in new ones.
    """
    return None if quantity is None else Quantity(factor * quantity.value, factor * quantity.std, "")
