"""Chance differences between runs in a fit: how a run's own deviation changes its motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from diagnosis.model.data import Data
from diagnosis.model.parameters import Parameter, RunParameterPrior
from tunnel_sim.effects import ALL_EFFECTS, BetweenRuns, Effect
from tunnel_sim.effects.base import Drawn
from tunnel_sim.effects.capabilities import Periodic
from tunnel_sim.physics.run_settings import SettingsTable
from tunnel_sim.vocabulary.plan import AeroDerivatives
from tunnel_sim.vocabulary.record import Array

_WIDE = 10.0  # size for steps of finite differences, in widths of a usual scatter
#: Least share of the air's damping to which deviations of the damping are relative: a bearing may have none.
_LEAST_DAMPING = 0.1


@dataclass(frozen=True)
class Chance:
    """One chance difference between runs: of the wind speed, the spring or the damping.

    A deviation changes the linear stiffness and damping of its run, relative to the nominal model's values.
    Effects that depend on the speed or the spring ignore it, so that a deviation does not follow an error of
    their form. The exception is vortex shedding, which follows the true speed; at the stated speed its phase
    would be lost within some cycles.

    Args:
        kind: the effect of the vocabulary that the difference is.
        width: standard deviation of the runs' relative deviations, dimensionless.
        derivatives: aerodynamic derivatives of the nominal model.
        damping: mechanical damping of the nominal model, N m s/rad.
        shown: whether the runs show that they differ in this quantity rather than in the others, beyond the
            stated scatter.
    """

    kind: type[BetweenRuns]
    width: float
    derivatives: AeroDerivatives
    damping: float
    shown: bool = False

    @property
    def name(self) -> str:
        """Name of the effect, and of a run's own deviation."""
        return self.kind.name

    @property
    def usual(self) -> float:
        """Usual width."""
        return self.kind.parameters()[0].scale

    @property
    def parameter(self) -> Parameter:
        """A run's own relative deviation."""
        return Parameter(
            self.name, "1", size=_WIDE * self.usual, owner="per_run", prior=RunParameterPrior(self.width)
        )

    def as_wide_as(self, width: float) -> Chance:
        """The same differences with another width."""
        return replace(self, width=float(width))

    def change(self, stated: SettingsTable, data: Data) -> Array:
        """The changes by a relative deviation of 1.

        Args:
            stated: the nominal physics of the runs.

        Returns:
            Changes of stiffness, N m/rad, damping, N m s/rad, and wind speed as a share, shape
            (runs, 3).
        """
        pressure, speed = data.air_moments(stated), stated.wind_speed
        rate = pressure * data.reference_length / np.where(speed > 0.0, speed, np.inf)
        stiffness, damping = pressure * self.derivatives.cn_beta, rate * self.derivatives.cn_r
        own = np.maximum(self.damping, _LEAST_DAMPING * np.abs(damping))
        changes = self.kind.departure(stated.spring_stiffness, own, stiffness, damping)
        return np.stack([np.broadcast_to(change, speed.shape) for change in changes], axis=1)


_KEEPING_TIME = tuple(
    kind.frequency_by_wind for kind in ALL_EFFECTS if issubclass(kind, Periodic) and kind.frequency_by_wind
)


class RunDeparture(Effect):
    """The change of a run's motion by its own deviations: not an effect of the vocabulary, and last in a chain."""

    name = "run_departure"

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Add stiffness and damping, and change the wind's speed by a share; ``drawn`` in this order."""
        del stated
        added = np.stack([effect.drawn_numbers(d) for effect, d in zip(effects, drawn, strict=True)])
        runs.spring_stiffness[:] = np.maximum(runs.spring_stiffness + added[:, 0], 0.0)
        runs["mechanical_damping"][:] += added[:, 1]
        for name in _KEEPING_TIME:
            runs[name][:] *= 1.0 + added[:, 2]


#: The chance differences of a fit.
Scatter = tuple[Chance, ...]


def departure(scatter: Sequence[Chance], deviations: Array, stated: SettingsTable, data: Data) -> Array:
    """The changes by the deviations of runs.

    Args:
        deviations: relative deviations, by run one for each chance difference, shape (runs, differences).
        stated: the nominal physics of the runs.

    Returns:
        Changes of the stiffness, N m/rad, of the damping, N m s/rad, and of the wind speed as a share,
        shape (runs, 3).
    """
    changes = np.stack([one.change(stated, data) for one in scatter])
    return np.asarray(np.einsum("drk,rd->rk", changes, deviations), np.float64)
