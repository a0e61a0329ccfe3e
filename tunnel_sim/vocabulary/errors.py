"""The error shown to users: fault, place and remedy; and packages that are missing, or extend this one."""

from __future__ import annotations

import difflib
import os
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

_T = TypeVar("_T")
_PLACES = 3  # maximum number listed of those with the same fault
_LONGEST = 4096  # maximum number of characters in one part of a message: the longest path


class TunnelError(Exception):
    """Bad input, described in one line.

    Args:
        what: the fault, as a short clause.
        where: the file, run or option concerned; empty if there is none.
        remedy: how to correct it.
        options: options of ``tunnel import`` that correct it, each with its value, as in a command line.
        parts: the joined refusals; empty if it is a single one.

    The text reads ``where: what; remedy`` and is always a single line. The command line prints it and exits with
    status 2.
    """

    def __init__(
        self,
        what: str,
        *,
        where: str = "",
        remedy: str = "",
        options: Iterable[str] = (),
        parts: Sequence[TunnelError] = (),
    ) -> None:
        self.what = one_line(what, _LONGEST)
        self.where = one_line(where, _LONGEST)
        self.remedy = one_line(remedy, _LONGEST)
        self.options = tuple(options)
        self.parts = tuple(parts)
        text = f"{self.where}: {self.what}" if self.where else self.what
        super().__init__(f"{text}; {self.remedy}" if self.remedy else text)


def asking(option: str, what: str, where: str, more: str = "") -> TunnelError:
    """A refusal that an option of ``tunnel import`` settles; ``more``: words after the option in the remedy."""
    return TunnelError(what, where=where, remedy=f"give {option}{more}", options=(option,))


def attempt(faults: list[TunnelError], make: Callable[[], _T]) -> _T | None:
    """The result of a function; if it refuses, None, and the refusal is added to the others."""
    try:
        return make()
    except TunnelError as error:
        faults.append(error)
        return None


def joined(faults: Sequence[TunnelError]) -> TunnelError:
    """Several refusals about one place as one refusal; at least one."""
    if len(faults) == 1:
        return faults[0]
    faults = _parts(faults)
    what, remedy = (
        "; ".join(texts) for texts in zip(*((one.what, one.remedy) for one in faults), strict=True)
    )
    return TunnelError(what, where=faults[0].where, remedy=remedy, options=_options(faults), parts=faults)


def _parts(faults: Iterable[TunnelError]) -> list[TunnelError]:
    """The single refusals."""
    return [part for fault in faults for part in fault.parts or (fault,)]


def _options(faults: Iterable[TunnelError]) -> Iterator[str]:
    """The options of several refusals, each once."""
    return iter(dict.fromkeys(option for fault in faults for option in fault.options))


def together(faults: Sequence[TunnelError]) -> TunnelError:
    """Refusals about several places as one refusal; equal ones are stated once, with their places. At least one."""
    parts = _parts(faults)
    if len(faults) == 1 and len({part.where for part in parts}) == 1:
        return faults[0]
    places: dict[tuple[str, str], dict[str, None]] = {}
    for fault in parts:
        places.setdefault((fault.what, fault.remedy), {})[fault.where] = None
    found = []
    for (what, remedy), names in places.items():
        more = f" and {len(names) - _PLACES} more" if len(names) > _PLACES else ""
        found.append((what, ", ".join([*names][:_PLACES]) + more, remedy))
    options = _options(parts)
    if len(found) == 1:
        ((what, where, remedy),) = found
        return TunnelError(what, where=where, remedy=remedy, options=options)
    said = (str(TunnelError(what, where=where, remedy=remedy)) for what, where, remedy in found)
    return TunnelError(". ".join(said), options=options)


def one_line(value: object, limit: int = 120) -> str:
    """The text of a value without line breaks or control characters, cut to a number of characters."""
    try:
        whole = str(value)
    except (RecursionError, ValueError):  # nested too deeply, or an integer of thousands of digits
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
    """A count in words: "1 gap", "2 gaps"; the plural of the noun ends in s."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def one_of(names: Sequence[str]) -> str:
    """Two names or more as a choice: "one, two or three"."""
    return f"{', '.join(names[:-1])} or {names[-1]}"


EXTRAS = {
    "import": ("fastexcel", "xlsxwriter", "h5py", "nptdms", "mcap", "rosbags", "asammdf"),
    "frames": ("pandas", "pyarrow", "xarray", "uncertainties"),
    "arviz": ("arviz_base",),
    "film": ("imageio", "imageio_ffmpeg"),
    "cluster": ("dask", "distributed"),
    "bench": ("nicegui",),
    "docs": ("sphinx", "furo", "myst_nb", "latex2mathml"),
    "train": ("stable_baselines3",),
}
"""The modules of each extra of ``pyproject.toml`` that a command needs."""


REINSTALLING = ".venv/bin/pip install . in the clone of the project"
"""The command that builds and installs the project again, with the versions that it requires."""


def installing(extra: str) -> str:
    """The command that installs an extra of `EXTRAS` in a clone of the project, which no package index has."""
    return f".venv/bin/pip install '.[{extra}]' in the clone of the project"


def library(name: str, use: str, extra: str, where: str = "") -> Any:
    """A library of an extra of `EXTRAS`, by the name of its module and the feature that needs it."""
    try:
        return import_module(name)
    except ImportError:
        what = f"{use} needs the package {name.partition('.')[0]}"
        raise TunnelError(what, where=where, remedy=f"run {installing(extra)}") from None


def added_to(group: str) -> dict[str, EntryPoint]:
    """The entry points of a group, such as ``tunnel.effects``, by name."""
    from importlib.metadata import entry_points  # imported here because it would slow every command

    return {point.name: point for point in entry_points(group=group)}


@contextmanager
def loading(where: str, remedy: str = "correct or uninstall its package") -> Iterator[None]:
    """Report in one line any fault of foreign code while it is loaded within the block."""
    try:
        yield
    except (Exception, SystemExit) as error:
        said = str(error) if isinstance(error, TunnelError) else raised_line(error)
        raise TunnelError(f"cannot be loaded ({one_line(said)})", where=where, remedy=remedy) from error


def raised_line(error: BaseException) -> str:
    """An exception in one line: its type, its message, and the line of the user's own code that led to it."""
    frames = _own_frames(error)
    place = f", {Path(frames[-1].filename).name} line {frames[-1].lineno}" if frames else ""
    return one_line(f"{type(error).__name__}: {error}{place}", _LONGEST)


def own_traceback(error: BaseException) -> str:
    """The traceback of an exception, as Python prints it, starting at the user's own code."""
    frames = traceback.extract_tb(error.__traceback__)
    own = _own_frames(error)
    shown_from = frames.index(own[0]) if own else 0
    lines = (*traceback.format_list(frames[shown_from:]), *traceback.format_exception_only(error))
    return "Traceback (most recent call last):\n" + "".join(lines).rstrip()


def _own_frames(error: BaseException) -> list[traceback.FrameSummary]:
    """The frames of a traceback in the user's own files; without any, those outside this program."""
    home = Path(__file__).parents[2]
    ours = [home / name for name in ("tunnel_sim", "identification", "diagnosis", "tunnel_lab")]
    python = Path(os.__file__).parent
    outside = [
        one
        for one in traceback.extract_tb(error.__traceback__)
        if not any(Path(one.filename).is_relative_to(folder) for folder in ours)
        and not one.filename.startswith("<")
    ]
    own = [one for one in outside if not Path(one.filename).is_relative_to(python)]
    libraries = {"site-packages", "dist-packages"}
    return [one for one in own if not libraries & set(Path(one.filename).parts)] or own
