"""Reading of regular files of limited size; every fault is a `TunnelError`.

A FIFO or a device is refused without waiting for it, a file that is too large before it is loaded into
memory.
"""

from __future__ import annotations

import codecs
import io
import json
import os
import stat
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from difflib import get_close_matches
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, one_line, shown

if TYPE_CHECKING:
    import polars as pl

_MOST_NAMES = 1000  # number of files of a folder that are compared
CAMPAIGN_FILE = "campaign.toml"
"""The file that makes a folder a campaign."""


def nearest(path: Path) -> str:
    """The file or folder whose name is most similar to a missing one, as a question; empty if there is none."""
    names = [entry.name for entry in _entries(path.parent) if entry.name != path.name]
    found = get_close_matches(path.name, names, n=1)
    return _question(path.parent / found[0]) if found else ""


def nearest_campaign(folder: Path) -> str:
    """The campaign around or inside a folder that is not one, as a question; empty if there is none."""
    around = [folder.parent] if (folder.parent / CAMPAIGN_FILE).is_file() else []
    inside = [
        folder / entry.name for entry in _entries(folder) if (folder / entry.name / CAMPAIGN_FILE).is_file()
    ]
    found = around or inside
    return _question(found[0]) if len(found) == 1 else ""


def inside(folder: Path) -> str:
    """The remedy if a folder is given instead of a file: its kind, or a file in it; empty if there is none."""
    if (folder / CAMPAIGN_FILE).is_file():
        return "it is a campaign, which tunnel identify and tunnel diagnose take"
    files = sorted(entry.name for entry in _entries(folder) if (folder / entry.name).is_file())
    return f"name a file in it, such as '{shown(folder / files[0])}'" if files else ""


def _question(path: Path) -> str:
    kind = "file"
    with suppress(OSError):  # a link to itself
        kind = "folder" if path.is_dir() else kind
    return f"did you mean the {kind} '{shown(path)}'?"


def _entries(folder: Path) -> Iterator[os.DirEntry[str]]:
    try:
        with os.scandir(folder) as entries:
            yield from islice(entries, _MOST_NAMES)
    except (OSError, ValueError):
        return


_CHUNK = 2**22
_FAULTS = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)
"""Exceptions that malformed content may cause in a parser."""


def read_regular(path: Path, limit: int, *, where: str = "", missing: str = "", readable: str = "") -> bytes:
    """Read a regular file of limited size, in bytes; ``missing`` and ``readable`` are the remedies."""
    where = where or shown(path)
    readable = readable or "name a file that can be read"
    try:
        # O_NONBLOCK: otherwise opening a FIFO without a writer would wait for ever.
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except (FileNotFoundError, NotADirectoryError):
        remedy = "; or ".join(filter(None, (nearest(path), missing))) or "check the path"
        raise TunnelError("no such file", where=where, remedy=remedy) from None
    except (OSError, ValueError) as error:
        raise _unreadable(error, where, readable) from None
    try:
        state = os.fstat(descriptor)
        if not stat.S_ISREG(state.st_mode):
            folder = stat.S_ISDIR(state.st_mode)
            kind = "it is a folder" if folder else "it is not a regular file"
            remedy = (folder and inside(path)) or readable
            raise TunnelError(f"cannot be read ({kind})", where=where, remedy=remedy)
        check_count(state.st_size, limit, "bytes", where, "split the file, or name the right one")
        # In one piece, so that a large file is in memory once; its content may be longer than its stated size.
        parts, size = [os.read(descriptor, state.st_size + 1)], 0
        while parts[-1]:
            size += len(parts[-1])
            check_count(size, limit, "bytes", where, "split the file, or name the right one")
            parts.append(os.read(descriptor, _CHUNK))
        return parts[0] if len(parts) <= 2 else b"".join(parts)
    except OSError as error:
        raise _unreadable(error, where, readable) from None
    finally:
        os.close(descriptor)


def read_text(path: Path, limit: int, *, missing: str = "") -> str:
    """Read a regular file of UTF-8 text, without its byte order mark; arguments as in `read_regular`."""
    return decoded(read_regular(path, limit, missing=missing), shown(path))


def decoded(content: bytes, where: str) -> str:
    """UTF-8 text, without its byte order mark."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise _not_utf8(content, error.start, where) from None


def check_utf8(content: bytes, where: str) -> None:
    """Refuse bytes that are not UTF-8, piece by piece: as one text they may take four times the memory."""
    if content.isascii():
        return
    decoder = codecs.getincrementaldecoder("utf-8")()
    for start in range(0, len(content), _CHUNK):
        part = content[start : start + _CHUNK]
        try:
            decoder.decode(part, final=start + _CHUNK >= len(content))
        except UnicodeDecodeError as error:
            at = start + len(part) - len(error.object) + error.start  # bytes kept from the previous piece
            raise _not_utf8(content, at, where) from None


def _not_utf8(content: bytes, at: int, where: str) -> TunnelError:
    what = f"not UTF-8 text ({_line(content, at)})"
    return TunnelError(what, where=where, remedy="save the file as UTF-8")


def _line(content: bytes, at: int) -> str:
    before = content.count(b"\n", 0, at)
    return f"line {before + 1}"


def check_lines(content: bytes, where: str, remedy: str) -> None:
    """Refuse bytes that are not lines of text: with NUL bytes, or with longer lines than in a table.

    Args:
        remedy: remedy for NUL bytes in the text.
    """
    nul = content.find(b"\0")
    if nul >= 0:
        what = f"is not text: it contains NUL bytes ({_line(content, nul)})"
        raise TunnelError(what, where=where, remedy=remedy)
    start = 0
    while len(content) - start > limits.LINE_BYTES:
        end = content.rfind(b"\n", start, start + limits.LINE_BYTES + 1)
        if end < 0:
            what = f"{_line(content, start)} is longer than {limits.LINE_BYTES:,} bytes"
            remedy = "write one sample on each line"
            raise TunnelError(what, where=where, remedy=remedy)
        start = end + 1


PACKED = ".gz"
"""Ending of files compressed by gzip, after the ending of their content: ``log.csv.gz``."""


def stem_of(path: Path) -> str:
    """The name of a file without its ending, and, if it is compressed, without its content's ending."""
    return Path(path.stem).stem if path.suffix.lower() == PACKED else path.stem


def unpacked(content: bytes, limit: int, where: str) -> bytes:
    """The content of a file compressed by gzip, unpacked piece by piece up to a limit in bytes."""
    parts, size, rest = [], 0, content
    try:
        while rest:
            inflate = zlib.decompressobj(wbits=31)
            while not inflate.eof:
                part = inflate.decompress(rest, _CHUNK)
                rest = inflate.unconsumed_tail
                size += len(part)
                check_count(size, limit, "bytes once unpacked", where, "split the file")
                parts.append(part)
                if not part and not rest and not inflate.eof:
                    raise zlib.error("it ends too early")
            rest = inflate.unused_data.lstrip(b"\0")  # another member, or padding
    except zlib.error as error:
        what = f"is not a file compressed by gzip ({one_line(error, 60)})"
        raise TunnelError(what, where=where, remedy="compress it again, or give it as it is") from None
    return b"".join(parts)


def is_blank(content: bytes) -> bool:
    """Whether a file contains only white space."""
    return not content or content.isspace()


def read_json(path: Path, *, remedy: str) -> dict[str, Any]:
    """Read a JSON object; the remedy is for a missing or malformed file."""
    content = read_regular(path, limits.JSON_BYTES, missing=remedy, readable=remedy)
    return parse_json(content, shown(path), remedy)


def parse_json(content: bytes | str, where: str, remedy: str) -> dict[str, Any]:
    """A JSON object from its text, or from UTF-8, with finite numbers only and within `check_shape`."""
    text = content if isinstance(content, str) else decoded(content, where)

    def refused(number: str) -> float:
        raise ValueError(f"{number} is not a JSON number")

    def finite(number: str) -> float:  # the parser reads a number such as 1e999 as an infinity
        if not abs(float(number)) < float("inf"):
            raise ValueError(f"{one_line(number, 20)} is too large for a floating-point number")
        return float(number)

    try:
        found = json.loads(text, parse_constant=refused, parse_float=finite)
    except (ValueError, RecursionError) as error:
        raise TunnelError(f"is not JSON ({one_line(error, 80)})", where=where, remedy=remedy) from None
    if not isinstance(found, dict):
        raise TunnelError("is not a JSON object", where=where, remedy=remedy)
    check_shape(found, where, remedy)
    return found


def check_shape(document: Mapping[str, Any], where: str, remedy: str) -> None:
    """Refuse a document that is nested too deeply or contains an integer that is too long."""
    level: list[Any] = [document]
    for _ in range(limits.NESTING + 1):
        following: list[Any] = []
        for value in level:
            if isinstance(value, Mapping):
                following += value.values()
            elif isinstance(value, list):
                following += value
            elif isinstance(value, int) and value.bit_length() > limits.INTEGER_BITS:
                what = f"an integer of {value.bit_length()} bits, more than {limits.INTEGER_BITS}"
                raise TunnelError(what, where=where, remedy=remedy)
        level = following
        if not level:
            return
    raise TunnelError(f"nested deeper than {limits.NESTING} levels", where=where, remedy=remedy)


def frame_schema(
    content: bytes, where: str, remedy: str, *, rows: int, counted: str = "rows"
) -> dict[str, pl.DataType]:
    """The types by name of a Parquet file with an acceptable size in its metadata; no row is read."""
    import polars as pl

    with _parquet_faults(where, remedy):
        schema = dict(pl.read_parquet_schema(io.BytesIO(content)))
        count = int(pl.scan_parquet(io.BytesIO(content)).select(pl.len()).collect().item())
    check_count(len(schema), limits.COLUMNS, "columns", where, "leave out columns that are not needed")
    check_count(count, rows, counted, where, "split the file, or thin it out")
    return schema


def read_frame(content: bytes, where: str, remedy: str, columns: Sequence[str]) -> pl.DataFrame:
    """Columns of a Parquet file that `frame_schema` has accepted."""
    import polars as pl

    with _parquet_faults(where, remedy):
        return pl.read_parquet(io.BytesIO(content), columns=list(columns))


@contextmanager
def _parquet_faults(where: str, remedy: str) -> Iterator[None]:
    """Convert any exception of the Parquet decoder to a `TunnelError`."""
    import polars as pl

    try:
        yield
    # Some broken files make the decoder panic; PanicException is not a subclass of Exception.
    except (Exception, pl.exceptions.PanicException) as error:
        what = f"not a readable Parquet file ({one_line(error, 60)})"
        raise TunnelError(what, where=where, remedy=remedy) from None


def check_count(count: float, limit: int, what: str, where: str, remedy: str) -> None:
    """Refuse a number above its limit, before anything is expanded; the message states both.

    Args:
        count: the number (a count) of ``what``, a plural.
    """
    if not count <= limit:
        number = f"{count:,}" if isinstance(count, int) and count < 10**15 else f"{float(count):.3g}"
        raise TunnelError(f"{number} {what}, more than {limit:,}", where=where, remedy=remedy)


@contextmanager
def as_described(what: str, where: str, remedy: str) -> Iterator[None]:
    """Convert the exceptions that malformed content causes in a parser to a `TunnelError`."""
    try:
        yield
    except Exception as error:
        by_polars = type(error).__module__.startswith("polars.")  # recognised by name: Polars is slow to load
        if not (by_polars or isinstance(error, _FAULTS)):
            raise
        raise TunnelError(f"{what} ({_reason(error)})", where=where, remedy=remedy) from None


def _reason(error: Exception) -> str:
    """A parser's message about its input; for a value of a wrong type, the key and the right type."""
    # imported here because it is slow to load, and needed for faults only
    from pydantic import ValidationError

    if isinstance(error, ValidationError):
        first = error.errors(include_url=False)[0]
        return f"{'.'.join(map(str, first['loc']))}: {one_line(first['msg'], 60)}"
    return f"{type(error).__name__}: {one_line(error, 60)}"


def _unreadable(error: Exception, where: str, remedy: str) -> TunnelError:
    reason = getattr(error, "strerror", None) or error
    return TunnelError(f"cannot be read ({one_line(reason)})", where=where, remedy=remedy)
