"""The judgement of a diagnosis, as far as the words of a finding may depend on it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from diagnosis.settings import Settings
from diagnosis.where.maps import Maps
from identification.show.quantity import Quantity
from identification.status import Remark


@dataclass(frozen=True)
class Misfit:
    """Conversion from an excess to a misfit.

    Args:
        noise: standard deviation of one sample's noise, against which excesses are measured, in ``unit``.
        swing: root mean square of the readings about the mean of each run, in ``unit``.
        unit: of the readings: ``rad``, ``rad/s`` or ``rad/s2``.
    """

    noise: float
    swing: float
    unit: str

    def rms(self, excess: float) -> float:
        """Root mean square in ``unit`` of an excess in noise variances of a sample; below zero it is chance."""
        return self.noise * math.sqrt(max(excess, 0.0))

    def of_swing(self, excess: float) -> float | None:
        """The same as a share of the swing; None where the readings do not move."""
        return self.rms(excess) / self.swing if self.swing > 0.0 else None


class Judged(Protocol):
    """The judgement of a diagnosis in plain values: all that the words of a finding know beside its own fields."""

    @property
    def campaign(self) -> str:
        """The name of the campaign."""

    @property
    def causes(self) -> tuple[str, ...]:
        """Effect names, sorted; ``unknown``, or none."""

    @property
    def names_effects(self) -> bool:
        """Whether the answer names effects."""

    @property
    def settings(self) -> Settings:
        """The settings with which the diagnosis was made."""

    @property
    def decided(self) -> bool:
        """Whether the answer is decided."""

    @property
    def likely(self) -> float:
        """Probability of the likeliest answer, a fraction."""

    @property
    def misfit(self) -> Misfit | None:
        """The conversion from an excess to a misfit; None where it is not known."""

    @property
    def maps(self) -> Maps | None:
        """The data of the figures; None for an answer without them."""

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Remarks of the examination."""

    @property
    def between_runs_remain(self) -> bool:
        """Whether differences between the runs could explain what remains."""

    @property
    def coefficients_after(self) -> Mapping[str, Quantity]:
        """The coefficients with the causes, by name."""

    @property
    def set_out(self) -> str:
        """The name of the answer whose parameters are stated, such as ``most probable answer``."""

    @property
    def cycling(self) -> bool:
        """Whether every run is in a limit cycle."""

    @property
    def rest_is_significant(self) -> bool:
        """Whether a gap remains beyond chance."""

    @property
    def rest_is_material(self) -> bool:
        """Whether it may move a coefficient."""
