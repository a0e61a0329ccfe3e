"""The one error a user is meant to read: what is wrong, where, and the remedy."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class TunnelError(Exception):
    """Bad input, said in one line.

    Args:
        what: what is wrong, as a short clause.
        where: the file, run or option it concerns; empty when there is none.
        remedy: what to do about it.

    The text reads ``where: what; remedy``. The command line prints it and exits with status 2.
    """

    def __init__(self, what: str, *, where: str = "", remedy: str = "") -> None:
        self.what = what
        self.where = where
        self.remedy = remedy
        text = f"{where}: {what}" if where else what
        super().__init__(f"{text}; {remedy}" if remedy else text)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The remedy for an unknown name: the closest known one, or the list of all.

    Args:
        name: the name that was not found.
        known: the names that exist.

    Returns:
        A clause such as ``did you mean 'output_error'?``.
    """
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=1)
    return f"did you mean '{close[0]}'?" if close else f"use one of {', '.join(names)}"
