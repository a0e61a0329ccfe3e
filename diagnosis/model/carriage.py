"""The nominal model of a displacement: a mass on springs, without air."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from diagnosis.model.rig import SpringModel
from tunnel_sim.vocabulary.campaign import Campaign


@dataclass(frozen=True)
class Carriage(SpringModel):
    """A mass on springs of stated stiffness: m ẍ + c ẋ + k x = 0, or a force; its mass and damping are stated."""

    coefficient_units: ClassVar[Mapping[str, str]] = {
        "yaw_inertia": "kg m2",
        "mechanical_damping": "N m s/rad",
    }

    @classmethod
    def describes(cls, campaign: Campaign) -> bool:
        """Whether the air does not act on the freedom, and every run states its spring."""
        return not campaign.sensor.freedom.windy and super().describes(campaign)

    def coefficient_names(self, names: Sequence[str]) -> tuple[str, ...]:
        """Mass and damping, if they are fitted."""
        return tuple(name for name in self.coefficient_units if name in names)
