"""The tables of differences between runs, in ``campaign.toml`` and in a plan."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from tunnel_sim.files.toml_input import StrictModel, optional
from tunnel_sim.vocabulary.between_runs import LARGEST_DRIFT, WIDEST_SCATTER, Repeatability, Scatter

Spread = Annotated[float, Field(ge=0.0, lt=1.0)]
SPREAD = "a relative standard deviation from 0 to below 1, such as 0.003"


class RepeatabilityTable(StrictModel):
    """``[repeatability]``."""

    wind_speed: Spread | None = optional(SPREAD)
    spring_stiffness: Spread | None = optional(SPREAD)
    mechanical_damping: Spread | None = optional(SPREAD)

    @property
    def value(self) -> Repeatability | None:
        """The value stated by the table; None if the table is empty."""
        found = Repeatability(**self.model_dump())
        return found if found.stated else None


Width = Annotated[float, Field(ge=0.0, le=WIDEST_SCATTER)]
_WIDTH = f"a relative standard deviation from 0 to {WIDEST_SCATTER:g}, such as 0.003"
ZeroWidth = Annotated[float, Field(ge=0.0, le=1.0)]
Drift = Annotated[float, Field(ge=-LARGEST_DRIFT, le=LARGEST_DRIFT)]
_DRIFT = f"the relative change from the first to the last run, from {-LARGEST_DRIFT:g} to {LARGEST_DRIFT:g}"


class ScatterTable(StrictModel):
    """``[scatter]``: differences between the runs."""

    wind_speed: Width = Field(default=0.0, description=_WIDTH)
    spring_stiffness: Width = Field(default=0.0, description=_WIDTH)
    mechanical_damping: Width = Field(default=0.0, description=_WIDTH)
    zero: ZeroWidth = Field(default=0.0, description="a standard deviation from 0 to 1 rad")
    spring_stiffness_drift: Drift = Field(default=0.0, description=_DRIFT)
    wind_speed_drift_between_runs: Drift = Field(default=0.0, description=_DRIFT)

    @property
    def value(self) -> Scatter:
        """The value stated by the table."""
        return Scatter(**self.model_dump())
