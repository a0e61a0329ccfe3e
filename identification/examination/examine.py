"""The examination of a campaign before anything is estimated from it, the same for every command."""

from __future__ import annotations

from dataclasses import replace

from identification.campaign.derivatives import loads
from identification.examination.clock import with_clocks
from identification.examination.growth import growing_runs
from identification.examination.labels import exchanged_labels
from identification.examination.rates import noted_quantity
from identification.examination.release import find_release
from identification.examination.repeated import without_repeats
from identification.examination.rest import without_rest
from identification.examination.self_excited import self_excited_runs
from identification.examination.spring_line import inertia_off_the_springs, springs_off_the_line
from identification.examination.swings import swing_of
from identification.examination.turns import wide_swings
from identification.examination.zeros import with_zeros
from identification.remark import Examined, Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record


def examine(campaign: Campaign) -> Examined:
    """Check a campaign's records against one another and against what is stated of them.

    Repeated records are counted once. Rounded time stamps are replaced by the clock behind them. Samples before
    the release, and most of a long rest beside the centre, are cut off. Wind-on runs in a limit cycle are cut to
    their linear growth, or left out. Runs whose zeros differ get one each. Motion that grows with the wind off,
    and springs or wind speeds assigned to the wrong runs, are refused. Springs that do not fit the frequencies,
    and an inertia that does not fit the springs, are noted.

    Returns:
        The campaign to identify and the remarks; the given campaign itself if nothing is wrong.

    Raises:
        TunnelError: when a wind-on run states no air density, or a stated value is out of range.
    """
    for run in campaign.runs:
        loads(run, campaign.rig)
    kept, repeats = without_repeats(campaign)
    if any(remark.outcome is Outcome.REFUSED for remark in repeats):
        return Examined(campaign, repeats)
    noted = (*noted_quantity(kept), *wide_swings(kept))
    kept, clocks = with_clocks(kept)
    kept, releases = from_releases(kept)
    kept, rests = without_rest(kept)
    kept, excited = self_excited_runs(kept)
    kept, zeros = with_zeros(kept)
    swings = [swing for run in kept.runs if (swing := swing_of(run)) is not None]
    faults = growing_runs(swings) or exchanged_labels(swings)
    faults = faults or (*springs_off_the_line(swings), *inertia_off_the_springs(swings, kept))
    return Examined(kept, (*repeats, *noted, *clocks, *releases, *rests, *excited, *zeros, *faults))


def from_releases(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """Cut every record to begin at its release.

    Returns:
        The campaign, itself if every record begins at its release already, and a remark for each run that was cut.
    """
    found = [_from_release(run, campaign.sensor) for run in campaign.runs]
    remarks = tuple(remark for _, remark in found if remark is not None)
    return (replace(campaign, runs=tuple(run for run, _ in found)) if remarks else campaign), remarks


def _from_release(run: Run, sensor: SensorProperties) -> tuple[Run, Remark | None]:
    first = find_release(run.record, sensor)
    if first == 0:
        return run, None
    record = run.record
    remark = Remark(
        Outcome.CUT,
        (run.id,),
        f"release found at {record.time_s[first]:.3f} s; the samples before it are left out",
        "cut the record by hand if that is wrong",
    )
    return replace(run, record=Record(record.time_s[first:], record.yaw_rad[first:])), remark
