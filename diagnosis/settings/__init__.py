"""The settings of a diagnosis that users vary: one field for each decision, with its origin.

A field weighs answers (a probability, a prior, a price), is the false-alarm rate of a test, or fits the search to a
campaign. Settings are arguments: `diagnosis.diagnose` takes them, and every fit has the settings of its data. Every
other number that decides is a constant beside its use, ``NAME: Final = value``, with its meaning, origin and reason
below it. docs/reference/settings.md lists both. Numerical constants (grids, iterations, paddings, tolerances of
solvers) are in the code that uses them, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from diagnosis.settings.stages import (
    AnswerSettings,
    GapSettings,
    NoiseSettings,
    RandomMomentSettings,
    ReadOffSettings,
    RemainderSettings,
    ScatterSettings,
    SearchSettings,
    SelectionSettings,
    WeighingSettings,
    WhereSettings,
    WordsSettings,
    WorkSettings,
)
from tunnel_sim.vocabulary.errors import TunnelError

__all__ = [
    "AnswerSettings",
    "GapSettings",
    "NoiseSettings",
    "RandomMomentSettings",
    "ReadOffSettings",
    "RemainderSettings",
    "ScatterSettings",
    "SearchSettings",
    "SelectionSettings",
    "Settings",
    "WeighingSettings",
    "WhereSettings",
    "WordsSettings",
    "WorkSettings",
]


@dataclass(frozen=True)
class Settings:
    """All settings of a diagnosis, by stage; `changed` makes a copy with other values."""

    selection: SelectionSettings = field(default_factory=SelectionSettings)
    noise: NoiseSettings = field(default_factory=NoiseSettings)
    gap: GapSettings = field(default_factory=GapSettings)
    read_off: ReadOffSettings = field(default_factory=ReadOffSettings)
    search: SearchSettings = field(default_factory=SearchSettings)
    moment: RandomMomentSettings = field(default_factory=RandomMomentSettings)
    scatter: ScatterSettings = field(default_factory=ScatterSettings)
    weighing: WeighingSettings = field(default_factory=WeighingSettings)
    where: WhereSettings = field(default_factory=WhereSettings)
    answer: AnswerSettings = field(default_factory=AnswerSettings)
    remainder: RemainderSettings = field(default_factory=RemainderSettings)
    words: WordsSettings = field(default_factory=WordsSettings)
    work: WorkSettings = field(default_factory=WorkSettings)

    def changed(self, values: Mapping[str, float]) -> Settings:
        """A copy with other values.

        Args:
            values: by name with its stage, such as ``weighing.steepness``, each in the unit of the field.

        Raises:
            TunnelError: when there is no such setting.
        """
        known, found = self.values(), self
        for full, value in values.items():
            if full not in known:
                raise TunnelError(
                    f"there is no setting {full!r}",
                    remedy="leave it out; docs/reference/settings.md has all settings, and the constants, "
                    "among them settings of earlier versions",
                )
            stage, name = full.split(".")
            group: dict[str, Any] = {stage: replace(getattr(found, stage), **{name: value})}
            found = replace(found, **group)
        return found

    def values(self) -> dict[str, float]:
        """All values by name with its stage, each in the unit of the field."""
        return {
            f"{stage.name}.{one.name}": getattr(getattr(self, stage.name), one.name)
            for stage in fields(self)
            for one in fields(getattr(self, stage.name))
        }

    def differences(self) -> dict[str, float]:
        """The values that differ from the usual ones, by name with its stage, each in the unit of the field."""
        usual = Settings().values()
        return {name: value for name, value in self.values().items() if value != usual[name]}
