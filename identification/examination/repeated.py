"""The same record under several ids: counted once, since it holds its information once."""

from __future__ import annotations

from dataclasses import replace

from identification.remark import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign, Run


def without_repeats(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """Leave out runs that hold the samples of an earlier one.

    Args:
        campaign: the runs.

    Returns:
        The campaign with every record once, and a remark for every id that was left out. Where the same
        samples stand under other conditions, one of the two statements is wrong: that remark refuses.
    """
    first: dict[bytes, Run] = {}
    remarks = []
    for run in campaign.runs:
        earlier = first.setdefault(run.record.yaw_rad.tobytes(), run)
        if earlier is not run:
            remarks.append(_remark(earlier, run))
    if not remarks:
        return campaign, ()
    return replace(campaign, runs=tuple(first.values())), tuple(remarks)


def _remark(earlier: Run, run: Run) -> Remark:
    if _conditions(earlier) == _conditions(run):
        return Remark(
            Outcome.LEFT_OUT,
            (run.id,),
            f"the same samples as run {earlier.id}, counted once",
            "leave it out, or name its own file",
        )
    return Remark(
        Outcome.REFUSED,
        (earlier.id, run.id),
        "the same samples under another spring or wind",
        "name each run's own file, or leave one of them out",
    )


def _conditions(run: Run) -> tuple[float | None, ...]:
    return run.spring_stiffness, run.wind_speed, run.air_density if run.wind_on else None
