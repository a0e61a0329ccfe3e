"""Tables of named arrays, from MAT, HDF5 and JSON files."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing.condition_names import condition_of, resembles
from tunnel_sim.files.importing.formats.layout import facts_in
from tunnel_sim.files.importing.tables import LEAST_ROWS, Channel, Table, hold_order
from tunnel_sim.files.importing.units import split_unit
from tunnel_sim.files.reading import check_count
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import counted

_RUN_IDS = ("id", "run", "run_id")
"""Members and attributes with a text that names the run in a group."""
_MOST_CHANNELS = 256  # maximum number of rows of a matrix: it is transposed if it has more rows than columns


@dataclass(frozen=True)
class NamedArrays:
    """The content of a file so far, by path with ``/`` between groups.

    Args:
        arrays: matrices hold one channel in each row or column; single numbers are statements.
        runs: name of the run in a group.
        texts: other texts; the texts of every group belong to all tables.
    """

    arrays: dict[str, NDArray[np.generic]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    runs: dict[str, str] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)

    def add_text(self, path: str, text: str) -> None:
        """Add a text: the name of a run, the hold of an input, a number such as ``12 m/s``, or any other text."""
        group, _, name = path.rpartition("/")
        if name in _RUN_IDS:
            self.runs[group] = text
        elif name == "drive_hold":
            self.arrays[path] = np.array(hold_order(text))
        elif numbers := facts_in([f"{name}: {text}"]):
            # A unit may contain the character that separates the parts of a path.
            own = {heading.replace("/", "∕"): np.array(number) for heading, number in numbers.items()}
            self.arrays.update({"/".join(filter(None, (group, one))): number for one, number in own.items()})
        elif text.strip() and name:
            self.texts[path] = text


def tables_of_arrays(content: NamedArrays, kind: str) -> list[Table]:
    """Tables of arrays: arrays of the same group and length belong together.

    Single numbers are facts of the tables of their group and of the groups below. In a group without records
    they describe the other groups at its level.
    """
    facts: dict[str, dict[str, float]] = {}
    groups: dict[tuple[str, int], list[Channel]] = {}
    for path, array in content.arrays.items():
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
        unit = content.units.get(path, unit)
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
        run = content.runs.get(group)
        part = run or (group.replace("/", "-") if several else "")
        stated: dict[str, float] = {}
        for above in sorted(facts, key=len):  # the nearest group counts
            if above == "" or group == above or group.startswith(above + "/"):
                stated |= facts[above]
        said = f"{kind}: {counted(len(channels), 'channel')} of {counted(length, 'sample')}"
        tables.append(Table(tuple(channels), part, stated, (said,), named=bool(run), texts=content.texts))
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
