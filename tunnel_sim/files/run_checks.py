"""Checks of a run before anything is estimated from it: increasing times, angles in radians, three cycles."""

from __future__ import annotations

import numpy as np

from tunnel_sim.files.plausible import KEEP
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.cycles import count_cycles
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array, Record

# If milliseconds are given as seconds, or kHz as Hz, time_s and sample_rate differ by a power of a thousand. Any
# other difference is allowed: a run with times may have a rate of its own.
_TIME_SLIPS = (1e-6, 1e-3, 1e3, 1e6)
_SLIP_TOLERANCE = 0.1
MINIMUM_CYCLES = 3.0
# The count is uncertain, most where damping is heavy or the sensor drifts; a run of three cycles must pass.
CYCLE_TOLERANCE = 0.25
# If degrees are given as radians or vice versa, swing and stated release angle differ by a factor of 57.3.
_SLIP_RATIO = (50.0, 75.0)


def increasing_times(time_s: Array, sample_rate: float | None, where: str) -> None:
    """Check the times of a run file. Steps may differ, and samples may be missing.

    Args:
        time_s: sample times, shape (n,), s.
        sample_rate: as stated in the campaign, Hz; None where it is not stated.

    Raises:
        TunnelError: a step back, a repeated time, or times in a unit other than s.
    """
    if time_s.size < 2:
        raise TunnelError("only one sample", where=where, remedy="record three cycles or more")
    steps = np.diff(time_s)
    back = np.flatnonzero(steps < 1.0 / limits.FASTEST_RATE)
    if back.size:
        at = int(back[0])
        raise TunnelError(
            f"time_s {'steps back' if steps[at] < 0.0 else 'stands still'} after {time_s[at]:.6g} s "
            f"(sample {at + 2})",
            where=where,
            remedy="sort the samples by time and leave out repeated ones",
        )
    step = float(np.median(steps))
    ratio = 1.0 if sample_rate is None else step * sample_rate
    if any(abs(ratio / slip - 1.0) < _SLIP_TOLERANCE for slip in _TIME_SLIPS):
        raise TunnelError(
            f"time_s steps by {step:.6g}, which is {1.0 / step:.6g} Hz if it is seconds, but [sensor] "
            f"sample_rate is {sample_rate:g} Hz",
            where=where,
            remedy="give time_s in seconds and sample_rate in Hz, or leave one of them out",
        )


def same_unit(angle: Array, column: str, release_angle: float | None, where: str) -> None:
    """Refuse a swing and a stated release angle of which one appears to be in degrees.

    The sensor's zero is unknown, so half the span of the reading is compared.

    Args:
        angle: the reading, shape (n,), rad.
        column: ``yaw_rad`` or ``yaw_deg``, for messages.
        release_angle: nominal, rad; None where the campaign does not state it.

    Raises:
        TunnelError: a factor of about 57.3 between reading and release angle.
    """
    half_span = 0.5 * (float(angle.max()) - float(angle.min()))
    if not release_angle or half_span == 0.0:
        return
    ratio = abs(release_angle) / half_span
    low, high = _SLIP_RATIO
    if column == "yaw_rad" and low <= 1.0 / ratio <= high:
        raise TunnelError(
            f"yaw_rad swings by ±{half_span:.4g}, about 57 times the release_angle of "
            f"{release_angle:.4g} rad: it looks like degrees",
            where=where,
            remedy=f"name the column yaw_deg, or convert it to radians; {KEEP}",
        )
    if low <= ratio <= high:
        raise TunnelError(
            f"{column} swings by ±{half_span:.4g} rad, about 1/57 of the release_angle of "
            f"{release_angle:.4g} rad: one of them is in the wrong unit",
            where=where,
            remedy=f"give release_angle in rad, name the column for its unit, or leave release_angle out; {KEEP}",
        )


def enough_cycles(record: Record, where: str) -> float:
    """Refuse a record with fewer than three cycles of oscillation.

    Returns:
        Number of cycles in the record.

    Raises:
        TunnelError: fewer than three cycles, or no oscillation.
    """
    cycles = count_cycles(record)
    if cycles >= MINIMUM_CYCLES - CYCLE_TOLERANCE:
        return cycles
    what = (
        f"about {cycles:.1f} cycles of oscillation, fewer than three"
        if cycles > 0.0
        else "no oscillation is visible in the record, so it has fewer than three cycles"
    )
    raise TunnelError(what, where=where, remedy="record for longer after the release, or leave the run out")
