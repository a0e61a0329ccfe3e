"""Checks of a run before anything is estimated from it: uniform sampling, angles in radians, three cycles."""

from __future__ import annotations

import numpy as np

from tunnel_sim.vocabulary.cycles import count_cycles
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array, Record

STEP_TOLERANCE = 0.01  # share of the step, as in docs/reference/campaign-format.md
# If milliseconds are given as seconds, or kHz as Hz, time_s and sample_rate differ by a power of a thousand. Any
# other difference is allowed: a run with times may have a rate of its own.
_TIME_SLIPS = (1e-6, 1e-3, 1e3, 1e6)
_SLIP_TOLERANCE = 0.1
MINIMUM_CYCLES = 3.0
# The count is uncertain, most where damping is heavy or the sensor drifts; a run of three cycles must pass.
CYCLE_TOLERANCE = 0.25
# If degrees are given as radians or vice versa, swing and stated release angle differ by a factor of 57.3.
_SLIP_RATIO = (50.0, 75.0)


def uniform_times(time_s: Array, sample_rate: float | None, where: str) -> None:
    """Check the times of a run file.

    Args:
        time_s: sample times, shape (n,), s.
        sample_rate: as stated in the campaign, Hz; None where it is not stated.
        where: file and run, for messages.

    Raises:
        TunnelError: a step back, a gap, a step that differs by more than 1 %, or times in a unit other than s.
    """
    if time_s.size < 2:
        raise TunnelError("only one sample", where=where, remedy="record three cycles or more")
    steps = np.diff(time_s)
    back = np.flatnonzero(steps <= 0.0)
    if back.size:
        at = int(back[0])
        raise TunnelError(
            f"time_s {'steps back' if steps[at] < 0.0 else 'stands still'} after {time_s[at]:.6g} s "
            f"(sample {at + 2})",
            where=where,
            remedy="sort the samples by time and leave out repeated ones",
        )
    step = float(np.median(steps))
    # Times far from zero have larger rounding errors, which are not a fault of the sampling.
    allowed = STEP_TOLERANCE * step * (1.0 + 1e-6) + 4.0 * float(np.spacing(np.abs(time_s).max()))
    uneven = np.flatnonzero(np.abs(steps - step) > allowed)
    if uneven.size:
        raise _uneven(time_s, steps, step, int(uneven[0]), where)
    ratio = 1.0 if sample_rate is None else step * sample_rate
    if any(abs(ratio / slip - 1.0) < _SLIP_TOLERANCE for slip in _TIME_SLIPS):
        raise TunnelError(
            f"time_s steps by {step:.6g}, which is {1.0 / step:.6g} Hz if it is seconds, but [sensor] "
            f"sample_rate is {sample_rate:g} Hz",
            where=where,
            remedy="give time_s in seconds and sample_rate in Hz, or leave one of them out",
        )


def _uneven(time_s: Array, steps: Array, step: float, at: int, where: str) -> TunnelError:
    if steps[at] > 1.5 * step:
        return TunnelError(
            f"a gap of {steps[at]:.4g} s after {time_s[at]:.6g} s, where the step is {step:.4g} s",
            where=where,
            remedy="use the part before or after the gap",
        )
    return TunnelError(
        f"the sampling is not uniform: a step of {steps[at]:.4g} s after {time_s[at]:.6g} s, where the usual "
        f"one is {step:.4g} s (1 % is allowed)",
        where=where,
        remedy="resample the record, or write time_s with more digits",
    )


def angle_in_radians(yaw: Array, column: str, release_angle: float | None, where: str) -> Array:
    """Convert a reading to radians and check that its unit is plausible.

    The sensor's zero is unknown, so the check uses half the span of the reading. In ``yaw_rad`` more than half a
    turn to either side cannot be an oscillation about a rest position; a pendulum released at 2.4 rad can.

    Args:
        yaw: the reading, shape (n,), in the unit named by its column.
        column: ``yaw_rad`` or ``yaw_deg``.
        release_angle: nominal, rad; None where the campaign does not state it.
        where: file and run, for messages.

    Returns:
        The reading, shape (n,), rad.

    Raises:
        TunnelError: degrees in ``yaw_rad``, or a factor of about 57.3 between reading and release angle.
    """
    angle = np.deg2rad(yaw) if column == "yaw_deg" else yaw
    half_span = 0.5 * (float(angle.max()) - float(angle.min()))
    if column == "yaw_rad" and not half_span <= np.pi:
        raise TunnelError(
            f"yaw_rad swings by ±{half_span:.4g}: it looks like degrees",
            where=where,
            remedy="name the column yaw_deg, or convert it to radians",
        )
    if release_angle and half_span > 0.0:
        ratio = abs(release_angle) / half_span
        low, high = _SLIP_RATIO
        if column == "yaw_rad" and low <= 1.0 / ratio <= high:
            raise TunnelError(
                f"yaw_rad swings by ±{half_span:.4g}, about 57 times the release_angle of "
                f"{release_angle:.4g} rad: it looks like degrees",
                where=where,
                remedy="name the column yaw_deg, or convert it to radians",
            )
        if low <= ratio <= high:
            raise TunnelError(
                f"{column} swings by ±{half_span:.4g} rad, about 1/57 of the release_angle of "
                f"{release_angle:.4g} rad: one of them is in the wrong unit",
                where=where,
                remedy="give release_angle in rad, name the column for its unit, or leave release_angle out",
            )
    return angle


def enough_cycles(record: Record, where: str) -> float:
    """Refuse a record with fewer than three cycles of oscillation.

    Args:
        record: the run's record.
        where: file and run, for messages.

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
