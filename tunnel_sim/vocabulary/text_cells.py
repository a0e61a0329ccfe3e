"""Texts in tables for spreadsheets, which treat a cell that begins with certain characters as a formula."""

from __future__ import annotations

import re

_FORMULA = re.compile(r"'*[=+\-@\t\r＝＋－＠]")
_NUMBER = re.compile(  # such as -0.103(12), -0.10 ± 0.02, -40 % and -3 deg
    r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?(\(\d+\))?( ± \d+\.?\d*([eE][+-]?\d+)?)?( [\w%°²³/ ]+)?"
)


def as_text_cell(text: str) -> str:
    """A text after an apostrophe if a spreadsheet would treat it as a formula; numbers are unchanged."""
    return f"'{text}" if _FORMULA.match(text) and not _NUMBER.fullmatch(text) else text


def from_text_cell(text: str) -> str:
    """The text of a cell, without the apostrophe of `as_text_cell`."""
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text
