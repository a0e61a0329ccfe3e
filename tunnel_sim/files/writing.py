"""The one place where files are written: whole or not at all, and every refusal in one line."""

from __future__ import annotations

import errno
import io
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from tunnel_sim.files.json_text import json_text
from tunnel_sim.files.leftovers import clear_leftovers, clear_leftovers_once, discard, temporary_names
from tunnel_sim.files.toml_input import one_line, shown
from tunnel_sim.vocabulary.errors import TunnelError

_PASSED_ON = (TunnelError, BrokenPipeError, KeyboardInterrupt, SystemExit, GeneratorExit)


def output_folder(folder: Path) -> Path:
    """Make a folder to write to, with its parents.

    Args:
        folder: where the output goes; may exist.

    Returns:
        The same folder.

    Raises:
        TunnelError: when it is a file, or cannot be made or written to.
    """
    with refusals(folder):
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    return folder


def refuse_unwritable(path: Path) -> None:
    """Refuse, before the work is done, a file that could not be written after it.

    Args:
        path: the file; a symbolic link stands for what it names.

    Raises:
        TunnelError: when it is a folder or a disk, or its folder does not exist.
    """
    target = _target(path)
    if not target.parent.is_dir():
        folder = shown(target.parent)
        raise TunnelError("its folder does not exist", where=shown(path), remedy=f"make {folder} first")


def write_whole(path: Path, content: bytes) -> Path:
    """Write a file whole or not at all: to a temporary neighbour, then renamed over the target.

    A symbolic link stays, and what it names is replaced. A device, a pipe, or the file that is this process's own
    standard output is written to as it is.

    Args:
        path: the file; replaced when it exists.
        content: what it will hold.

    Returns:
        The same path.

    Raises:
        TunnelError: when it is a folder or a disk, or cannot be written.
    """
    target = _target(path)
    with refusals(path):
        stream = _standard_stream(path)
        if stream is not None:
            _write_to(os.dup(stream), content)
        elif path.exists() and not path.is_file():
            _write_to(os.open(path, os.O_WRONLY), content)
        else:
            _replace(target, content)
    return path


def write_encoded(path: Path, encode: Callable[[BinaryIO], object]) -> Path:
    """Write what a library's own writer makes, whole or not at all.

    Args:
        path: the file; replaced when it exists.
        encode: writes the content to the stream that it is given.

    Returns:
        The same path.

    Raises:
        TunnelError: whatever the writer raises, and as `write_whole`.
    """
    return write_whole(path, encoded(path, encode))


def encoded(path: Path, encode: Callable[[BinaryIO], object]) -> bytes:
    """What a library's own writer makes, kept in memory: the disk takes no part in it.

    Args:
        path: the file that it is for, named where the writer fails.
        encode: writes the content to the stream that it is given.

    Returns:
        The content.

    Raises:
        TunnelError: whatever the writer raises.
    """
    stream = io.BytesIO()
    with refusals(path):
        encode(stream)
    return stream.getvalue()


def write_json(path: Path, document: Mapping[str, object]) -> Path:
    """Write a JSON document whole or not at all.

    Args:
        path: the file; replaced when it exists.
        document: as for `tunnel_sim.files.json_text.json_text`.

    Returns:
        The same path.

    Raises:
        TunnelError: when the file cannot be written.
        ValueError: when the document holds NaN or infinity.
    """
    return write_whole(path, json_text(document).encode())


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """A folder that is there whole or not at all; one that is there already is replaced.

    Args:
        folder: its parents are made where they are missing; a symbolic link stands for what it names.

    Yields:
        A new, empty folder beside it to write in, which takes its name at the end.

    Raises:
        TunnelError: when the disk refuses.
    """
    target = Path(os.path.realpath(folder))
    with refusals(folder, (OSError,)):
        target.parent.mkdir(parents=True, exist_ok=True)
        clear_leftovers(target.parent)
        partial, replaced = temporary_names(target)
        try:
            partial.mkdir()
            yield partial
            _put_in_place(partial, target, replaced)
        finally:
            shutil.rmtree(partial, ignore_errors=True)
        discard(replaced, partial)


@contextmanager
def refusals(path: Path, kinds: tuple[type[BaseException], ...] = (BaseException,)) -> Iterator[None]:
    """Turn whatever a writer raises into one line.

    Interruptions pass, and so does a reader's end of a pipe that was closed.

    Args:
        path: what is written.
        kinds: of errors that are turned; libraries written in Rust raise some that are no `Exception`.

    Raises:
        TunnelError: in place of those.
    """
    try:
        yield
    except _PASSED_ON:
        raise
    except kinds as error:
        raise _unwritable(path, error) from error


def _target(path: Path) -> Path:
    """The file that a path stands for, refused where it is nothing to write a file to."""
    where = shown(path)
    with refusals(path):
        if path.is_dir():
            raise TunnelError("is a folder, not a file", where=where, remedy="name a file")
        if path.is_block_device():
            raise TunnelError("is a disk, not a file", where=where, remedy="name a file")
        target = Path(os.path.realpath(path))
        if target.is_symlink():
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
        return target


def _standard_stream(path: Path) -> int | None:
    """Number of this process's own standard stream that a path stands for, such as ``/dev/stdout``."""
    for stream in (sys.__stdout__, sys.__stderr__):
        try:
            if stream is not None and os.path.samestat(path.stat(), os.fstat(stream.fileno())):
                stream.flush()
                return stream.fileno()
        except (OSError, ValueError):
            continue
    return None


def _write_to(descriptor: int, content: bytes) -> None:
    with os.fdopen(descriptor, "wb") as stream:
        stream.write(content)


def _replace(target: Path, content: bytes) -> None:
    clear_leftovers_once(target.parent)
    partial, _ = temporary_names(target)
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    try:
        _write_to(os.open(partial, flags, 0o666), content)
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)


def _put_in_place(partial: Path, target: Path, replaced: Path) -> None:
    if target.exists():
        target.rename(replaced)
    try:
        partial.rename(target)
    except BaseException:  # an interruption too: the old folder must not stay set aside
        if replaced.exists():
            replaced.rename(target)
        raise


def _unwritable(path: Path, error: BaseException) -> TunnelError:
    """The one line for what cannot be written."""
    reason = error.strerror if isinstance(error, OSError) else None
    said = reason.lower() if reason else f"{type(error).__name__}: {error}".rstrip(": ")
    return TunnelError(
        f"cannot be written ({one_line(said)})",
        where=shown(path),
        remedy="name a file or folder that can be written",
    )
