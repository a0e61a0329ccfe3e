"""Remarks of an import: on the reading of files, and on points that the user has to judge."""

from __future__ import annotations


class ImportRemark(str):
    """A remark with its short form, to be read beside the table of runs.

    A plain text is a remark whose short form is itself. Text and short form are single lines.

    Args:
        text: the whole remark.
        short: the remark without the numbers that the table shows; None: the whole remark.
        doubt: whether the user has to judge it; the text then names the option that settles it.
    """

    __slots__ = ("doubt", "short")

    short: str
    doubt: bool

    def __new__(cls, text: str, short: str | None = None, *, doubt: bool = False) -> ImportRemark:
        """A remark; arguments as above."""
        made = super().__new__(cls, text)
        made.short, made.doubt = text if short is None else short, doubt
        return made


def doubt(text: str, short: str | None = None) -> ImportRemark:
    """A remark that the user has to judge; arguments as in `ImportRemark`."""
    return ImportRemark(text, short, doubt=True)
