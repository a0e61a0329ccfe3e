"""HDF5 files, and MAT files of version 7.3, which are HDF5."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing.arrays import RUN_IDS, check_size, tables_of
from tunnel_sim.files.importing.faults import faults
from tunnel_sim.files.importing.tables import Table, known_unit
from tunnel_sim.files.reading import check_count
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import library

LIMIT = limits.DATA_BYTES
"""Largest file, bytes."""
MAGIC = (b"\x89HDF",)
"""How such a file begins."""
KIND = "an HDF5 file"
"""As messages name it."""


def read(content: bytes, where: str) -> list[Table]:
    """The tables of an HDF5 file; arguments as in `source.LibraryReader`."""
    h5py = library("h5py", "HDF5 (also MAT 7.3)", "import", where)
    with faults(KIND, where), h5py.File(io.BytesIO(content), "r") as file:
        datasets: dict[str, Any] = {}
        attributes: dict[str, NDArray[np.generic]] = {}
        runs: dict[str, str] = {}

        def visit(path: str, item: Any) -> None:
            check_count(
                len(datasets), limits.COLUMNS, "datasets", where, "leave out datasets that are not needed"
            )
            if isinstance(item, h5py.Dataset) and not path.startswith("#refs#") and not _is_text(item):
                datasets[path] = item
            group = isinstance(item, h5py.Group)
            for name in item.attrs:
                held = item.attrs.get_id(name)  # others are not read: a text may lie in a damaged heap
                if held.dtype.kind in "iuf" and held.get_space().get_simple_extent_npoints() == 1:
                    folder = path if group else path.rpartition("/")[0]
                    attributes[f"{folder}/{name}".lstrip("/")] = np.asarray(item.attrs[name])
                elif group and name in RUN_IDS and isinstance(text := item.attrs[name], str):
                    runs[path] = text

        visit("", file)
        file.visititems(visit)  # does not follow links, so nothing outside the file is opened
        check_size(sum(int(np.prod(item.shape, dtype=float)) for item in datasets.values()), where)
        arrays = attributes | dict(_columns(datasets))
        units = {path: _unit(item) for path, item in datasets.items() if _unit(item)}
    return tables_of(arrays, KIND.partition(" ")[2], units, runs)


def _columns(datasets: dict[str, Any]) -> list[tuple[str, NDArray[np.generic]]]:
    """Datasets as arrays; a compound one gives one array for each of its fields."""
    found = []
    for path, item in datasets.items():
        if item.external or item.is_virtual or item.shape is None:
            continue
        if item.dtype.names:
            table = item[()]
            found += [(f"{path}/{name}", table[name]) for name in item.dtype.names]
        elif item.dtype.kind in "iufb":
            found.append((path, item[()]))
    return found


def _is_text(item: Any) -> bool:
    return item.attrs.get("MATLAB_class") in (b"char", "char") or "MATLAB_empty" in item.attrs


def _unit(item: Any) -> str:
    """The unit that an attribute of a dataset states."""
    for name in ("unit", "units", "Unit", "Units"):
        text = item.attrs.get(name, "")
        found = known_unit(text.decode(errors="replace") if isinstance(text, bytes) else str(text))
        if found:
            return found
    return ""
