"""What a command says, in the words of the page: fields instead of options."""

from __future__ import annotations

import re

FIELDS = {
    "angle": "Column of the angle",
    "unit": "Unit of the angle",
    "time": "Column of the times",
    "time-unit": "Unit of the times",
    "rate": "Sample rate",
    "counts-per-turn": "Counts of an encoder per turn",
    "calibration": "Angle of a voltage",
    "start": "Leave out samples before",
    "end": "Leave out samples after",
    "rest": "Reading at rest",
    "name": "Conditions in the file names",
    "delimiter": "Delimiter of a text file",
    "decimal": "Decimal sign of a text file",
    "no-cut": "Cut records at releases",
}
"""The label of the field, without its example and unit, by the option that states the same."""
_OPTION = re.compile(r"--([a-z-]+)(?: (?:[A-Z]+\b|\"[^\"]*\"))?")


def page_words(text: str) -> str:
    """A line of a command for a reader of the page.

    Returns:
        The line with the names of fields in place of options that have one, and without the command's name.
    """
    plain = text.removeprefix("tunnel: ").replace("with --no-cut", "by switching off --no-cut")
    return _OPTION.sub(lambda found: f"“{FIELDS[found[1]]}”" if found[1] in FIELDS else found[0], plain)
