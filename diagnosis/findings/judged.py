"""The judgement of a diagnosis, as far as the words of a finding may depend on it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from diagnosis.findings.misfit import Misfit
from diagnosis.settings import Settings
from identification.show.quantity import Quantity
from identification.status import Remark


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
    def misfit(self) -> Misfit:
        """The conversion from an excess to a misfit."""

    @property
    def windy(self) -> bool:
        """Whether any run had wind; True for an answer without the data of its figures."""

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
