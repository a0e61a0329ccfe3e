"""A campaign as the fits see it: its prepared runs and their nominal model; and the groups of runs to leave out."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diagnosis.model.nominal import NominalModel
from diagnosis.model.run_data import PreparedRuns, RunData
from diagnosis.model.similarity import AS_MEASURED, Similarity
from diagnosis.settings import Settings
from tunnel_sim.effects import Effect
from tunnel_sim.vocabulary.campaign import speed_groups
from tunnel_sim.vocabulary.freedom import ANGLE, Freedom

FOLDS = 3  # number of groups of runs that are left out in turn


@dataclass(frozen=True, eq=False)
class Data(PreparedRuns):
    """A campaign as the fits see it.

    Args:
        model: nominal model of the campaign; a part of its runs has the same parameters.
        similarity: how the campaign was made from the measured one.
        settings: settings of the diagnosis.
        freedom: freedom of the body.
    """

    model: NominalModel
    similarity: Similarity = AS_MEASURED
    settings: Settings = field(default_factory=Settings)
    freedom: Freedom = ANGLE

    @property
    def wind_on(self) -> bool:
        """Whether any run of the campaign has the wind on."""
        return self.model.windy

    def acts(self, kind: type[Effect]) -> NDArray[np.bool_]:
        """The runs in which an effect acts, shape (runs,)."""
        return np.array([kind.acts(wind_on=run.wind_on) for run in self.runs], np.bool_)

    def may_show(self, kind: type[Effect]) -> bool:
        """Whether the campaign has the wind or the input that an effect needs."""
        return kind.acts(wind_on=self.wind_on) and (self.driven or not kind.driven)

    def with_runs(self, runs: tuple[RunData, ...]) -> Data:
        """Other runs of the same campaign, with the same parameters."""
        return dataclasses.replace(self, runs=runs)

    def with_inputs(self, **change: Any) -> Data:
        """The same runs with changed fields of their inputs (`InputMoment`)."""
        return self.with_runs(tuple(run.with_input(**change) for run in self.runs))

    def undriven(self) -> Data:
        """The same runs as free decays, with the same parameters."""
        if not self.driven:
            return self
        return self.with_runs(tuple(run.undriven() for run in self.runs))

    def subset(self, keep: tuple[str, ...]) -> Data:
        """The runs of the given ids."""
        return self.with_runs(tuple(run for run in self.runs if run.id in keep))

    def alone(self, keep: tuple[str, ...]) -> Data:
        """The runs of the given ids by themselves, with only the parameters that they show."""
        runs = self.subset(keep).runs
        return dataclasses.replace(self, runs=runs, model=self.model.among(runs))


def folds(data: Data, count: int = FOLDS) -> list[tuple[str, ...]]:
    """Groups of runs to leave out in turn.

    Args:
        count: number of groups, fewer if there are few runs.

    Returns:
        Ids by group. Runs with the same wind and spring go to different groups. The remaining runs always
        include every spring, wind-off runs, wind-on runs and an input of unknown gain, since the others could
        not be predicted without them. The only run of its kind is in no group.
    """
    setting = speed_groups(run.wind_speed for run in data.runs)
    order = sorted(
        data.runs, key=lambda run: (run.wind_on, run.spring_stiffness or 0.0, setting[run.wind_speed])
    )
    free = [run for run in order if _covers(data, [run])]
    count = min(count, len(free))
    if count < 2:
        return []
    groups: list[list[RunData]] = [[] for _ in range(count)]
    for i, run in enumerate(free):
        for turn in range(count):
            group = groups[(i + turn) % count]
            if _covers(data, [*group, run]):
                group.append(run)
                break
    return [tuple(run.id for run in group) for group in groups if group]


def _covers(data: Data, left_out: list[RunData]) -> bool:
    """Whether the other runs have every spring, wind on and off, and an input of unknown gain, as all runs have."""
    gone = {run.id for run in left_out}

    def kinds(runs: Sequence[RunData]) -> tuple[set[object], ...]:
        return (
            {run.multiplied_by for run in runs},
            {run.spring_stiffness for run in runs},
            {run.wind_on for run in runs},
        )

    return kinds(data.runs) == kinds([run for run in data.runs if run.id not in gone])
