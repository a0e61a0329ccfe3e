"""Output files: written whole or not at all, as text and as JSON.

While a file or folder is being written, it has the temporary name ``.NAME.MARK.partial`` next to its target; a
folder about to be replaced is renamed ``.NAME.MARK.replaced``. The mark gives machine, process and its start
time, so that another command can recognise the leftovers of a killed command.
"""

from __future__ import annotations

import dataclasses
import errno
import hashlib
import io
import json
import math
import os
import re
import secrets
import shutil
import socket
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from tunnel_sim.files.toml_input import one_line, shown
from tunnel_sim.vocabulary.errors import TunnelError


def json_text(document: Mapping[str, object]) -> str:
    """A document as indented JSON; a number that is not finite is a bug, and a ValueError names its place."""
    return _encoded(document, indent=2) + "\n"


def json_line(document: object, *, sort_keys: bool = False) -> str:
    """A document as JSON on one line, for a field of another file; errors as in `json_text`."""
    return _encoded(document, sort_keys=sort_keys)


def as_json(value: object) -> Any:
    """A value in JSON's types: dataclasses by field unless they have a ``to_json_dict``, tuples as lists."""
    if hasattr(value, "to_json_dict"):
        return value.to_json_dict()
    if dataclasses.is_dataclass(value):
        return {own.name: as_json(getattr(value, own.name)) for own in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {key: as_json(one) for key, one in value.items()}
    return [as_json(one) for one in value] if isinstance(value, tuple | list) else value


def _encoded(document: object, **layout: Any) -> str:
    def plain(value: object) -> object:
        if isinstance(value, np.generic | np.ndarray):
            return value.tolist()
        raise TypeError(f"internal error: JSON cannot hold a {type(value).__name__}")

    try:
        return json.dumps(document, default=plain, ensure_ascii=False, allow_nan=False, **layout)
    except ValueError as error:
        place = _not_finite(document)
        if place is None:
            raise
        raise ValueError(f"internal error: {place}, which JSON cannot hold") from error


def _not_finite(value: object, place: str = "the document") -> str | None:
    """The place of the first number that is not finite; None if there is none."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, float):
        return None if math.isfinite(value) else f"{place} is {value}"
    items: list[tuple[str, object]] = []
    if isinstance(value, Mapping):
        items = [(f"{place}.{key}", item) for key, item in value.items()]
    elif isinstance(value, Sequence) and not isinstance(value, str | bytes):
        items = [(f"{place}[{index}]", item) for index, item in enumerate(value)]
    return next((found for name, item in items if (found := _not_finite(item, name)) is not None), None)


PARTIAL, REPLACED = "partial", "replaced"
_LEFTOVER = re.compile(
    r"\.(?P<name>.+)\.(?P<machine>[0-9a-f]{8})-(?P<pid>\d+)-(?P<start>\d+)-[0-9a-f]{6}\.(?P<kind>partial|replaced)"
)
_NAME_SHOWN = 40  # characters of the target's name in the temporary name: file names are limited to 255 bytes


def temporary_names(target: Path) -> tuple[Path, Path]:
    """Unique temporary names next to a target: for the new content, and for the old one while it is replaced."""
    pid = os.getpid()
    mark = f"{_machine()}-{pid}-{_start(pid) or 0}-{secrets.token_hex(3)}"
    return (
        target.with_name(f".{target.name[:_NAME_SHOWN]}.{mark}.{PARTIAL}"),
        target.with_name(f".{target.name}.{mark}.{REPLACED}"),
    )


def clear_leftovers(folder: Path) -> None:
    """Remove the leftovers of killed commands of this machine from a folder, and restore replaced folders."""
    try:
        names = [entry.name for entry in os.scandir(folder) if entry.name.startswith(".")]
    except OSError:
        return
    for name in names:
        found = _LEFTOVER.fullmatch(name)
        if found is None or found["machine"] != _machine() or _runs(int(found["pid"]), int(found["start"])):
            continue
        path, target = folder / name, folder / found["name"]
        with suppress(OSError):  # another command was faster, or it is not permitted: nothing is lost
            if found["kind"] == REPLACED and not os.path.lexists(target):
                path.rename(target)
            elif path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)


@lru_cache(maxsize=64)
def clear_leftovers_once(folder: Path) -> None:
    """Call `clear_leftovers`, but only the first time that this process writes to the folder."""
    clear_leftovers(folder)


def discard(folder: Path, partial: Path) -> None:
    """Remove a replaced folder; it is renamed first, so that an interruption does not restore the rest."""
    if folder.exists():
        folder.rename(partial)
        shutil.rmtree(partial, ignore_errors=True)


@cache
def _machine() -> str:
    """A hash that identifies this machine and, in a container, its process namespace."""
    parts = [socket.gethostname()]
    with suppress(OSError):
        parts.append(Path("/etc/machine-id").read_text(encoding="utf-8", errors="replace").strip())
    with suppress(OSError):
        parts.append(str(Path("/proc/self/ns/pid").readlink()))
    return hashlib.sha256("\0".join(parts).encode(errors="replace")).hexdigest()[:8]


def _runs(pid: int, start: int) -> bool:
    """Whether the process named by a mark is still running; True if that cannot be determined."""
    if os.name != "posix":
        return True
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        pass  # it is running and belongs to another user
    now = _start(pid)
    return now is None or start in (0, now)


def _start(pid: int) -> int | None:
    """Start time of a process in clock ticks since boot; None where it cannot be determined."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_bytes()
    except OSError:
        return None
    return int(stat.rpartition(b")")[2].split()[19])  # field 22 of proc(5); field 2 may contain spaces


_made: list[Path] = []  # folders for output
_PASSED_ON = (TunnelError, BrokenPipeError, KeyboardInterrupt, SystemExit, GeneratorExit)


def output_folder(folder: Path) -> Path:
    """Create a folder for output, with its parents; refused if it is a file or cannot be written to."""
    with refusals(folder):
        _make(folder)
        with tempfile.TemporaryFile(dir=folder):
            pass
    return folder


def remove_empty_folders() -> None:
    """Remove empty folders that this process has made for its output, as after a full disk."""
    for folder in sorted(_made, key=lambda path: len(path.parts), reverse=True):
        with suppress(OSError):
            folder.rmdir()
    _made.clear()


def refuse_unwritable(path: Path) -> None:
    """Refuse a file that cannot be written, before the work for its content."""
    target = _target(path)
    if not target.parent.is_dir():
        folder = shown(target.parent)
        raise TunnelError("its folder does not exist", where=shown(path), remedy=f"make {folder} first")
    if target.is_file() or not target.exists():  # devices and pipes are written to directly
        with refusals(path), tempfile.TemporaryFile(dir=target.parent):
            pass


def write_whole(path: Path, content: bytes) -> Path:
    """Write a file completely or not at all: to a temporary file next to it, which is then renamed.

    A symbolic link is kept and its target is replaced. Devices, pipes and this process's standard output are
    written to directly.
    """
    target = _target(path)
    with refusals(path):
        stream = None  # a standard stream of this process, if a path such as /dev/stdout refers to one
        for standard in (sys.__stdout__, sys.__stderr__):
            with suppress(OSError, ValueError):
                own = standard is not None and os.path.samestat(path.stat(), os.fstat(standard.fileno()))
                if stream is None and standard is not None and own:
                    standard.flush()
                    stream = standard.fileno()
        if stream is not None:
            _write_to(os.dup(stream), content)
        elif path.exists() and not path.is_file():
            _write_to(os.open(path, os.O_WRONLY), content)
        else:
            clear_leftovers_once(target.parent)
            partial, _ = temporary_names(target)
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
            try:
                _write_to(os.open(partial, flags, 0o666), content)
                partial.replace(target)
            finally:
                partial.unlink(missing_ok=True)
    return path


def write_encoded(path: Path, encode: Callable[[BinaryIO], object]) -> Path:
    """Write the output of a library's writer, completely or not at all."""
    return write_whole(path, encoded(path, encode))


def encoded(path: Path, encode: Callable[[BinaryIO], object]) -> bytes:
    """The output of a library's writer in memory; messages name the path for which it is meant."""
    stream = io.BytesIO()
    with refusals(path):
        encode(stream)
    return stream.getvalue()


def write_json(path: Path, document: Mapping[str, object]) -> Path:
    """Write a JSON document completely or not at all."""
    return write_whole(path, json_text(document).encode())


@contextmanager
def whole_folder(folder: Path, *, replace: bool) -> Iterator[Path]:
    """Write a folder completely or not at all: a new, empty one, which is renamed at the end.

    Missing parents are created; symbolic links are followed. A folder with content is replaced or refused,
    even if another process has written it meanwhile.
    """
    target = Path(os.path.realpath(folder))
    with refusals(folder, (OSError,)):
        _make(target.parent)
        clear_leftovers(target.parent)
        partial, replaced = temporary_names(target)
        try:
            partial.mkdir()
            yield partial
            if replace and target.exists():
                target.rename(replaced)
            elif not replace:
                with suppress(OSError):
                    target.rmdir()  # an empty folder may be in the way
            try:
                partial.rename(target)  # the system refuses this if a folder has content
            except BaseException as error:  # also for an interruption: the old folder must be restored
                if replace and replaced.exists():
                    replaced.rename(target)
                if replace or not isinstance(error, OSError) or not target.is_dir():
                    raise
                remedy = "another command has written it meanwhile; choose another one"
                raise TunnelError("the folder exists", where=shown(folder), remedy=remedy) from None
        finally:
            shutil.rmtree(partial, ignore_errors=True)
        discard(replaced, partial)


@contextmanager
def refusals(path: Path, kinds: tuple[type[BaseException], ...] = (BaseException,)) -> Iterator[None]:
    """Convert the exceptions of a writer to a `TunnelError`; interruptions and broken pipes are passed on."""
    try:
        yield
    except _PASSED_ON:
        raise
    except kinds as error:
        # The error for a file or folder that cannot be written.
        reason = error.strerror if isinstance(error, OSError) else None
        said = reason.lower() if reason else f"{type(error).__name__}: {error}".rstrip(": ")
        remedy = "name a file or folder that can be written"
        what = f"cannot be written ({one_line(said)})"
        raise TunnelError(what, where=shown(path), remedy=remedy) from error


def _target(path: Path) -> Path:
    """The file to which a path refers; refused if no file can be written there."""
    with refusals(path):
        if path.is_dir() or path.is_block_device():
            kind = "folder" if path.is_dir() else "disk"
            raise TunnelError(f"is a {kind}, not a file", where=shown(path), remedy="name a file")
        target = Path(os.path.realpath(path))
        if target.is_symlink():
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
        return target


def _write_to(descriptor: int, content: bytes) -> None:
    with os.fdopen(descriptor, "wb") as stream:
        stream.write(content)


def _make(folder: Path) -> None:
    """Create a folder with its parents, and remember the missing ones."""
    _made.extend(path for path in (folder, *folder.parents) if not path.exists())
    folder.mkdir(parents=True, exist_ok=True)
