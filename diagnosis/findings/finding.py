"""A finding: its numbers, its words and tables, and its figures, in one file.

A finding is a frozen dataclass of typed fields with units, which are also its JSON. `Findings` has a field for each;
that line is all that the document, its schema, the terminal, the report, the bench and notebooks need of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Protocol, Self

from diagnosis.findings.coefficients import Coefficients
from diagnosis.search.study import Study
from diagnosis.settings import Settings
from identification.show.blocks import Figure, Section
from tunnel_sim.vocabulary.campaign import Campaign

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing


class Judged(Protocol):
    """The judgement of a diagnosis in plain values: all that the words of a finding know beside its own fields."""

    @property
    def causes(self) -> tuple[str, ...]:
        """Effect names, sorted; ``unknown``, or none."""

    @property
    def names_effects(self) -> bool:
        """Whether the answer names effects."""

    @property
    def settings(self) -> Settings:
        """The settings with which the diagnosis was made."""


@dataclass(frozen=True, eq=False)
class Answered:
    """The numbers from which a finding is found.

    Args:
        campaign: the measured one.
        study: of the similar campaign, its causes confirmed.
        coefficients: before and after the causes are added, in the units of the measured campaign.
    """

    campaign: Campaign
    study: Study
    coefficients: Coefficients


@dataclass(frozen=True)
class Picture:
    """A figure of a finding.

    Args:
        name: unique among the figures of a page.
        caption: below it.
        description: its text alternative.
        draw: matplotlib's figure; None where there is nothing to draw.
    """

    name: str
    caption: str
    description: str
    draw: Callable[[], Drawing | None]

    @property
    def block(self) -> Figure:
        """Its place in a section."""
        return Figure(self.name, self.caption)


class Finding:
    """A finding of a diagnosis."""

    #: Key of the section of a page after which its own stands.
    after: ClassVar[str]

    @classmethod
    def find(cls, answered: Answered) -> Self | None:
        """The finding; None where these runs give none."""
        raise NotImplementedError

    def section(self, judged: Judged) -> Section:
        """Its words and tables."""
        raise NotImplementedError

    def pictures(self, judged: Judged) -> tuple[Picture, ...]:
        """Its figures."""
        del judged
        return ()
