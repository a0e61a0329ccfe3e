"""The readers of files, by file extension: a new format is a `Reader` and a line in `READERS`."""

from __future__ import annotations

import functools
import pkgutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tunnel_sim.vocabulary.errors import TunnelError, added_to, loading, one_line

if TYPE_CHECKING:
    import polars as pl

    from tunnel_sim.files.importing.tables import Table

ENTRY_POINTS = "tunnel.readers"
"""Group of the entry points by which an installed package adds readers: ending without its dot, and `Reader`."""


@dataclass(frozen=True)
class FileTable:
    """The table of a run file: at least its columns of times, readings and input.

    Args:
        names: names of all columns of the file, including columns that are not in the frame.
        text: whether the cells are texts, below a line of headings.
    """

    frame: pl.DataFrame
    names: Sequence[str]
    text: bool = False


@dataclass(frozen=True)
class Reader:
    """The reader of one format. Its functions raise `TunnelError` for content of another format, or too large.

    Args:
        limit: maximum size of a file, bytes.
        read_run: function for a campaign's run file: its table from its content, its name for messages, and the
            maximum number of samples; None if such files are not run files.
        read_tables: function for an instrument's file: its tables from its content and its name for messages;
            it runs in a process with limits. None if such files are imported as text.
        run_apart: whether run files are also read in that process, because damaged ones make a library print or
            end its process.
    """

    kind: str
    limit: int
    magic: tuple[bytes, ...] = ()
    read_run: Callable[[bytes, str, int], FileTable] | None = None
    read_tables: Callable[[bytes, str], list[Table]] | None = None
    run_apart: bool = False


READERS: Mapping[str, str] = {
    ".csv": "tunnel_sim.files.run_files:CSV",
    ".parquet": "tunnel_sim.files.importing.formats.binary:PARQUET",
    ".xlsx": "tunnel_sim.files.importing.formats.workbook:WORKBOOK",
    ".xlsm": "tunnel_sim.files.importing.formats.workbook:WORKBOOK",
    ".mat": "tunnel_sim.files.importing.formats.binary:MAT",
    ".h5": "tunnel_sim.files.importing.formats.binary:HDF5",
    ".hdf5": "tunnel_sim.files.importing.formats.binary:HDF5",
    ".hdf": "tunnel_sim.files.importing.formats.binary:HDF5",
    ".tdms": "tunnel_sim.files.importing.formats.binary:TDMS",
    ".mcap": "tunnel_sim.files.importing.formats.robot_logs:MCAP",
    ".db3": "tunnel_sim.files.importing.formats.robot_logs:ROSBAG2",
    ".mf4": "tunnel_sim.files.importing.formats.mdf:MDF",
    ".mdf": "tunnel_sim.files.importing.formats.mdf:MDF",
    ".json": "tunnel_sim.files.importing.formats.json_tables:JSON",
    ".jsonl": "tunnel_sim.files.importing.formats.json_tables:JSON_LINES",
    ".ndjson": "tunnel_sim.files.importing.formats.json_tables:JSON_LINES",
}
"""The place of the `Reader` for each ending. A new format is a reader and a line; other files are imported as
text."""

RUN_ENDINGS = (".csv", ".parquet")
"""The endings of `READERS` for run files, known without loading the readers."""


def reader_place(ending: str) -> str | None:
    """The place ``module:name`` of the reader of an extension (with its dot, in lower case); None: it has none."""
    return READERS.get(ending) or _added_places().get(ending)


def load_reader(ending: str) -> Reader | None:
    """The reader of files with an extension, as in `reader_place`; None if there is none."""
    place = reader_place(ending)
    if place is None:
        return None
    if ending in READERS:
        built_in: Reader = pkgutil.resolve_name(place)
        return built_in
    with loading(f"entry point {ENTRY_POINTS}: {ending[1:]}"):
        added = pkgutil.resolve_name(place)
        if not isinstance(added, Reader):
            raise TunnelError("is not a Reader", remedy="see tunnel_sim.files.readers")
    return added


def run_endings() -> list[str]:
    """The extensions of a campaign's run files, with their dots; installed packages may add some."""
    readers = ((ending, load_reader(ending)) for ending in {**READERS, **_added_places()})
    return [ending for ending, reader in readers if reader is not None and reader.read_run is not None]


@functools.cache
def _added_places() -> dict[str, str]:
    """The places of the readers of installed packages, by extension; read once."""
    return {f".{name.lower()}": point.value for name, point in added_to(ENTRY_POINTS).items()}


@contextmanager
def faults(kind: str, where: str) -> Iterator[None]:
    """Convert any exception of a library for a malformed file, except `MemoryError`, to a `TunnelError`."""
    try:
        yield
    except (TunnelError, MemoryError):  # the guard reports memory
        raise
    except BaseException as error:
        # a panic of a library in Rust is not a subclass of Exception, and has no name to import
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        what = f"is not {kind} that can be read ({one_line(str(error) or type(error).__name__, 60)})"
        raise TunnelError(what, where=where, remedy="export it again, or as text") from None
