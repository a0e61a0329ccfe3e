"""MAT files of versions 4 to 7.3."""

from __future__ import annotations

import io
import zlib
from collections.abc import Iterator
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing import hdf5
from tunnel_sim.files.importing.arrays import RUN_IDS, check_size, tables_of
from tunnel_sim.files.importing.faults import faults
from tunnel_sim.files.importing.tables import Table
from tunnel_sim.vocabulary import limits

LIMIT = limits.DATA_BYTES
"""Largest file, bytes."""
MAGIC = (b"MATLAB", b"\x89HDF", b"\x00\x00\x00\x00", b"\x0a\x00\x00\x00")
"""Version 5, version 7.3 without its first block, and version 4."""
KIND = "a MAT file"
"""As messages name it."""
_COMPRESSED = 15  # data type of an element that zlib has packed
_HEADER = 128  # bytes before the first element of version 5


def read(content: bytes, where: str) -> list[Table]:
    """The tables of a MAT file; arguments as in `source.LibraryReader`."""
    if content.startswith((b"MATLAB 7.3", b"\x89HDF")):
        return hdf5.read(content, where)
    from scipy.io import loadmat

    with faults(KIND, where):
        check_size(_unpacked(content) // 8, where)
        held = loadmat(cast(Any, io.BytesIO(content)), simplify_cells=True)  # the stubs know paths only
    leaves = dict(_leaves({name: value for name, value in held.items() if not name.startswith("__")}))
    arrays = {path: value for path, value in leaves.items() if not isinstance(value, str)}
    texts = {path.rpartition("/"): value for path, value in leaves.items() if isinstance(value, str)}
    runs = {group: text for (group, _, name), text in texts.items() if name in RUN_IDS}
    return tables_of(arrays, "MAT file", runs=runs)


def _unpacked(content: bytes) -> int:
    """Bytes of all elements once unpacked, which each states in its first eight."""
    if not content.startswith(b"MATLAB"):
        return len(content)
    order: Literal["little", "big"] = "little" if content[126:128] == b"IM" else "big"
    at, total = _HEADER, 0
    while at + 8 <= len(content):
        kind, size = (int.from_bytes(content[at + i : at + i + 4], order) for i in (0, 4))
        if kind == _COMPRESSED:
            start = zlib.decompressobj().decompress(content[at + 8 : at + 8 + size], 8)
            total += int.from_bytes(start[4:8], order)
        else:
            total += size
        at += 8 + size
    return total


def _leaves(value: object, path: str = "") -> Iterator[tuple[str, NDArray[np.generic] | str]]:
    """Arrays and texts of structures and cells, by path."""
    if isinstance(value, dict):
        for name, member in value.items():
            yield from _leaves(member, f"{path}/{name}" if path else str(name))
    elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
        for i, member in enumerate(np.ravel(value) if isinstance(value, np.ndarray) else value, 1):
            yield from _leaves(member, f"{path}[{i}]")
    elif isinstance(value, str):
        yield path, value
    elif isinstance(value, int | float | np.ndarray | np.generic):
        yield path, np.asarray(value)
