"""The physics of many runs at once: a column for every number, for fits that predict thousands of runs."""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tunnel_sim.physics.drive import DriveMoment
from tunnel_sim.physics.moment_law import parameter_names
from tunnel_sim.physics.run_settings import RodTwist, RunSettings, Series
from tunnel_sim.vocabulary.plan import AeroDerivatives
from tunnel_sim.vocabulary.quantities import Laws, PerRun, SpeedPerRun, StiffnessPerRun
from tunnel_sim.vocabulary.record import Array

_BESIDE = ("wind_speed", "mean_speed", "release_angle", "release_rate", "duration")
_FIELDS = (
    "air_density", "spring_stiffness", "mechanical_damping", "yaw_inertia", *_BESIDE,
)  # fmt: skip
_DERIVATIVES = ("cn_beta", "cn_r")
_USUAL = {"timestep": RunSettings.timestep}
_SIZES = ("frontal_area", "reference_length", "width")


@functools.cache
def column_places() -> Mapping[str, int]:
    """The place of every column by name: the law's parameters first, in the law's order."""
    return {name: place for place, name in enumerate((*parameter_names(), *_BESIDE))}


@functools.cache
def _further() -> Mapping[str, int]:
    """Places of the law's parameters that have no field in `RunSettings`."""
    own = {*_FIELDS, *_DERIVATIVES, *_SIZES}
    return {name: place for name, place in column_places().items() if name not in own}


@dataclass(frozen=True, eq=False)
class SettingsTable:
    """The settings of many runs, which effects change in place.

    The integration step is not included, since a fit chooses its own.

    Args:
        numbers: the numbers of `RunSettings` and the law's parameters by column (`column_places`), in their units,
            shape (runs, columns).
        series: of every run, as in `RunSettings`.
        rod_twist: of every run, as in `RunSettings`.
        program: of every run, as in `RunSettings`.
        drive: of every run, as in `RunSettings`.
    """

    numbers: Array
    series: list[Mapping[str, Series]]
    rod_twist: list[RodTwist | None]
    program: list[tuple[float, ...]]
    drive: list[DriveMoment | None]

    @classmethod
    def empty(cls, count: int) -> SettingsTable:
        """A table of this many runs whose numbers are 0, until they are set."""
        numbers = np.zeros((count, len(column_places())))
        return cls(numbers, [{}] * count, [None] * count, [()] * count, [None] * count)

    @classmethod
    def of(cls, runs: Sequence[RunSettings]) -> SettingsTable:
        """A table from some runs."""
        table = cls.empty(len(runs))
        for place, run in enumerate(runs):
            table.put(place, run)
        return table

    def __len__(self) -> int:
        """Number of runs."""
        return len(self.numbers)

    def __getitem__(self, name: str) -> PerRun:
        """A column by its name, in its unit; a view, so that its values can be set."""
        column: Array = self.numbers[:, column_places()[name]]
        return column

    @property
    def spring_stiffness(self) -> StiffnessPerRun:
        """The stiffness Kr."""
        return self["spring_stiffness"]

    @property
    def wind_speed(self) -> SpeedPerRun:
        """The speed V."""
        return self["wind_speed"]

    @property
    def air_density(self) -> PerRun:
        """The density ρ, kg/m³."""
        return self["air_density"]

    @property
    def law(self) -> Laws:
        """The parameters of the moment law; a view."""
        return self.numbers[:, : len(parameter_names())]

    def copy(self) -> SettingsTable:
        """An independent copy of the table."""
        lists = (list(self.series), list(self.rod_twist), list(self.program), list(self.drive))
        return SettingsTable(self.numbers.copy(), *lists)

    def set(self, rows: slice, values: Mapping[str, float]) -> None:
        """Set parameters of the moment law in some runs.

        Args:
            values: by name, in their units.
        """
        for name, value in values.items():
            self.numbers[rows, _further()[name]] = value

    @property
    def inputs(self) -> dict[int, DriveMoment]:
        """The inputs of the driven runs by their places."""
        return {place: drive for place, drive in enumerate(self.drive) if drive is not None}

    def change_drives(
        self, by: Sequence[Hashable], changed: Callable[[Any, DriveMoment], DriveMoment]
    ) -> None:
        """Change the inputs of the driven runs; equal changes of one input give one object.

        Args:
            by: what changes the input of every run.
            changed: the input after a change.
        """
        known: dict[tuple[Hashable, DriveMoment], DriveMoment] = {}
        for place, drive in self.inputs.items():
            change = by[place]
            if (change, drive) not in known:
                known[change, drive] = changed(change, drive)
            self.drive[place] = known[change, drive]

    def row(self, place: int) -> RunSettings:
        """The settings of one run, whose numbers are not checked again; its step is the usual one."""
        numbers, places, further = self.numbers[place].tolist(), column_places(), _further()
        found = object.__new__(RunSettings)
        found.__dict__.update(
            _USUAL,
            **{name: numbers[places[name]] for name in _FIELDS},
            derivatives=AeroDerivatives(*(numbers[places[name]] for name in _DERIVATIVES)),
            parameters={name: numbers[at] for name, at in further.items() if numbers[at] != 0.0},
            series=self.series[place],
            rod_twist=self.rod_twist[place],
            program=self.program[place],
            drive=self.drive[place],
        )
        return found

    def put(self, place: int, run: RunSettings) -> None:
        """Replace the settings of one run."""
        places = column_places()
        values = {name: getattr(run, name) for name in _FIELDS}
        values |= {name: getattr(run.derivatives, name) for name in _DERIVATIVES} | dict(run.parameters)
        self.numbers[place] = 0.0
        self.numbers[place, [places[name] for name in values]] = list(values.values())
        self.series[place], self.rod_twist[place] = run.series, run.rod_twist
        self.program[place], self.drive[place] = run.program, run.drive
