"""Atomic writing of files and folders. No other module writes files; every error is one line."""

from __future__ import annotations

import errno
import io
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from tunnel_sim.files.json_text import json_text
from tunnel_sim.files.leftovers import clear_leftovers, clear_leftovers_once, discard, temporary_names
from tunnel_sim.files.toml_input import one_line, shown
from tunnel_sim.vocabulary.errors import TunnelError

_made: list[Path] = []  # folders for output
_PASSED_ON = (TunnelError, BrokenPipeError, KeyboardInterrupt, SystemExit, GeneratorExit)


def output_folder(folder: Path) -> Path:
    """Create a folder for output, with its parents.

    Args:
        folder: where the output goes; it may exist.

    Raises:
        TunnelError: when it is a file, or cannot be created or written to.
    """
    with refusals(folder):
        _make(folder)
        with tempfile.TemporaryFile(dir=folder):
            pass
    return folder


def remove_empty_folders() -> None:
    """Remove the folders that this process has made for its output and that hold nothing, as after a full disk."""
    for folder in sorted(_made, key=lambda path: len(path.parts), reverse=True):
        with suppress(OSError):
            folder.rmdir()
    _made.clear()


def refuse_unwritable(path: Path) -> None:
    """Refuse a file that cannot be written, before the work whose result it is for.

    Args:
        path: the file; symbolic links are followed.

    Raises:
        TunnelError: when it is a folder or a block device, or its folder does not exist or takes no files.
    """
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

    Args:
        path: the file; replaced when it exists.

    Raises:
        TunnelError: when it is a folder or a block device, or cannot be written.
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
    """Write the output of a library's writer, completely or not at all.

    Args:
        path: the file; replaced when it exists.
        encode: writes the content to a stream.

    Raises:
        TunnelError: when the writer fails, or as `write_whole`.
    """
    return write_whole(path, encoded(path, encode))


def encoded(path: Path, encode: Callable[[BinaryIO], object]) -> bytes:
    """The output of a library's writer, in memory.

    Args:
        path: the file it is meant for, named in messages.
        encode: writes the content to a stream.

    Raises:
        TunnelError: when the writer fails.
    """
    stream = io.BytesIO()
    with refusals(path):
        encode(stream)
    return stream.getvalue()


def write_json(path: Path, document: Mapping[str, object]) -> Path:
    """Write a JSON document completely or not at all.

    Args:
        path: the file; replaced when it exists.
        document: as for `tunnel_sim.files.json_text.json_text`.

    Raises:
        TunnelError: when the file cannot be written.
        ValueError: when the document contains NaN or infinity.
    """
    return write_whole(path, json_text(document).encode())


@contextmanager
def whole_folder(folder: Path, *, replace: bool) -> Iterator[Path]:
    """Write a folder completely or not at all.

    Args:
        folder: missing parents are created; symbolic links are followed.
        replace: whether a folder that holds something is replaced; otherwise it is refused, also one that another
            process has written meanwhile.

    Yields:
        A new, empty folder to write in, which is renamed at the end.

    Raises:
        TunnelError: when the disk reports an error, or the folder holds something.
    """
    target = Path(os.path.realpath(folder))
    with refusals(folder, (OSError,)):
        _make(target.parent)
        clear_leftovers(target.parent)
        partial, replaced = temporary_names(target)
        try:
            partial.mkdir()
            yield partial
            if replace:
                _put_in_place(partial, target, replaced)
            else:
                _put_where_nothing_is(partial, target, shown(folder))
        finally:
            shutil.rmtree(partial, ignore_errors=True)
        discard(replaced, partial)


@contextmanager
def refusals(path: Path, kinds: tuple[type[BaseException], ...] = (BaseException,)) -> Iterator[None]:
    """Convert the exceptions of a writer to a `TunnelError`.

    Interruptions and broken pipes are passed on.

    Args:
        path: the file or folder that is written.
        kinds: exceptions to convert; libraries written in Rust raise some that are not subclasses of `Exception`.

    Raises:
        TunnelError: instead of those.
    """
    try:
        yield
    except _PASSED_ON:
        raise
    except kinds as error:
        raise _unwritable(path, error) from error


def _target(path: Path) -> Path:
    """The file that a path refers to; refused where no file can be written."""
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
    """Descriptor of this process's standard stream that a path such as ``/dev/stdout`` refers to."""
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


def _put_where_nothing_is(partial: Path, target: Path, where: str) -> None:
    with suppress(OSError):
        target.rmdir()  # an empty folder may be in the way
    try:
        partial.rename(target)  # the system refuses it where a folder holds something: no check can be outrun
    except OSError:
        if not target.is_dir():
            raise
        remedy = "another command has written it meanwhile; choose another one"
        raise TunnelError("the folder exists", where=where, remedy=remedy) from None


def _make(folder: Path) -> None:
    """Create a folder with its parents, and remember which were missing."""
    _made.extend(path for path in (folder, *folder.parents) if not path.exists())
    folder.mkdir(parents=True, exist_ok=True)


def _put_in_place(partial: Path, target: Path, replaced: Path) -> None:
    if target.exists():
        target.rename(replaced)
    try:
        partial.rename(target)
    except BaseException:  # also for an interruption: the old folder must be restored
        if replaced.exists():
            replaced.rename(target)
        raise


def _unwritable(path: Path, error: BaseException) -> TunnelError:
    """The error for a file or folder that cannot be written."""
    reason = error.strerror if isinstance(error, OSError) else None
    said = reason.lower() if reason else f"{type(error).__name__}: {error}".rstrip(": ")
    return TunnelError(
        f"cannot be written ({one_line(said)})",
        where=shown(path),
        remedy="name a file or folder that can be written",
    )
