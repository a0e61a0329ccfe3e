"""From a file to its tables: its reader is chosen, and runs in a process with limits.

A damaged file may block a parser for ever, make it request all memory, or end the process. One process
serves one file after another; if it exceeds a limit, another one replaces it.
"""

from __future__ import annotations

import atexit
import hashlib
import json
import math
import os
import pkgutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np

from tunnel_sim.files.importing.conditions import ImportChoices
from tunnel_sim.files.importing.tables import Channel, Table, by_run, with_input_facts
from tunnel_sim.files.importing.text import TEXT, read_text_tables
from tunnel_sim.files.readers import load_reader, reader_place
from tunnel_sim.files.reading import check_count, is_blank, read_regular
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, counted, shown

_SERVE = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from tunnel_sim.files.importing.source import serve; serve()"
)
_LATEST = 3.0  # times the allowed time
_OUT_OF_TIME = -getattr(signal, "SIGXCPU", math.inf)  # exit status where Linux or macOS ended it for its time
_DAMAGED = "export it again, or as text"
_lock = threading.Lock()
_kept: list[_Server] = []


def read_guarded(reader: str, content: bytes, where: str) -> list[Table]:
    """The tables of a file by the reader at ``module:name``, read in a process with limits."""
    with _lock:
        if _kept and not _kept[0].usable():
            _kept.pop().end()
        if not _kept:
            _kept.append(_Server())
        try:
            return _kept[0].read(reader, content, where)
        except BaseException as error:
            # An unread reply would be mistaken for the next one.
            if not isinstance(error, TunnelError) or not _kept[0].usable():
                _kept.pop().end()
            raise


class _Server:
    """The process, seen by its client."""

    def __init__(self) -> None:
        from multiprocessing.spawn import get_executable  # a program that embeds Python may have set it

        from tunnel_sim.processes import ONE_THREAD

        self._process = subprocess.Popen(
            [os.fsdecode(get_executable()), "-W", "ignore", "-c", _SERVE, json.dumps([*map(str, sys.path)])],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | dict.fromkeys(ONE_THREAD, "1"),
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )
        self._asked, self._answers = cast(BinaryIO, self._process.stdin), cast(BinaryIO, self._process.stdout)
        self._owner = os.getpid()
        atexit.register(self.end)

    def usable(self) -> bool:
        """Whether the process runs and belongs to this one: a fork must not use its parent's pipes."""
        return self._owner == os.getpid() and self._process.poll() is None

    def end(self) -> None:
        """End the process at once."""
        atexit.unregister(self.end)
        if self._owner == os.getpid():
            self._process.kill()
            self._process.wait()
        for stream in (self._asked, self._answers):
            with suppress(OSError):  # unsent data cannot be sent
                stream.close()

    def read(self, reader: str, content: bytes, where: str) -> list[Table]:
        """The tables of a file, as in `read_guarded`."""
        allowed = limits.READER_SECONDS + len(content) / limits.READER_PACE
        late = threading.Event()

        def stop() -> None:
            late.set()
            self._process.kill()

        watch = threading.Timer(allowed, stop)
        watch.daemon = True
        watch.start()
        try:
            request = {"reader": reader, "where": where, "seconds": allowed, "sizes": [len(content)]}
            _send(self._asked, request, [content])
            answer, arrays = _received(self._answers)
        except (EOFError, OSError):
            status = self._process.wait()
            too_long = late.is_set() or status == _OUT_OF_TIME
            ended = f"ends the program that reads it (exit status {status})"
            what = f"takes longer than {allowed:.3g} s to read" if too_long else ended
            raise TunnelError(what, where=where, remedy=f"it may be damaged: {_DAMAGED}") from None
        finally:
            watch.cancel()
        if "last" in answer:
            self._process.wait()
        if "error" in answer:
            raise TunnelError(answer["error"], where=where, remedy=answer["remedy"])
        values = (np.frombuffer(array) for array in arrays)
        tables = []
        for table in answer["tables"]:
            channels = tuple(Channel(name, next(values), unit) for name, unit in table["channels"])
            tables.append(Table(**table | {"channels": channels, "said": tuple(table["said"])}))
        return tables


def serve() -> None:
    """Read files for another process, until it closes the pipe."""
    asked, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # the output of a library is not an answer
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the client ends this process
    _limit("RLIMIT_AS", limits.READER_MEMORY)
    with suppress(EOFError):
        while True:
            request, content = _received(asked)
            # The client ends this process earlier, unless it has been killed itself.
            # The limit counts whole seconds.
            _limit("RLIMIT_CPU", math.ceil(time.process_time() + _LATEST * request["seconds"]) + 1)
            try:
                tables = pkgutil.resolve_name(request["reader"]).read_tables(content.pop(), request["where"])
                columns = [
                    np.ascontiguousarray(c.values, np.float64) for table in tables for c in table.channels
                ]
                described = [
                    {field.name: getattr(table, field.name) for field in fields(Table)}
                    | {"channels": [(c.name, c.unit) for c in table.channels]}
                    for table in tables
                ]
                head = {"tables": described, "sizes": [c.nbytes for c in columns]}
                _send(answers, head, [c.data for c in columns])
            except TunnelError as error:
                _send(answers, {"error": error.what, "remedy": error.remedy, "sizes": []}, [])
            except MemoryError:
                what = f"needs more than {limits.READER_MEMORY / 2**30:g} GiB of memory to be read"
                remedy = f"split it; if it is damaged, {_DAMAGED}"
                _send(answers, {"error": what, "remedy": remedy, "sizes": [], "last": True}, [])
                return  # the next file gets a fresh process


def _limit(name: str, most: int) -> None:
    """Bound a resource of this process where the system can: Linux all, macOS the processor's time."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        kind = getattr(resource, name)
        _, hard = resource.getrlimit(kind)
        resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def _send(stream: BinaryIO, head: dict[str, Any], parts: Sequence[bytes | memoryview]) -> None:
    """Send a line of JSON, and the parts whose sizes it states."""
    stream.write(json.dumps(head).encode() + b"\n")
    for part in parts:
        stream.write(part)
    stream.flush()


def _received(stream: BinaryIO) -> tuple[dict[str, Any], list[bytes]]:
    """The data sent by `_send`; EOFError where the other process has ended."""
    line = stream.readline()
    if not line.endswith(b"\n"):
        raise EOFError
    head = json.loads(line)
    parts = [stream.read(size) for size in head["sizes"]]
    if [len(part) for part in parts] != head["sizes"]:
        raise EOFError
    return head, parts


@dataclass(frozen=True, eq=False)
class Source:
    """A file that was read: its SHA-256, its tables in their order, and how it was read, for the recipe."""

    path: Path
    sha256: str
    tables: tuple[Table, ...]
    known: Mapping[str, str] = field(default_factory=dict)


_BEGINNINGS = {
    b"PK\x03\x04": "an Excel workbook or another archive",
    b"\x89HDF": "an HDF5 file",
    b"MATLAB": "a MAT file",
    b"TDSm": "a TDMS file",
    b"PAR1": "a Parquet file",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook (.xls); save it as .xlsx",
    b"%PDF": "a PDF document",
    b"\x1f\x8b": "a compressed file; unpack it",
}


def read_source(path: Path, choices: ImportChoices) -> Source:
    """Read a file of any known format; the meaning of its columns is not known yet."""
    where = shown(path)
    ending = path.suffix.lower()
    reader, place = load_reader(ending), reader_place(ending)
    if reader is None or reader.read_tables is None:
        reader, place = TEXT, None
    content = read_regular(path, reader.limit)
    if is_blank(content):
        raise TunnelError("the file is empty", where=where, remedy="name a file with a record")
    if not reader.magic or not content.startswith(reader.magic):
        really = next((kind for magic, kind in _BEGINNINGS.items() if content.startswith(magic)), None)
        if really is not None or reader.magic:
            what = f"is not {reader.kind}" + (f": it begins like {really}" if really else "")
            remedy = "give the file the ending of its format, or export it again"
            raise TunnelError(what, where=where, remedy=remedy)
    known: dict[str, str] = {}
    if place is None:
        tables, known = read_text_tables(content, where, choices)
    else:
        tables = read_guarded(place, content, where)
    found = []
    for table in (table for table in tables if table.channels):
        channels, said = [], [*table.said]
        for channel in table.channels:
            wild = np.abs(channel.values) > limits.LARGEST_NUMBER  # its powers would overflow
            if wild.any():
                said.append(
                    f"{counted(int(wild.sum()), 'number')} beyond {limits.LARGEST_NUMBER:g} taken as missing"
                )
                channel = replace(channel, values=np.where(wild, np.nan, channel.values))
            channels.append(channel)
        table = replace(table, channels=tuple(channels), said=tuple(said))
        parts = (with_input_facts(part) for part in by_run(table))
        # A column that names the runs, or states the input, may be alone in its table.
        found += [part for part in parts if part.channels]
    if not found:
        remedy = "name a file with times and angles"
        raise TunnelError("no column of numbers", where=where, remedy=remedy)
    count = sum(table.channels[0].values.size for table in found)
    check_count(count, limits.CAMPAIGN_SAMPLES, "samples", where, "split the file")
    return Source(path, hashlib.sha256(content).hexdigest(), tuple(found), known)
