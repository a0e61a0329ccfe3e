"""The error shown to users: what is wrong, where, and the remedy; and the libraries that may be missing."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

_LONGEST = 4096  # characters in one part of a message: the longest path


class TunnelError(Exception):
    """Bad input, described in one line.

    Args:
        what: what is wrong, as a short clause.
        where: the file, run or option concerned; empty when there is none.
        remedy: what to do about it.

    The text reads ``where: what; remedy`` and is always a single line. The command line prints it and exits with
    status 2.
    """

    def __init__(self, what: str, *, where: str = "", remedy: str = "") -> None:
        self.what = one_line(what, _LONGEST)
        self.where = one_line(where, _LONGEST)
        self.remedy = one_line(remedy, _LONGEST)
        text = f"{self.where}: {self.what}" if self.where else self.what
        super().__init__(f"{text}; {self.remedy}" if self.remedy else text)


def one_line(value: object, limit: int = 120) -> str:
    """The text of a value without line breaks or control characters.

    Args:
        limit: greatest length, characters; longer text is cut.
    """
    try:
        whole = str(value)
    except (RecursionError, ValueError):  # nested too deep, or an integer of thousands of digits
        whole = f"a {type(value).__name__} too large to show"
    text = " ".join("".join(c if c.isprintable() else " " for c in whole).split())
    return text if len(text) <= limit else f"{text[: limit - 1]}…"


def shown(path: Path) -> str:
    """A path for an error message: complete, on one line."""
    return one_line(path, limit=_LONGEST)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The remedy for an unknown name: the closest known name, or the list of all.

    Returns:
        A clause such as ``did you mean 'output_error'?``.
    """
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=1)
    return f"did you mean '{close[0]}'?" if close else f"use one of {', '.join(names)}"


EXTRAS = {
    "import": ("fastexcel", "xlsxwriter", "h5py", "nptdms"),
    "frames": ("pandas", "xarray"),
    "arviz": ("arviz",),
    "film": ("imageio", "imageio_ffmpeg"),
    "cluster": ("dask", "distributed"),
    "bench": ("nicegui",),
    "docs": ("sphinx", "furo", "myst_nb", "latex2mathml"),
    "train": ("stable_baselines3",),
}
"""The modules of each extra of ``pyproject.toml`` that a command needs."""


def library(name: str, use: str, extra: str, where: str = "") -> Any:
    """A library of an extra.

    Args:
        name: of its module.
        use: what needs it, for the message.
        extra: one of `EXTRAS`.

    Raises:
        TunnelError: when it is not installed; the remedy is the command that installs it.
    """
    try:
        return import_module(name)
    except ImportError:
        raise TunnelError(
            f"{use} needs the package {name.partition('.')[0]}",
            where=where,
            remedy=f"run: pip install 'virtual-wind-tunnel[{extra}]'",
        ) from None
