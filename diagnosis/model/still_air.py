"""The nominal model of a body on springs in still air."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from diagnosis.model.rig import SpringModel
from tunnel_sim.vocabulary.campaign import Campaign


@dataclass(frozen=True)
class StillAir(SpringModel):
    """A body on springs of stated stiffness: I ψ̈ + C ψ̇ + K ψ = 0, or a moment; its inertia and damping are stated.

    For a displacement they are mass and damping, and the moment is a force.
    """

    coefficient_units: ClassVar[Mapping[str, str]] = {
        "yaw_inertia": "kg m2",
        "mechanical_damping": "N m s/rad",
    }

    @classmethod
    def describes(cls, campaign: Campaign) -> bool:
        """Whether the air does not act in any run, and every run states its spring."""
        windy = campaign.sensor.freedom.windy and any(run.wind_speed for run in campaign.runs)
        return not windy and super().describes(campaign)

    def coefficient_names(self, names: Sequence[str]) -> tuple[str, ...]:
        """Inertia and damping, if they are fitted."""
        return tuple(name for name in self.coefficient_units if name in names)
