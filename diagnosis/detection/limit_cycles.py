"""Runs in a limit cycle are not free decays: they are left out, or are the whole answer."""

from __future__ import annotations

from dataclasses import dataclass, replace

from identification.examination.clock import with_clocks
from identification.examination.examine import examine
from identification.examination.self_excited import in_limit_cycle
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign

_LEFT_OUT = "left out of the diagnosis, which compares free decays"


@dataclass(frozen=True)
class Diagnosable:
    """The runs to diagnose.

    Args:
        limit_cycles: whether they are all in limit cycles, so that no decay remains.
    """

    campaign: Campaign
    remarks: tuple[Remark, ...]
    limit_cycles: bool = False


def diagnosable(campaign: Campaign) -> Diagnosable:
    """Examine a campaign, and separate its free decays from runs in a limit cycle.

    Returns:
        The free decays; the whole records of all runs where every one is in a limit cycle.

    Raises:
        TunnelError: when the examination refuses the records.
    """
    examined = examine(campaign).accepted()
    cycling = {name for r in examined.remarks if in_limit_cycle(r.figures) for name in r.runs}
    decays = tuple(run for run in examined.campaign.runs if run.id not in cycling)
    remarks = tuple(
        replace(r, outcome=Outcome.LEFT_OUT, remedy=_LEFT_OUT) if in_limit_cycle(r.figures) else r
        for r in examined.remarks
    )
    if not cycling:
        return Diagnosable(examined.campaign, examined.remarks)
    if decays:
        return Diagnosable(replace(examined.campaign, runs=decays), remarks)
    whole, _ = with_clocks(replace(campaign, runs=tuple(r for r in campaign.runs if r.id in cycling)))
    return Diagnosable(whole, examined.remarks, limit_cycles=True)
