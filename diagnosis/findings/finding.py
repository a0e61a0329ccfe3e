"""The types of a finding: its numbers, its words and tables, its figures and next steps, and the judgement.

A finding is a frozen dataclass of typed fields with units; they are also its JSON. Each finding is a field of
`Findings`: the document, its schema, the terminal, the report, the bench and notebooks need no other entry.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

from diagnosis.answer.sizes_by_run import SizeByRun
from diagnosis.findings.misfit import Misfit
from diagnosis.search.study import Study
from diagnosis.settings import Settings
from identification.show.blocks import Figure, Section
from identification.show.drawing import in_words
from identification.show.quantity import Quantity
from identification.status import Remark
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.freedom import ANGLE, Freedom

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing


@dataclass(frozen=True, eq=False)
class Answered:
    """The results from which a finding is computed.

    Args:
        campaign: the measured campaign.
        study: study of the similar campaign, its causes confirmed.
        before: coefficients of the nominal model, by name, in the units of the measured campaign.
        after: coefficients with the causes, by the same names; in phase with the motion, like those before, where
            a lag is named.
        sizes: sizes of the fitted causes in every run, in the units of the similar campaign; empty: not known.
    """

    campaign: Campaign
    study: Study
    before: Mapping[str, Quantity]
    after: Mapping[str, Quantity]
    sizes: Sequence[SizeByRun] = ()


@dataclass(frozen=True)
class Picture:
    """A figure of a finding.

    Args:
        name: unique among the figures of a page.
        caption: text below the figure.
        description: text alternative of the figure.
        draw: function that returns matplotlib's figure; None where there is nothing to draw.
    """

    name: str
    caption: str
    description: str
    draw: Callable[[], Drawing | None]

    @property
    def block(self) -> Figure:
        """The figure as a block of a section."""
        return Figure(self.name, self.caption)

    def of(self, freedom: Freedom, names: Sequence[str]) -> Picture:
        """The figure in the words of a freedom.

        Args:
            names: the user's names, which are not translated.
        """
        if freedom is ANGLE:
            return self
        caption, description = (freedom.words(text, names) for text in (self.caption, self.description))

        def draw() -> Drawing | None:
            drawn = self.draw()
            return None if drawn is None else in_words(drawn, freedom, names)

        return Picture(self.name, caption, description, draw)


class Finding:
    """A finding of a diagnosis with a section of its own."""

    #: Key of the section of a page after which its own stands.
    after: ClassVar[str]

    @classmethod
    def find(cls, answered: Answered) -> Self | None:
        """Compute the finding; None where the runs do not give one."""
        raise NotImplementedError

    def section(self, judged: Judged) -> Section:
        """Its words and tables."""
        raise NotImplementedError

    def pictures(self, judged: Judged) -> tuple[Picture, ...]:
        """Its figures."""
        del judged
        return ()


class Judged(Protocol):
    """The judgement of a diagnosis in plain values, for the words of a finding beside its own fields."""

    @property
    def campaign(self) -> str:
        """The name of the campaign."""

    @property
    def causes(self) -> tuple[str, ...]:
        """Effect names, sorted; ``unknown``, or none."""

    @property
    def freedom(self) -> Freedom:
        """The freedom of the body."""

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
        """The name of the answer that supplies the stated parameters, such as ``most probable answer``."""

    @property
    def cycling(self) -> bool:
        """Whether every run is in a limit cycle."""

    @property
    def rest_is_significant(self) -> bool:
        """Whether a gap remains beyond chance."""

    @property
    def rest_is_material(self) -> bool:
        """Whether the remaining gap may move a coefficient."""


@dataclass(frozen=True)
class NextStep:
    """A step for the rig.

    Args:
        what: the thing to do, a sentence without its full stop.
        gain: gain of the step, a clause such as ``removes 98 % of the gap``; empty where ``what`` contains it.
    """

    what: str
    gain: str = ""

    @property
    def words(self) -> str:
        """The step with its gain, a sentence."""
        return f"{self.what}{f': {self.gain}' if self.gain else ''}."


@dataclass(frozen=True)
class SecondReading:
    """What a cause of the answer may be instead, where the runs do not tell the two apart.

    Args:
        cause: the effect of the answer.
        instead: the other reading in a few words, such as ``wrong hold``.
        words: the sentences on it.
        step: how to tell the two apart.
        figures: the quantities in the sentences, by name, in JSON's types: times in s, a stiffness as the campaign
            states it, its error and deviation as fractions.
    """

    cause: str
    instead: str
    words: str
    step: NextStep
    figures: Mapping[str, Any] = field(default_factory=dict)
