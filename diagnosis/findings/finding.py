"""A finding: its numbers, its words and tables, and its figures, in one file.

A finding is a frozen dataclass of typed fields with units, which are also its JSON. `Findings` has a field for it;
that line is all that the document, its schema, the terminal, the report, the bench and notebooks need of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self

from diagnosis.findings.judged import Judged
from diagnosis.search.study import Study
from identification.show.blocks import Figure, Section
from identification.show.quantity import Quantity
from tunnel_sim.vocabulary.campaign import Campaign

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing


@dataclass(frozen=True, eq=False)
class Answered:
    """The numbers from which a finding is found.

    Args:
        campaign: the measured one.
        study: of the similar campaign, its causes confirmed.
        before: coefficients of the nominal model, by name, in the units of the measured campaign.
        after: with the causes, by the same names.
    """

    campaign: Campaign
    study: Study
    before: Mapping[str, Quantity]
    after: Mapping[str, Quantity]


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


class Pictured:
    """A value of a diagnosis with figures."""

    def pictures(self, judged: Judged) -> tuple[Picture, ...]:
        """Its figures."""
        raise NotImplementedError


class Finding(Pictured):
    """A finding of a diagnosis with a section of its own."""

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
