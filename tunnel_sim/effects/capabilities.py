"""What an effect can do beyond a term of the moment law: each capability is a type, and an effect may have two.

A hook stands on the type that has it, so an effect without the capability is never asked.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tunnel_sim.effects.base import Drawn, Effect
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True)
class BetweenRuns(Effect):
    """A number of the run that is (1 + σ e) times as great as stated, with e drawn from the unit normal.

    Traits of its own:

    - ``scatters``: the number: ``wind_speed``, ``spring_stiffness`` or ``mechanical_damping``.
    """

    scatters: ClassVar[str]
    fitted = False
    autonomous = False

    def draw(self, stated: RunSettings, rng: np.random.Generator) -> Drawn:
        """Draw the run's deviation, in standard deviations."""
        del stated
        return float(rng.standard_normal())

    def on_run(self, run: RunSettings, stated: RunSettings, drawn: Drawn) -> RunSettings:
        """Scale the number by the run's own factor."""
        del stated
        return run if self.is_null else run.with_deviations({self.scatters: self.deviation(drawn)})

    def deviation(self, drawn: Drawn) -> float:
        """The run's own deviation, relative."""
        return self.severity * self.drawn_number(drawn)

    @classmethod
    @abstractmethod
    def departure(
        cls, spring: Array, damping: Array, air_stiffness: Array, air_damping: Array
    ) -> tuple[Array | float, Array | float, float]:
        """Change of the runs' linear motions by a relative deviation of 1 of the scattering number.

        Args:
            spring: Kr, N m/rad, shape (runs,).
            damping: Cr, N m s/rad, shape (runs,).
            air_stiffness: Ka of the run, N m/rad, shape (runs,).
            air_damping: Ca of the run, N m s/rad, shape (runs,).

        Returns:
            Changes of the stiffness Kr − Ka, N m/rad, of the damping Cr − Ca, N m s/rad, and of the wind speed, a
            share of it.
        """
