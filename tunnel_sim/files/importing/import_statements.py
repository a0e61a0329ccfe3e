"""Statements to an import outside the content of a file: choices, a calibration, a table of conditions, names."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.column_numbers import Calibration, read_calibration
from tunnel_sim.files.importing.condition_names import Conditions, Hint
from tunnel_sim.files.importing.condition_table import ConditionTable
from tunnel_sim.files.importing.file_names import from_name, name_hints, name_pattern
from tunnel_sim.files.reading import stem_of
from tunnel_sim.vocabulary.errors import TunnelError, shown
from tunnel_sim.vocabulary.freedom import Freedom


@dataclass(frozen=True, eq=False)
class ImportStatements:
    """Statements outside the content of the files.

    Args:
        table: table of conditions; None: there is none.
        hints: by file, conditions that the name of the file seems to state.
        several: whether the names of runs must name their file among others.
        later: whether missing air densities may be stated later.
    """

    choices: ImportChoices
    calibration: Calibration | None
    table: ConditionTable | None
    pattern: re.Pattern[str] | None
    hints: Mapping[Path, Sequence[Hint]]
    several: bool
    later: bool

    @classmethod
    def of(
        cls, files: Sequence[Path], choices: ImportChoices, table: Path | None, *, several: bool, later: bool
    ) -> ImportStatements:
        """The statements on some files."""
        return cls(
            choices,
            read_calibration(choices.calibration),
            None if table is None else ConditionTable(table),
            None if choices.name is None else name_pattern(choices.name),
            name_hints(files) if files else {},
            several,
            later,
        )

    def about(self, freedom: Freedom) -> ImportStatements:
        """The statements on readings of a freedom: under the keys of an angle, in still air where there is none.

        Raises:
            TunnelError: for a condition that the freedom does not have.
        """
        if self.table is not None and self.table.displaced and freedom.turns:
            what = (
                f"the column '{self.table.displaced}' is of a displacement, and the readings are of an angle"
            )
            raise TunnelError(
                what, where=shown(self.table.path), remedy="give it in the unit of an angle, or --unit"
            )
        stated = self.choices.conditions.model_dump(exclude_none=True)
        motion = stated.pop("motion", freedom.motion)
        if motion != freedom.motion:
            what = (
                f"a condition is in a unit of motion = '{motion}', and the readings are of '{freedom.motion}'"
            )
            raise TunnelError(
                what, where="--set", remedy="correct its unit, or give --unit with the readings'"
            )
        own = freedom.as_angle(stated, "--set", imported=True)
        if not freedom.windy:
            own = {"wind_speed": 0.0, **own}
        return replace(self, choices=self.choices.model_copy(update={"conditions": Conditions(**own)}))

    def named(self, file: Path) -> dict[str, float]:
        """Conditions in the name of a file, which must match the pattern if there is one."""
        return from_name(self.pattern, file)

    def of_file(self, file: Path) -> dict[str, float]:
        """Conditions of a whole file, from its name or the table; the table may have rows for runs instead."""
        found = self.named(file)
        if self.table is not None:
            with suppress(TunnelError):
                found |= self.table.of(file, stem_of(file))
        return found
