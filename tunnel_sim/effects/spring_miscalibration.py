"""One spring that is not as stiff as stated."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from math import isclose

import numpy as np

from tunnel_sim.effects.base import Effect, parameter
from tunnel_sim.run_settings import RunSettings


@dataclass(frozen=True)
class SpringMiscalibration(Effect):
    """One spring that is not as stiff as stated.

    Args:
        error: share by which the true stiffness exceeds the stated one, dimensionless.
        spring_stiffness: stated stiffness of the spring in question, N m/rad.
    """

    name = "spring_miscalibration"
    channel = "calibration"
    condition = "always"
    equation = "(1 + x) Kr in place of the stated Kr, in the runs of one spring"
    signature = (
        "All runs of one spring leave the line of stiffness against squared frequency by the same share."
    )
    references = ("Paper, Table II: springs 4 and 7 leave the line by −12 % and +10 %",)

    error: float = parameter(
        "x",
        "1",
        "share by which the true stiffness exceeds the stated one",
        scale=0.02,
        lower=-0.9,
        upper=9.0,
    )
    spring_stiffness: float = parameter(
        "Kr", "N m/rad", "stated stiffness of the spring in question", scale=16.12, lower=0.0, upper=1000000.0
    )

    def concerns(self, spring_stiffness: float) -> bool:
        """Whether a spring is the one in question.

        Args:
            spring_stiffness: as the campaign states it, N m/rad.

        Returns:
            Whether it is, to the sixth digit.
        """
        return isclose(spring_stiffness, self.spring_stiffness, rel_tol=1e-6)

    def on_run(self, run: RunSettings, stated: RunSettings, rng: np.random.Generator) -> RunSettings:
        """Correct the stiffness of the spring's runs."""
        del rng
        if self.is_null or not self.concerns(stated.spring_stiffness):
            return run
        return dataclasses.replace(run, spring_stiffness=run.spring_stiffness * (1.0 + self.error))
