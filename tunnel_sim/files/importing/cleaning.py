"""Clean-up of the times and readings of a record: rows out of order, repeated, missing, jittered; all reported."""

from __future__ import annotations

import itertools
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, log10

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing.tables import LEAST_ROWS, are_series
from tunnel_sim.vocabulary.errors import TunnelError, counted
from tunnel_sim.vocabulary.quantities import PerSample, Readings, Seconds, Times
from tunnel_sim.vocabulary.record import Array

_COARSE = 0.1  # share of samples with the stamp of the previous sample above which the stamps are too coarse
_UNEVEN = 0.01  # share of a step
_FINEST = 1e-12  # s
_RESTARTS = 0.01  # share of backward steps up to which the clock restarts and the rows are not out of order
_FEW_RESTARTS = 3  # in a short record
_FEW = 0.1  # share of rows out of order that a logger may mix up; more of them are several runs
_SMOOTH = 0.1  # white noise in a smooth reading, relative to its swing
_ROUNDED = 1e-9  # share of the range: readings that differ by less are equal
_FLAT = 3  # samples: a shorter peak may be flat by chance
_FLATTER = 5  # ratio of samples at the last level to the level below: a parabola reaches at most 2.4
_GAP = 1.75  # multiple of the usual step: samples are missing
_LEVELS_OF = 200_000  # number of inspected samples of each run
_MOST_LEVELS = 20_000
_ON_LEVEL = 0.2  # share of a level's height


@dataclass(frozen=True, eq=False)
class Cleaned:
    """Times and readings without unusable samples.

    Args:
        time_s: increasing, from zero on.
        rows: the row of each sample in the original record, shape (n,).
        first_s: time of the first sample by the file's clock.
    """

    time_s: Times
    reading: Readings
    rows: NDArray[np.intp]
    remarks: tuple[str, ...]
    first_s: Seconds = 0.0

    @property
    def file_time_s(self) -> Times:
        """Times by the file's clock: the clock of ``--start``, of pictures, tables and notes."""
        return self.time_s + self.first_s


def restarts(time: Times, reading: Readings) -> list[int]:
    """Indices at which the times restart because another run follows; empty: none.

    Rows without a time, such as a blank line or a repeated heading between two runs, do not hide a restart.
    """
    known = np.flatnonzero(np.isfinite(time))
    clock = time[known]
    back = np.flatnonzero(np.diff(clock) < 0.0) + 1
    if not back.size or back.size > max(_FEW_RESTARTS, _RESTARTS * clock.size):
        return []
    starts = [0, *back.tolist(), clock.size]
    parts = [clock[a:b] for a, b in itertools.pairwise(starts)]
    # another run begins near the time of the first start, and not slightly before the previous row
    early = all(part[0] - clock[0] <= 0.1 * np.ptp(parts[0]) for part in parts[1:])
    if not early and not _interleaved(clock, reading[known], starts):
        return []
    return [int(place) for place in known[back]]


def _interleaved(clock: Times, reading: Readings, starts: Sequence[int]) -> bool:
    """Whether sorting would mix the rows of parts that are long enough for runs."""
    part = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    long = np.isin(part, np.flatnonzero(np.diff(starts) >= LEAST_ROWS))
    order = np.argsort(clock[long], kind="stable")
    changes = np.count_nonzero(np.diff(part[long][order]))
    readings = np.nan_to_num(reading[long][order])
    same = (np.diff(clock[long][order]) == 0.0) & (np.diff(readings) == 0.0)
    return bool(changes > len(starts) + 2 * np.count_nonzero(same))  # rows that two parts repeat


def cleaned(time: Times, reading: Readings) -> Cleaned:
    """Recorded times and readings in the form of a campaign.

    Raises:
        TunnelError: when the rows have no order of a single run: sorting would invent one.
    """
    remarks: list[str] = []
    rows = np.flatnonzero(np.isfinite(time) & np.isfinite(reading))
    if rows.size < time.size:
        inside = int(rows[-1] - rows[0] + 1 - rows.size) if rows.size else 0
        if inside:
            remarks.append(f"{counted(inside, 'sample')} without a number left out")
        time, reading = time[rows], reading[rows]
    if time.size > 1 and time[0] > time[-1] and not (np.diff(time) > 0.0).any():
        rows, time, reading = rows[::-1], time[::-1], reading[::-1]
        remarks.append("rows from the last to the first put in their order")
    ordered = not (np.diff(time) < 0.0).any()
    if not ordered:
        moved, order = _out_of_order(time), np.argsort(time, kind="stable")
        if moved > _FEW * time.size and not _of_one_run(time[order], reading[order]):
            what = f"the times of {moved} of {counted(time.size, 'row')} are out of order"
            remedy = (
                "sort the rows if they are one run; write each run into a file of its own if they are several"
            )
            raise TunnelError(what, remedy=remedy)
        rows, time, reading = rows[order], time[order], reading[order]
        remarks.append("rows out of order sorted by time")
    same = np.diff(time) == 0.0
    repeated = same & (np.diff(reading) == 0.0)
    differing = np.count_nonzero(same & ~repeated)
    if ordered and differing > _COARSE * time.size and time[0] < time[-1]:
        series = _series(time, reading)
        if series > 1:
            what = f"every time has {counted(series, 'row')}, whose readings belong to as many series"
            raise TunnelError(what, remedy="write each series into a column or a file of its own")
        remarks.append(
            f"{differing} time stamps repeat although the readings differ: the stamps are coarser than the "
            "sampling, and evenly spaced times are used instead"
        )
        time = _spread(time, np.abs(rows - rows[0]))
    elif same.any():
        keep = np.concatenate([[True], ~same])
        further = (
            f", and {counted(int(differing), 'further reading')} at a repeated time" if differing else ""
        )
        remarks.append(f"{counted(int(repeated.sum()), 'repeated sample')} left out{further}")
        rows, time, reading = rows[keep], time[keep], reading[keep]
    first = float(time[0]) if time.size else 0.0
    if first != 0.0:
        remarks.append(
            f"the times stated here are the times of the file, which starts at {clock_text(first)} s; in the "
            "campaign every run starts at 0 s"
        )
    time = from_zero(time)
    return Cleaned(time, reading, rows, (*remarks, *_of_clock(time)), first)


def _of_clock(time: Times) -> list[str]:
    """Remarks on missing samples and uneven steps."""
    remarks = []
    steps = np.diff(time)
    usual = float(np.median(steps)) if steps.size > 1 else 0.0
    if usual > 0.0:  # else below the resolution of floating-point numbers; the run is refused later
        gaps = steps > _GAP * usual
        if gaps.any():
            missing = int(np.round(steps[gaps] / usual - 1.0).sum())
            where = f"in {counted(int(gaps.sum()), 'gap')}, up to {steps.max():.4g} s long"
            remarks.append(f"about {counted(missing, 'sample')} missing {where}")
        spread = float(np.abs(steps[~gaps] - usual).max())
        if spread > _UNEVEN * usual:
            share = f"{100.0 * spread / usual:.0f} % of a step"
            remarks.append(f"time stamps differ from an even clock by up to {share}; kept")
    return remarks


def _out_of_order(time: Times) -> int:
    """The least number of rows that move when the rows are sorted."""
    tails: list[float] = []
    for value in time.tolist():
        place = bisect_right(tails, value)
        tails[place : place + 1] = [value]
    return time.size - len(tails)


def _of_one_run(time: Times, reading: Readings) -> bool:
    """Whether sorted rows are one run, however mixed up they were: an even clock, and a reading without jumps."""
    steps = np.diff(time)
    even = np.abs(steps - np.median(steps)).max() <= _UNEVEN * np.median(steps)
    jumps = np.diff(reading, 4)  # between samples of two runs they are as large as the distance of the runs
    return bool(even and jumps.size and np.sqrt(np.mean(jumps**2) / 70.0) <= _SMOOTH * reading.std())


def _series(time: Times, reading: Readings) -> int:
    """The number of series whose rows alternate, such as signals in one column; 1 where stamps are coarse.

    Readings between coarse stamps continue each other, and those of another series do not.
    """
    firsts = np.concatenate([[0], np.flatnonzero(np.diff(time)) + 1, [time.size]])
    each = np.diff(firsts)
    usual = int(np.median(each))
    whole = firsts[:-1][each == usual]
    if usual < 2 or whole.size < max(LEAST_ROWS, (1.0 - _FEW) * each.size):
        return 1
    rows = reading[whole[:, np.newaxis] + np.arange(usual)]
    return usual if are_series(rows.ravel(), rows.T) else 1


def _spread(time: Times, rows: NDArray[np.intp]) -> Times:
    """Times spread evenly from each gap in coarse stamps to the next gap; a missing row keeps its time.

    A stamp is exact only where it follows another one: the first and the last may have fewer samples.
    """
    firsts = np.concatenate([[0], np.flatnonzero(np.diff(time)) + 1])
    coarse = np.diff(time[firsts])
    gaps = np.flatnonzero(coarse > _GAP * np.median(coarse)) + 1
    parts = [firsts[a:b] for a, b in itertools.pairwise([0, *gaps.tolist(), firsts.size])]
    ends = [*(int(part[0]) for part in parts[1:]), time.size]
    even = np.empty(time.size)
    changes = [part[1:] for part in parts if part.size > 2]
    away = [(rows[at] - rows[at].mean(), time[at] - time[at].mean()) for at in changes]
    step = sum(float(i @ t) for i, t in away) / max(sum(float(i @ i) for i, _ in away), 1.0)
    for part, b in zip(parts, ends, strict=True):
        a, at = int(part[0]), part[1:]
        if step > 0.0:
            origin = float((time[at] - step * rows[at]).mean()) if at.size else time[a] - step * rows[a]
            even[a:b] = origin + step * rows[a:b]
        else:
            span = max(int(rows[b - 1] - rows[a]), 1)
            even[a:b] = np.linspace(time[a], time[b - 1], span + 1)[rows[a:b] - rows[a]]
    return even


def clock_text(time: Seconds) -> str:
    """A time by the file's clock to a millisecond: ``34200``, or ``14.275``."""
    return f"{round(time, 3) + 0.0:.3f}".rstrip("0").rstrip(".")  # never -0


def from_zero(time: Times) -> Times:
    """Times from the first sample on, without the spurious digits of a subtraction."""
    if time.size < 2 or time[0] == 0.0:
        return time
    step = float(np.ptp(time)) / (time.size - 1)
    kept = 6 - floor(log10(max(step, _FINEST)))  # digits: a millionth of a step
    counted: Array = np.round(time - time[0], kept)
    return counted


def from_rest(reading: PerSample, rest: float, unit: str, where: str) -> tuple[PerSample, str]:
    """A reading without its value at rest, and a remark.

    Args:
        rest: stated reading at rest, in the unit of the reading.
    """
    least, most = float(reading.min()), float(reading.max())
    if not least <= rest <= most:
        raise TunnelError(
            f"the readings, {least:.4g} to {most:.4g} {unit}, do not include the stated rest of {rest:.4g} {unit}",
            where=where,
            remedy=f"state the reading at rest in {unit}, for each run where they differ",
        )
    return reading - rest, f"the stated reading at rest, {rest:.6g} {unit}, is subtracted"


def resolution(readings: Sequence[PerSample]) -> float | None:
    """The step of a sensor whose readings are on evenly spaced levels; None: they are not."""
    some = np.concatenate([reading[:_LEVELS_OF] for reading in readings])
    levels = np.unique(some)
    if not 3 <= levels.size <= min(_MOST_LEVELS, some.size // 2):
        return None
    # Rounded readings are off their levels, but the steps between neighbours are whole numbers of the sensor's.
    steps = np.diff(levels)
    place = np.concatenate([[0.0], np.cumsum(np.round(steps / np.median(steps)))])
    step, first = np.polyfit(place, levels, 1)
    away = float(np.abs(levels - first - step * place).max())
    return float(step) if step > 0.0 and away <= _ON_LEVEL * step else None


def clipped(reading: PerSample) -> list[tuple[float, NDArray[np.intp]]]:
    """The limits of a sensor that cuts off the peaks of a swing, each with the samples at it.

    A reading that turns freely does not stay longer at its last level than at the level before, except a few
    times.
    """
    found = []
    for sign in (1.0, -1.0):
        heights = sign * reading
        at = heights >= heights.max() - _ROUNDED * float(np.ptp(heights))
        edges = np.flatnonzero(np.diff(np.concatenate([[False], at, [False]]).astype(np.int8)))
        lengths = edges[1::2] - edges[::2]
        below = heights[~at].max(initial=-np.inf)
        beside = np.count_nonzero(heights[~at] >= below - _ROUNDED * float(np.ptp(heights)))
        flat = lengths[lengths >= _FLAT]
        if flat.size >= 2 and flat.sum() > _FLATTER * beside:
            found.append((sign * float(heights.max()), np.flatnonzero(at)))
    return found
