"""A slip is a function of the records, or of the evidence of the measured oscillations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import pi

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


STIFFNESS_UNITS: Mapping[str, float] = {
    "N mm/rad": 1e3,
    "N cm/rad": 1e2,
    "N m/deg": pi / 180.0,
    "kgf m/rad": 1.0 / 9.80665,
    "lbf in/rad": 8.8507,
}
"""A stiffness in units that are taken for N m/rad, over the stiffness in N m/rad."""

StatementSlip = Callable[[SlipEvidence], Remark | None]
"""A contradicted statement: from the evidence to a remark, None if all statements may be right."""
