"""The types of slips, each with a test, a sentence and a remedy."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from identification.examination.self_excited import Swing
from identification.status import Remark
from tunnel_sim.vocabulary.campaign import Campaign


class RecordSlip(ABC):
    """A fault of the records that they show before any measurement."""

    @abstractmethod
    def mend(self, campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
        """The campaign without the fault, with a remark on each action, or on a fault that cannot be mended."""


@dataclass(frozen=True, eq=False)
class SlipEvidence:
    """The statements of a campaign and the evidence of its records.

    Args:
        campaign: the records in use, with the sensor's zeros decided from them.
        stated: the campaign as given.
        swings: swings of the campaign's oscillating free decays, in their order.
    """

    campaign: Campaign
    stated: Campaign
    swings: tuple[Swing, ...]


class StatementSlip(ABC):
    """A statement that the measured oscillations contradict."""

    @abstractmethod
    def find(self, evidence: SlipEvidence) -> tuple[Remark, ...]:
        """A remark for each contradicted statement; none if all may be right."""
