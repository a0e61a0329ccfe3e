"""The examination of a campaign before any estimate, the same for every command.

The sensor may measure the yaw rate or acceleration instead of the angle: every derivative of a linear decay has
the same ωn and ζ, so the estimators treat it as an angle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.campaign.derivatives import loads
from identification.estimate import Estimate
from identification.examination.free_motion import find_release, with_zeros, without_rest
from identification.examination.self_excited import self_excited_runs, swing_of
from identification.examination.slips.base import SlipEvidence
from identification.examination.slips.table import found_in, mended
from identification.show.numbers import span
from identification.show.quantity import Quantity
from identification.status import Examined, Outcome, Remark
from tunnel_sim.files.plausible import few_samples
from tunnel_sim.vocabulary.campaign import Campaign, SensorProperties
from tunnel_sim.vocabulary.errors import counted
from tunnel_sim.vocabulary.quantities import Seconds
from tunnel_sim.vocabulary.record import CLOCK_TOLERANCE, Array, Record

_FINEST = 9  # decimals: no logger rounds to less than a nanosecond
_ON_LATTICE = 1e-3  # share of the lattice's step: rounding errors of the decimals themselves
# decimal steps that a timer's step must exceed, because any stamps would fit a finer lattice
_TIMER_DECIMALS = 10
_SWEEPS = 8
_NO_GAP = 1.75  # multiple of the usual step: a longer step may be a gap
_MOST_MISSING = 1e3  # ticks per sample: with more, the stamps are not from one clock
_SLOW = 0.3  # mean square of a step over the variance, 4 sin²(π/n): n = 11.5 samples per cycle


def noted_readings(campaign: Campaign) -> tuple[Remark, ...]:
    """Note readings that are not angles, and runs that swing by more than half a turn to either side.

    Wide swings are not noted where the campaign states ``plausible = false``.
    """
    sensor = campaign.sensor
    if sensor.derivative:
        what = (
            f"the readings are {sensor.quantity}s: omega_n and zeta describe the angle, and its amplitude "
            f"follows from them; zero and noise are in {sensor.unit}"
        )
        remedy = "state quantity = 'angle' under [sensor] if the readings are angles"
        noted = (Remark(Outcome.NOTED, tuple(run.id for run in campaign.runs), what, remedy),)
        unit = sensor.unit.replace("rad", "deg").replace("²", "2")  # in the form of the option
        return (*noted, *_wide_swings(campaign, f"if these are {unit}, import them with --unit {unit}"))
    return (*_wide_swings(campaign, "if these are degrees, name the column yaw_deg"), *_few_samples(campaign))


def _few_samples(campaign: Campaign) -> tuple[Remark, ...]:
    """Note free decays with few samples per cycle; none if the campaign states that."""
    if campaign.sensor.plausible is False:
        return ()
    found = []
    for run in campaign.decays:
        reading = run.record.yaw_rad
        # The steps of a slower motion are smaller, which is soon seen.
        if np.mean(np.diff(reading) ** 2) > _SLOW * np.var(reading) and (few := few_samples(run.record)):
            found.append(Remark(Outcome.NOTED, (run.id,), few, "check that it is not, or sample faster"))
    return tuple(found)


def _wide_swings(campaign: Campaign, remedy: str) -> tuple[Remark, ...]:
    """Note the runs that swing by more than half a turn to either side; none if the campaign states that."""
    sensor = campaign.sensor
    swings = {run.id: _swing(run.record, sensor.derivative) for run in campaign.runs}
    wide = tuple(name for name, swing in swings.items() if swing > np.pi)
    if not wide or sensor.plausible is False or not sensor.freedom.turns:
        return ()
    what = f"the angle swings by up to ±{max(swings.values()):.3g} rad, more than half a turn"
    return (Remark(Outcome.NOTED, wide, what, remedy),)


def _swing(record: Record, derivative: int) -> float:
    """Greatest angle to either side, rad; rates and accelerations are converted at their mean frequency."""
    reading, time = record.yaw_rad, record.time_s
    size = 0.5 * float(np.ptp(reading))
    if not derivative:
        return size
    crossings = int(np.count_nonzero(np.diff(np.signbit(reading - np.mean(reading)))))
    omega = np.pi * crossings / float(time[-1] - time[0])
    return size / omega**derivative if omega > 0.0 else 0.0


def as_angles(estimate: Estimate, sensor: SensorProperties) -> Estimate:
    """Convert an estimate from readings mistaken for angles to angles; others are returned unchanged.

    Amplitudes become angles, and zeros keep the unit of the reading. The initial state and the intensity of a
    random moment refer to the reading and are left out.
    """
    if sensor.derivative == 0:
        return estimate
    runs = []
    for run in estimate.runs:
        windows = []
        for window in run.windows:
            factor = window.omega_n.value**-sensor.derivative
            amplitude = Quantity(factor * window.amplitude.value, factor * window.amplitude.known_std, "rad")
            windows.append(replace(window, amplitude=amplitude))
        runs.append(
            replace(
                run,
                initial_angle=None,
                initial_rate=None,
                process_noise=None,
                sensor_zero=_in_unit(run.sensor_zero, sensor.unit),
                windows=tuple(windows),
            )
        )
    return replace(estimate, runs=tuple(runs), sensor_zero=_in_unit(estimate.sensor_zero, sensor.unit))


def _in_unit(quantity: Quantity | None, unit: str) -> Quantity | None:
    return None if quantity is None else replace(quantity, unit=unit)


def examine(campaign: Campaign) -> Examined:
    """Check a campaign's records against one another and against their stated conditions.

    Records are mended, and contradicted statements are refused or noted, by the slips of
    `identification.examination.slips.table`. The clock behind rounded time stamps replaces them. Samples before
    the release, and most of a long rest off the centre, are cut off. Wind-on runs in a limit cycle are cut to
    their linear growth, or left out. Each run has its own zero where the zeros differ.

    Raises:
        TunnelError: when a wind-on run states no air density, or a stated value is out of range.
    """
    kept, remarks, evidence = measured(campaign)
    return Examined(kept, (*remarks, *(() if evidence is None else found_in(evidence))))


def measured(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...], SlipEvidence | None]:
    """Mend the records of a campaign, and measure its free decays.

    Returns:
        The campaign, the changes made, and the evidence of its free decays; None where all runs are driven, or the
        records are refused.

    Raises:
        TunnelError: as `examine`.
    """
    for run in campaign.runs:
        loads(run, campaign.rig)
    usable, faults = mended(campaign)
    refused = tuple(remark for remark in faults if remark.outcome is Outcome.REFUSED)
    if refused:
        return campaign, refused, None
    noted = noted_readings(usable)
    usable, clocks = with_clocks(usable)
    # Driven runs neither begin with a release nor end at rest, and their input is known.
    driven, order = usable.driven_runs, [run.id for run in usable.runs]
    if driven and not usable.decays:
        return usable, (*faults, *noted, *clocks), None
    if driven:
        usable = replace(usable, runs=usable.decays)
    usable, releases = from_releases(usable)
    usable, rests = without_rest(usable)
    usable, excited = self_excited_runs(usable)
    usable, zeros = with_zeros(usable)
    swings = tuple(swing for run in usable.runs if (swing := swing_of(run)) is not None)
    evidence = SlipEvidence(usable, campaign, swings)
    if driven:
        by_id = {run.id: run for run in (*usable.runs, *driven)}
        usable = replace(usable, runs=tuple(by_id[name] for name in order if name in by_id))
    return usable, (*faults, *noted, *clocks, *releases, *rests, *excited, *zeros), evidence


def from_releases(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """Cut every record to begin at its release, with a remark for each run that was cut."""
    runs, remarks = [], []
    for run in campaign.runs:
        record, first = run.record, find_release(run.record, campaign.sensor)
        if first:
            at = float(record.time_s[first]) + run.clock_s
            what = f"release found at {at:.3f} s; the samples before it are left out"
            remarks.append(Remark(Outcome.CUT, (run.id,), what, "cut the record by hand if that is wrong"))
            run = replace(run, record=Record(record.time_s[first:], record.yaw_rad[first:]))
        runs.append(run)
    return (replace(campaign, runs=tuple(runs)) if remarks else campaign), tuple(remarks)


@dataclass(frozen=True, eq=False)
class SampleClock:
    """The uniform clock of a record's samples.

    Args:
        place: place of every sample on the clock, shape (n,); increasing, with jumps where samples are missing.
        time: time of every sample by the clock, shape (n,), s.
        away: largest deviation of a time stamp from the clock, s.
    """

    interval: Seconds
    place: NDArray[np.int64]
    time: Array
    away: float

    @property
    def missing(self) -> int:
        """Number of samples missing between the first and the last."""
        return int(self.place[-1]) + 1 - self.place.size


def with_clocks(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """Replace rounded time stamps by the uniform clock behind them, and note uneven ones and missing samples."""
    found = [(run, None if run.record.uniform else find_clock(run.record.time_s)) for run in campaign.runs]
    rounded = [
        (run, clock)
        for run, clock in found
        if clock is not None and clock.away > CLOCK_TOLERANCE * clock.interval
    ]
    uneven = [run for run, clock in found if clock is None and not run.record.uniform]
    gappy = [(run, clock) for run, clock in found if clock is not None and clock.missing]
    remarks = []
    if rounded:
        interval = span([1e3 * clock.interval for _, clock in rounded], "{:.6g}".format)
        away = max(clock.away / clock.interval for _, clock in rounded)
        what = (
            f"the time stamps are rounded, by up to {100.0 * away:.0f} % of a step; a uniform clock of "
            f"{interval} ms is used"
        )
        ids = tuple(run.id for run, _ in rounded)
        remarks.append(Remark(Outcome.NOTED, ids, what, "write time_s with more digits"))
    if uneven:
        steps = [1e3 * np.diff(run.record.time_s) for run in uneven]
        between = span([float(end) for step in steps for end in (step.min(), step.max())], "{:.6g}".format)
        what = f"the samples are not evenly spaced (steps of {between} ms); they are used at the times given"
        remedy = "check that time_s is when the samples were taken"
        remarks.append(Remark(Outcome.NOTED, tuple(run.id for run in uneven), what, remedy))
    if gappy:
        count = sum(clock.missing for _, clock in gappy)
        longest = max(float(clock.interval * (np.diff(clock.place).max() - 1)) for _, clock in gappy)
        lost = f"{counted(count, 'sample')} missing, up to {longest:.4g} s at a time"
        what = f"{lost}; the others are used at their times"
        remarks.append(Remark(Outcome.NOTED, tuple(run.id for run, _ in gappy), what, "check the logger"))
    if not rounded:
        return campaign, tuple(remarks)
    even = {run.id: replace(run, record=Record(clock.time, run.record.yaw_rad)) for run, clock in rounded}
    return replace(campaign, runs=tuple(even.get(run.id, run) for run in campaign.runs)), tuple(remarks)


def find_clock(time_s: Array) -> SampleClock | None:
    """The uniform clock that explains time stamps; samples may be missing. None if there is none.

    The stamps are ticks of the clock, rounded to their last decimal or to the ticks of a logger's timer. They
    may be off by a whole step: a logger that is itself a little late may round or truncate them.

    Args:
        time_s: time stamps, increasing, shape (n,), s.
    """
    steps = np.diff(time_s)
    usual = steps[steps < _NO_GAP * np.median(steps)]
    allowed = 0.0  # step of the coarsest decimal lattice that contains all stamps
    for decimals in range(_FINEST + 1):
        scaled = time_s * 10.0**decimals
        if np.abs(scaled - np.round(scaled)).max() < _ON_LATTICE:
            allowed = float(10.0**-decimals)
            break
    changes = np.diff(np.sort(steps))
    changes = changes[changes > max(_TIMER_DECIMALS * allowed, CLOCK_TOLERANCE * float(steps.max()))]
    if changes.size:  # all steps between stamps may be multiples of a timer's step
        whole = np.round(steps / changes.min())
        step = float(steps @ whole / (whole @ whole))
        if np.abs(steps - step * whole).max() < allowed + _ON_LATTICE * step:
            allowed = max(allowed, step)
    for interval in (float(np.mean(steps)), float(np.mean(usual))):
        for _ in range(_SWEEPS):  # to the best-fitting interval
            ticks = np.maximum(np.round(np.diff(time_s) / interval), 1.0)
            place = np.concatenate([[0.0], np.cumsum(ticks)])
            if place[-1] > _MOST_MISSING * time_s.size:
                break
            slope, start = np.polyfit(place - place.mean(), time_s, 1)
            settled = abs(slope / interval - 1.0) * place[-1] < CLOCK_TOLERANCE
            interval = float(slope)
            if settled:
                break
        if place[-1] > _MOST_MISSING * time_s.size:  # most of the record would be gaps
            continue
        clock = start + interval * (place - place.mean())
        away = float(np.abs(time_s - clock).max())
        if away <= max(allowed, CLOCK_TOLERANCE * interval):
            return SampleClock(interval, place.astype(np.int64), clock, away)
    return None
