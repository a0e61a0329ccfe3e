"""Tables of named arrays, from MAT, HDF5 and JSON files."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing.condition_names import condition_of, resembles
from tunnel_sim.files.importing.tables import LEAST_ROWS, Channel, Table
from tunnel_sim.files.importing.units import split_unit
from tunnel_sim.files.reading import check_count
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import counted

RUN_IDS = ("id", "run", "run_id")
"""Members and attributes with a text that names the run in a group."""
_MOST_CHANNELS = 256  # maximum number of rows of a matrix: it is transposed if it has more rows than columns


def tables_of_arrays(
    arrays: Mapping[str, NDArray[np.generic]],
    kind: str,
    units: Mapping[str, str] = MappingProxyType({}),
    runs: Mapping[str, str] = MappingProxyType({}),
    texts: Mapping[str, str] = MappingProxyType({}),
) -> list[Table]:
    """Tables of arrays: arrays of the same group and length belong together.

    Single numbers are facts of the tables of their group and of the groups below. In a group without records
    they describe the other groups at its level.

    Args:
        arrays: by path, with ``/`` between groups; matrices hold one channel in each row or column.
        texts: texts by path; the texts of every group belong to all tables.
    """
    facts: dict[str, dict[str, float]] = {}
    groups: dict[tuple[str, int], list[Channel]] = {}
    for path, array in arrays.items():
        if array.dtype.kind not in "iufb":
            continue
        group, _, name = path.rpartition("/")
        if array.size == 1:
            facts.setdefault(group, {})[name] = float(array.reshape(-1)[0])
            continue
        matrix = np.atleast_2d(np.squeeze(array))
        if matrix.ndim != 2 or matrix.shape[1] == 0:
            continue
        if matrix.shape[0] > matrix.shape[1]:
            matrix = matrix.T
        stem, unit = split_unit(name)
        unit = units.get(path, unit)
        # A short array is not a record; it may state a condition of each run.
        like = condition_of(stem, unit) or resembles(stem, unit)
        if matrix.shape[0] > _MOST_CHANNELS or (matrix.shape[1] < LEAST_ROWS and like is None):
            continue
        for i, row in enumerate(matrix):
            label = stem if matrix.shape[0] == 1 else f"{stem}[{i + 1}]"
            channel = Channel(label, row.astype(np.float64), unit)
            groups.setdefault((group, matrix.shape[1]), []).append(channel)
    records = {name for name, length in groups if length >= LEAST_ROWS}
    several = len(records or {name for name, _ in groups}) > 1
    facts = _of_described(facts, records)
    tables = []
    for (group, length), channels in groups.items():
        part = runs.get(group) or (group.replace("/", "-") if several else "")
        stated: dict[str, float] = {}
        for above in sorted(facts, key=len):  # the nearest group counts
            if above == "" or group == above or group.startswith(above + "/"):
                stated |= facts[above]
        said = f"{kind}: {counted(len(channels), 'channel')} of {counted(length, 'sample')}"
        tables.append(Table(tuple(channels), part, stated, (said,), named=bool(runs.get(group)), texts=texts))
    return tables


def _of_described(
    facts: Mapping[str, Mapping[str, float]], records: Collection[str]
) -> dict[str, dict[str, float]]:
    """Numbers by the group that they describe: their own, or the group above if their own has no records."""
    found: dict[str, dict[str, float]] = {}
    for group, numbers in facts.items():
        own = group == "" or any(name == group or name.startswith(f"{group}/") for name in records)
        inside = any(group.startswith(f"{name}/") for name in records)
        # an element of a list of runs does not describe the other elements
        one_of_several = group.endswith("]")
        above = group if own or inside or one_of_several else group.rpartition("/")[0]
        found.setdefault(above, {}).update(numbers)
    return found


def check_size(count: int, where: str) -> None:
    """Refuse arrays with too many values, as stated in the file."""
    most = limits.DATA_BYTES // 8
    check_count(count, most, "numbers", where, "split the file, or leave out arrays that are not needed")
