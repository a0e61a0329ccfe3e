"""Remarks of an import: on the reading of files, and on points that the user has to judge."""

from __future__ import annotations


class ImportRemark(str):
    """A remark with its short form, to be read beside the table of runs.

    A plain text is a remark and its own short form. Text and short form are single lines.

    Args:
        text: the whole remark.
        short: the remark without the numbers that the table shows; None: the whole remark.
        doubt: whether the user has to judge it; the text then names the option that settles it.
        motion: a doubt about the motion of one run, without its option, for a chart of the run; empty for other
            remarks.
    """

    __slots__ = ("doubt", "motion", "short")

    short: str
    doubt: bool
    motion: str

    def __new__(
        cls, text: str, short: str | None = None, *, doubt: bool = False, motion: str = ""
    ) -> ImportRemark:
        """A remark; arguments as above."""
        made = super().__new__(cls, text)
        made.short, made.doubt, made.motion = text if short is None else short, doubt, motion
        return made


def doubt(text: str, short: str | None = None) -> ImportRemark:
    """A remark that the user has to judge; arguments as in `ImportRemark`."""
    return ImportRemark(text, short, doubt=True)


def doubt_of_motion(fact: str, settled: str = "", short: str | None = None) -> ImportRemark:
    """A doubt about the motion of one run: the fact, and the option that settles it, empty if there is none."""
    return ImportRemark(f"{fact}; {settled}" if settled else fact, short, doubt=True, motion=fact)
