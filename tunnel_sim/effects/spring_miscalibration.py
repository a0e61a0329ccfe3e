"""One spring that is not as stiff as stated."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from math import isclose

from tunnel_sim.effects.base import SPRING_TOLERANCE, Drawn, Effect
from tunnel_sim.effects.parameters import Circumstances, Trial, parameter
from tunnel_sim.physics.run_settings import RunSettings


@dataclass(frozen=True)
class SpringMiscalibration(Effect):
    """One spring that is not as stiff as stated.

    Args:
        error: true over stated stiffness, less one, dimensionless.
        spring_stiffness: stated stiffness of the spring concerned, N m/rad.
    """

    name = "spring_miscalibration"
    place = 22
    channel = "calibration"
    condition = "always"
    advice = "Measure the stiffness of that spring again"
    equation = "(1 + x) Kr instead of the stated Kr, in the runs of one spring"
    signature = (
        "All runs of one spring lie off the line of stiffness against squared frequency by the same relative "
        "amount."
    )
    references = ("Paper, Table II: springs 4 and 7 lie off the line by −12 % and +10 %",)
    example = (0.05, 16.12)
    tries = 2

    error: float = parameter(
        "x",
        "1",
        "true over stated stiffness, less one",
        scale=0.02,
        lower=-0.9,
        upper=9.0,
    )
    spring_stiffness: float = parameter(
        "Kr",
        "N m/rad",
        "stated stiffness of the spring concerned",
        scale=16.12,
        lower=0.0,
        upper=1e6,
        chosen_spring=True,
    )

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """Every spring, where there is another to compare it with."""
        springs = campaign.springs if len(campaign.springs) > 1 else ()
        scale = cls.parameters()[0].scale
        return [Trial({"error": scale, "spring_stiffness": spring}, "error") for spring in springs]

    def on_run(self, run: RunSettings, stated: RunSettings, drawn: Drawn) -> RunSettings:
        """Correct the stiffness of the spring's runs."""
        del drawn
        concerned = isclose(stated.spring_stiffness, self.spring_stiffness, rel_tol=SPRING_TOLERANCE)
        if self.is_null or not concerned:
            return run
        return dataclasses.replace(run, spring_stiffness=run.spring_stiffness * (1.0 + self.error))
