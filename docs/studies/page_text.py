"""The parts of a page that a study writes: tables at their marks, and the day and command of its figures."""

from __future__ import annotations

import re
from datetime import date

_MADE = re.compile(r"^\*Figures of (.*?)\. .*\*\n", re.MULTILINE)


def replaced(page: str, name: str, text: str) -> str:
    """A page with the text between ``<!-- NAME -->`` and ``<!-- end -->`` replaced."""
    head, mark, rest = page.partition(f"<!-- {name} -->\n")
    _, end, tail = rest.partition("<!-- end -->")
    return f"{head}{mark}{text}\n{end}{tail}"


def made_on(page: str) -> str:
    """The day that a page states for its figures, such as ``25 November 2026``; empty if it states none."""
    found = _MADE.search(page)
    return found[1] if found else ""


def stamped(page: str, name: str, day: date, minutes: float) -> str:
    """A page that states the day of its figures, and the command and processor time [min] to make them again."""
    line = (
        f"*Figures of {day.day} {day:%B %Y}. `python -m docs.studies.all {name}` makes them again, "
        f"in about {max(1, round(minutes))} minutes of processor time.*\n"
    )
    if made_on(page):
        return _MADE.sub(lambda _: line, page, count=1)
    title, rest = page.split("\n", 1)
    return f"{title}\n\n{line}{rest}"


def as_stamped(page: str, earlier: str) -> str:
    """A page with the day and the command of its earlier version; unchanged if that states none."""
    found = _MADE.search(earlier)
    if not found:
        return page
    title, rest = page.split("\n", 1)
    return f"{title}\n\n{found[0]}{rest}"


def table_in(printed: str) -> str:
    """The lines of the table that a command prints, without other lines."""
    return "\n".join(line for line in printed.splitlines() if line.startswith("|"))
