"""The error shown to users: what is wrong, where, and the remedy; packages that are missing, or add to this."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

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
    """The text of a value without line breaks or control characters, cut to a number of characters."""
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
    """The remedy for an unknown name: the closest known name, or the list of all."""
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=1)
    return f"did you mean '{close[0]}'?" if close else f"use one of {', '.join(names)}"


def counted(count: int, noun: str) -> str:
    """A number of things in words: "1 gap", "2 gaps"; the plural of the noun ends in s."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


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


def installing(extra: str) -> str:
    """The command that installs an extra, one of `EXTRAS`, in a clone of the project: it is on no package index."""
    return f".venv/bin/pip install '.[{extra}]' in the clone of the project"


def library(name: str, use: str, extra: str, where: str = "") -> Any:
    """A library of an extra, by the name of its module and what needs it; one of `EXTRAS`."""
    try:
        return import_module(name)
    except ImportError:
        what = f"{use} needs the package {name.partition('.')[0]}"
        raise TunnelError(what, where=where, remedy=f"run {installing(extra)}") from None


def added_to(group: str) -> dict[str, EntryPoint]:
    """The entry points of a group, such as ``tunnel.effects``, by name."""
    from importlib.metadata import entry_points  # only here: every command would wait for it

    return {point.name: point for point in entry_points(group=group)}


@contextmanager
def loading(group: str, name: str) -> Iterator[None]:
    """Say in one line whatever a foreign package does wrong while its entry point is loaded within the block."""
    try:
        yield
    except Exception as error:
        said = str(error) if isinstance(error, TunnelError) else f"{type(error).__name__}: {error}"
        what = f"cannot be loaded ({one_line(said)})"
        remedy = "correct or uninstall its package"
        raise TunnelError(what, where=f"entry point {group}: {name}", remedy=remedy) from error
