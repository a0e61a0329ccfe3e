"""A slip is a function of the records, or of the evidence of the measured oscillations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from identification.examination.self_excited import Swing
from identification.status import Remark
from tunnel_sim.vocabulary.campaign import Campaign

RecordSlip = Callable[[Campaign], tuple[Campaign, tuple[Remark, ...]]]
"""A fault of the records, before any measurement: from a campaign to the campaign without the fault, with a remark
on each change, or on a fault that cannot be mended."""


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


StatementSlip = Callable[[SlipEvidence], tuple[Remark, ...]]
"""A contradicted statement: from the evidence to a remark for each, none if all statements may be right."""
