"""Reads numbers as a person would: from text, with the half unit of the last digit that is shown."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from identification.show.blocks import Block, Card, Detail, TextTable

_NUMBER = re.compile(r"(?<![\w.])[−-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
_SCALED = re.compile(r"\(([−-]?[\d.]+) ± ([\d.]+)\)e([+-]\d+)")
_TIMES = re.compile(r"(?<=\d) × 10([⁻⁰¹²³⁴-⁹]+)")
_DIGITS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_POWER_OF_TEN = re.compile(r"× 10[⁻⁰¹²³⁴-⁹]+|\[10[⁻⁰¹²³⁴-⁹]+")


@dataclass(frozen=True)
class Shown:
    """A number as it stands in a text.

    Args:
        value: what the digits say.
        half: half a unit of the last digit.
    """

    value: float
    half: float

    def means(self, value: float) -> bool:
        """Whether the digits are those of a value, rounded."""
        return math.isclose(self.value, value, rel_tol=1e-9, abs_tol=1.02 * self.half)


def numbers(text: str) -> list[Shown]:
    """Every number of a text, in order."""
    plain = _TIMES.sub(lambda m: f"e{m[1].translate(_DIGITS)}", text.replace("\u00a0", " "))
    plain = _POWER_OF_TEN.sub(" ", plain)
    plain = _SCALED.sub(lambda m: f"{m[1]}e{m[3]} ± {m[2]}e{m[3]}", plain)
    return [_shown(found.replace("−", "-")) for found in _NUMBER.findall(plain)]


def _shown(digits: str) -> Shown:
    mantissa, _, power = digits.partition("e")
    decimals = len(mantissa.partition(".")[2])
    return Shown(float(digits), 0.5 * 10.0 ** (int(power or 0) - decimals))


def all_blocks(blocks: Iterable[Block]) -> Iterator[Block]:
    """Blocks, and those inside them."""
    for block in blocks:
        yield from all_blocks(block.blocks) if isinstance(block, Card | Detail) else (block,)


def assert_shows(text: str, values: Sequence[float]) -> None:
    """A text's numbers are these, in this order, and no others."""
    found = numbers(text)
    assert len(found) == len(values), (text, values)
    for one, value in zip(found, values, strict=True):
        assert one.means(value), (text, one, value)
        # a number so coarse that anything would pass for it says nothing
        assert one.half <= 0.06 * abs(value) or one.value == value, (text, one, value)


def assert_known(text: str, values: Iterable[float]) -> None:
    """Every number of a text is one of these."""
    known = tuple(values)
    for one in numbers(text):
        assert any(one.means(value) for value in known), (text, one)


def assert_units(table: TextTable) -> None:
    """Every number has a unit, in its cell, heading or row label, and every estimate an uncertainty."""
    labelled = all("[" in first for first, *_ in table.rows)
    for heading, *cells in zip(table.columns, *table.rows, strict=True):
        bare = [cell for cell in cells if re.fullmatch(r"[-+−]?[\d.]+(e[-+]?\d+)?( ± [\d.]+)?", cell)]
        assert not bare or labelled or "[" in heading or heading in ("p", "version"), (heading, bare)
        if heading in ("parameters", "estimate", "estimate ± std", "nominal model", "with the causes"):
            for line in (line for cell in cells for line in cell.split("\n") if line):
                assert re.search(r"±|\(fixed\)", line), (heading, line)
