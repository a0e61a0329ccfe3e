"""What every slip is: a type with a test, a sentence and a remedy."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from identification.examination.self_excited import Swing
from identification.status import Remark
from tunnel_sim.vocabulary.campaign import Campaign


class RecordSlip(ABC):
    """A fault of the records that is seen in them before anything is measured."""

    @abstractmethod
    def mend(self, campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
        """The campaign without the fault, and a remark for what was done or cannot be done."""


@dataclass(frozen=True, eq=False)
class Seen:
    """What is stated and what the records show.

    Args:
        campaign: its records as they are used, and its sensor's zeros as they are decided from them.
        stated: the campaign as it came.
        swings: of its free decays that oscillate, in their order.
    """

    campaign: Campaign
    stated: Campaign
    swings: tuple[Swing, ...]


class StatementSlip(ABC):
    """A statement that the measured oscillations contradict."""

    @abstractmethod
    def find(self, seen: Seen) -> tuple[Remark, ...]:
        """A remark for each such statement; none where all may be right."""
