"""The examination of a campaign before anything is estimated from it, the same for every command.

The same record under several ids is counted once. Angles beyond half a turn may be degrees. The sensor may measure
the yaw rate or acceleration instead of the angle: every derivative of a linear decay has
its ωn and ζ, so that the estimators take it as they take an angle.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.campaign.derivatives import loads
from identification.estimate import Estimate, Quantity, RunEstimate, WindowEstimate
from identification.examination.clock import with_clocks
from identification.examination.free_motion import find_release, with_zeros, without_rest
from identification.examination.labels import exchanged_labels, inertia_off_the_springs, springs_off_the_line
from identification.examination.self_excited import growing_runs, self_excited_runs, swing_of
from identification.status import Examined, Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record


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


def wide_swings(campaign: Campaign) -> tuple[Remark, ...]:
    """Note runs that swing by more than half a turn to either side.

    Returns:
        One remark on these runs; none where there are none, where the sensor does not measure an angle, or where
        the campaign states ``plausible = false``.
    """
    if campaign.sensor.derivative > 0 or campaign.sensor.plausible is False:
        return ()
    swings = {run.id: 0.5 * float(np.ptp(run.record.yaw_rad)) for run in campaign.runs}
    wide = tuple(name for name, swing in swings.items() if swing > np.pi)
    if not wide:
        return ()
    largest = max(swings.values())
    return (
        Remark(
            Outcome.NOTED,
            wide,
            f"the angle swings by up to ±{largest:.3g} rad, more than half a turn",
            "if these are degrees, name the column yaw_deg",
        ),
    )


def noted_quantity(campaign: Campaign) -> tuple[Remark, ...]:
    """Note that the readings are not angles.

    Returns:
        One remark on all runs; none where the readings are angles.
    """
    sensor = campaign.sensor
    if sensor.derivative == 0:
        return ()
    return (
        Remark(
            Outcome.NOTED,
            tuple(run.id for run in campaign.runs),
            f"the readings are {sensor.quantity}s: omega_n and zeta are those of the angle, and its amplitude "
            f"follows from them; zero and noise are in {sensor.unit}",
            "state quantity = 'angle' under [sensor] if the readings are angles",
        ),
    )


def as_angles(estimate: Estimate, sensor: SensorProperties) -> Estimate:
    """The estimate of readings that are not angles, in terms of the angle.

    Args:
        estimate: in which the reading was taken for an angle.

    Returns:
        The estimate with amplitudes of the angle and zeros in the unit of the reading. The initial state and the
        intensity of a random moment are those of the reading and are left out. The estimate itself for angles.
    """
    if sensor.derivative == 0:
        return estimate
    return replace(
        estimate,
        runs=tuple(_run(run, sensor) for run in estimate.runs),
        sensor_zero=_in_unit(estimate.sensor_zero, sensor.unit),
    )


def _run(run: RunEstimate, sensor: SensorProperties) -> RunEstimate:
    return replace(
        run,
        initial_angle=None,
        initial_rate=None,
        process_noise=None,
        sensor_zero=_in_unit(run.sensor_zero, sensor.unit),
        windows=tuple(_window(window, sensor.derivative) for window in run.windows),
    )


def _in_unit(quantity: Quantity | None, unit: str) -> Quantity | None:
    return None if quantity is None else replace(quantity, unit=unit)


def _window(window: WindowEstimate, derivative: int) -> WindowEstimate:
    factor = window.omega_n.value**-derivative
    amplitude = Quantity(factor * window.amplitude.value, factor * window.amplitude.std, "rad")
    return replace(window, amplitude=amplitude)


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
    driven = tuple(run for run in kept.runs if run.drive is not None)
    if driven:  # they neither begin with a release nor end at rest, and what sustains them is known
        free = replace(kept, runs=tuple(run for run in kept.runs if run.drive is None))
        if not free.runs:
            return Examined(kept, (*repeats, *noted, *clocks))
        examined = _free_runs(free)
        found = {run.id: run for run in (*examined.campaign.runs, *driven)}
        runs = tuple(found[run.id] for run in kept.runs if run.id in found)
        kept = replace(examined.campaign, runs=runs)
        return Examined(kept, (*repeats, *noted, *clocks, *examined.remarks))
    examined = _free_runs(kept)
    return Examined(examined.campaign, (*repeats, *noted, *clocks, *examined.remarks))


def _free_runs(kept: Campaign) -> Examined:
    kept, releases = from_releases(kept)
    kept, rests = without_rest(kept)
    kept, excited = self_excited_runs(kept)
    kept, zeros = with_zeros(kept)
    swings = [swing for run in kept.runs if (swing := swing_of(run)) is not None]
    faults = growing_runs(swings) or exchanged_labels(swings)
    faults = faults or (*springs_off_the_line(swings), *inertia_off_the_springs(swings, kept))
    return Examined(kept, (*releases, *rests, *excited, *zeros, *faults))


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
