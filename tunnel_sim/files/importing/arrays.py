"""Tables from arrays by name, as MAT and HDF5 files hold them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing.tables import Channel, Table, split_unit
from tunnel_sim.files.reading import check_count
from tunnel_sim.vocabulary import limits

RUN_IDS = ("id", "run", "run_id")
"""Members and attributes whose text is the name of the run that a group holds."""
_LEAST = 16  # values: a shorter array is not a record
_MOST_CHANNELS = 256  # rows of a matrix: it is turned so that they are fewer than its samples


def tables_of(
    arrays: Mapping[str, NDArray[np.generic]],
    kind: str,
    units: Mapping[str, str] = MappingProxyType({}),
    runs: Mapping[str, str] = MappingProxyType({}),
) -> list[Table]:
    """Tables of arrays: those of the same group and length belong together.

    Args:
        arrays: by path, with ``/`` between groups; matrices hold one channel in each row or column.
        kind: of the file, for the remark.
        units: stated units of arrays, by path.
        runs: names of the runs that groups hold, by path.

    Returns:
        A table for each group of arrays. Single numbers are facts of the tables of their group and below, those of
        a group ``rig`` of all beside it.
    """
    facts: dict[str, dict[str, float]] = {}
    groups: dict[tuple[str, int], list[Channel]] = {}
    for path, array in arrays.items():
        if array.dtype.kind not in "iufb":
            continue
        group, _, name = path.rpartition("/")
        if array.size == 1:
            above, _, last = group.rpartition("/")
            facts.setdefault(above if last == "rig" else group, {})[name] = float(array.reshape(-1)[0])
            continue
        matrix = np.atleast_2d(np.squeeze(array))
        if matrix.ndim != 2 or matrix.shape[1] == 0:
            continue
        if matrix.shape[0] > matrix.shape[1]:
            matrix = matrix.T
        if matrix.shape[1] < _LEAST or matrix.shape[0] > _MOST_CHANNELS:
            continue
        stem, unit = split_unit(name)
        unit = units.get(path, unit)
        for i, row in enumerate(matrix):
            label = stem if matrix.shape[0] == 1 else f"{stem}[{i + 1}]"
            groups.setdefault((group, matrix.shape[1]), []).append(
                Channel(label, row.astype(np.float64), unit)
            )
    return [
        Table(
            tuple(channels),
            runs.get(group) or _part(group, groups),
            _facts_of(group, facts),
            (f"{kind}: {_shape(channels)}",),
            named=bool(runs.get(group)),
        )
        for (group, _), channels in groups.items()
    ]


def check_size(count: int, where: str) -> None:
    """Refuse arrays that are too large, by the count that the file states.

    Args:
        count: of all values (a count).

    Raises:
        TunnelError: too many.
    """
    most = limits.DATA_BYTES // 8
    check_count(count, most, "numbers", where, "split the file, or leave out arrays that are not needed")


def _part(group: str, groups: Mapping[tuple[str, int], list[Channel]]) -> str:
    """The name of a group where there are several."""
    return group.replace("/", "-") if len({name for name, _ in groups}) > 1 else ""


def _facts_of(group: str, facts: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    found: dict[str, float] = {}
    for name, values in sorted(facts.items(), key=lambda item: len(item[0])):
        if name == "" or group == name or group.startswith(name + "/"):
            found |= values
    return found


def _shape(channels: list[Channel]) -> str:
    count = len(channels)
    return f"{count} channel{'s' if count > 1 else ''} of {channels[0].values.size} samples"
