"""The same record under several ids is counted once."""

from __future__ import annotations

from dataclasses import replace

from identification.remark import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign, Run


def without_repeats(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """Leave out runs that hold the samples of an earlier one.

    Returns:
        The campaign with every record once, and a remark for every id that was left out. The same samples under
        different conditions are refused: one of the two statements is wrong.
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
            f"the same samples as run {earlier.id}, so counted once",
            "remove the run, or correct its file name",
        )
    return Remark(
        Outcome.REFUSED,
        (earlier.id, run.id),
        "the same samples with different springs or wind speeds",
        "correct the file names, or remove one of the runs",
    )


def _conditions(run: Run) -> tuple[float | None, ...]:
    return run.spring_stiffness, run.wind_speed, run.air_density if run.wind_on else None
