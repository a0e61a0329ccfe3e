"""The clock of each record: rounded time stamps, uneven ones, and samples that are missing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.record import CLOCK_TOLERANCE, Array, Record

_FINEST = 9  # decimals: no logger rounds to less than a nanosecond
_ON_LATTICE = 1e-3  # of the lattice's step: rounding errors of the decimals themselves
_TIMER_DECIMALS = 10  # steps of the decimals that a timer's must exceed, or any stamps would lie on it
_SWEEPS = 8
_NO_GAP = 1.75  # usual steps: a longer one may be a gap
_MOST_MISSING = 1e3  # ticks per sample: beyond it the stamps are not those of one clock


@dataclass(frozen=True, eq=False)
class Clock:
    """A uniform clock that a record's samples were taken by.

    Args:
        interval: s.
        place: of every sample on the clock, shape (n,); increasing, with jumps where samples are missing.
        time: of every sample by the clock, shape (n,), s.
        away: largest distance of a time stamp from it, s.
    """

    interval: float
    place: NDArray[np.int64]
    time: Array
    away: float

    @property
    def missing(self) -> int:
        """Number of samples missing between the first and the last."""
        return int(self.place[-1]) + 1 - self.place.size


def with_clocks(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """Replace rounded time stamps by the uniform clock behind them, and note uneven ones.

    Returns:
        The campaign, itself if no stamp is replaced, and the remarks: one on the runs with rounded stamps, one on
        those whose samples are used at the uneven times given, one on those with missing samples.
    """
    found = [(run, None if run.record.uniform else find_clock(run.record.time_s)) for run in campaign.runs]
    rounded = [
        (run, clock)
        for run, clock in found
        if clock is not None and clock.away > CLOCK_TOLERANCE * clock.interval
    ]
    uneven = [run for run, clock in found if clock is None and not run.record.uniform]
    gappy = [(run, clock) for run, clock in found if clock is not None and clock.missing]
    remarks = (
        *([_rounded(rounded)] if rounded else []),
        *([_uneven(uneven)] if uneven else []),
        *([_missing(gappy)] if gappy else []),
    )
    if not rounded:
        return campaign, remarks
    clocks = {run.id: clock for run, clock in rounded}
    return replace(campaign, runs=tuple(_on(run, clocks.get(run.id)) for run in campaign.runs)), remarks


def find_clock(time_s: Array) -> Clock | None:
    """The uniform clock that explains time stamps.

    Args:
        time_s: stamps, increasing, shape (n,), s.

    Returns:
        The clock whose ticks, rounded to the last decimal of the stamps or to the ticks of a logger's timer, are
        the stamps; samples may be missing. None if there is none.
    """
    steps = np.diff(time_s)
    usual = steps[steps < _NO_GAP * np.median(steps)]
    decimal = _rounding(time_s)
    allowed = max(decimal, _timer(steps, decimal))
    for interval in (float(np.mean(steps)), float(np.mean(usual))):
        found = _counted(time_s, interval)
        if found is not None and found.away <= max(allowed, CLOCK_TOLERANCE * found.interval):
            return found
    return None


def _counted(time_s: Array, interval: float) -> Clock | None:
    """The clock of about an interval, s, that fits the stamps best; None if gaps are most of them."""
    for _ in range(_SWEEPS):
        ticks = np.maximum(np.round(np.diff(time_s) / interval), 1.0)
        place = np.concatenate([[0.0], np.cumsum(ticks)])
        if place[-1] > _MOST_MISSING * time_s.size:
            return None
        slope, start = np.polyfit(place - place.mean(), time_s, 1)
        settled = abs(slope / interval - 1.0) * place[-1] < CLOCK_TOLERANCE
        interval = float(slope)
        if settled:
            break
    clock = start + interval * (place - place.mean())
    return Clock(interval, place.astype(np.int64), clock, float(np.abs(time_s - clock).max()))


def _rounding(time_s: Array) -> float:
    """Step of the coarsest decimal lattice on which all stamps lie, s; 0 if there is none.

    Stamps may be off by a whole step: rounded or cut off, by a logger that is itself a little late.
    """
    for decimals in range(_FINEST + 1):
        scaled = time_s * 10.0**decimals
        if np.abs(scaled - np.round(scaled)).max() < _ON_LATTICE:
            return float(10.0**-decimals)
    return 0.0


def _timer(steps: Array, decimal: float) -> float:
    """Step of a timer that all steps between stamps are multiples of, s; 0 if there is none.

    Args:
        steps: between stamps, s, shape (n - 1,).
        decimal: step of the decimals of the stamps, s, as `_rounding` gives it.
    """
    changes = np.diff(np.sort(steps))
    changes = changes[changes > max(_TIMER_DECIMALS * decimal, CLOCK_TOLERANCE * float(steps.max()))]
    if not changes.size:
        return 0.0
    whole = np.round(steps / changes.min())
    step = float(steps @ whole / (whole @ whole))
    return step if np.abs(steps - step * whole).max() < decimal + _ON_LATTICE * step else 0.0


def _on(run: Run, clock: Clock | None) -> Run:
    return run if clock is None else replace(run, record=Record(clock.time, run.record.yaw_rad))


def _ids(runs: list[Run]) -> tuple[str, ...]:
    return tuple(run.id for run in runs)


def _range(values: list[float]) -> str:
    low, high = f"{min(values):.6g}", f"{max(values):.6g}"
    return low if low == high else f"{low} to {high}"


def _rounded(found: list[tuple[Run, Clock]]) -> Remark:
    interval = _range([1e3 * clock.interval for _, clock in found])
    away = max(clock.away / clock.interval for _, clock in found)
    return Remark(
        Outcome.NOTED,
        _ids([run for run, _ in found]),
        f"the time stamps are rounded, by up to {100.0 * away:.0f} % of a step; a uniform clock of {interval} ms "
        f"is used",
        "write time_s with more digits",
    )


def _uneven(runs: list[Run]) -> Remark:
    steps = [1e3 * np.diff(run.record.time_s) for run in runs]
    ends = [float(end) for step in steps for end in (step.min(), step.max())]
    return Remark(
        Outcome.NOTED,
        _ids(runs),
        f"the samples are not evenly spaced (steps of {_range(ends)} ms); they are used at the times given",
        "check that time_s is when the samples were taken",
    )


def _missing(found: list[tuple[Run, Clock]]) -> Remark:
    count = sum(clock.missing for _, clock in found)
    longest = max(float(clock.interval * (np.diff(clock.place).max() - 1)) for _, clock in found)
    return Remark(
        Outcome.NOTED,
        _ids([run for run, _ in found]),
        f"{count} samples are missing, up to {longest:.4g} s at a time; the others are used at their times",
        "check the logger",
    )
