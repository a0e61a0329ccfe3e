"""Turning points of a swing, as read by hand: the times and angles of its extremes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.quantities import Angles, PerSample, Times
from tunnel_sim.vocabulary.record import Array

LEAST = 6
"""Minimum number of turning points that determine a period, a decrement and the scatter about both."""
_GROWS = 1.25  # multiple of the previous swing: upper bound of the next swing in a decay read by hand
_SHRINKS = 0.4  # share of the previous swing: an oscillating decay from one side to the other is not faster
_MISSED = 0.35  # of half a period: times of turning points are as close to whole numbers of it


@dataclass(frozen=True, eq=False)
class TurningPoints:
    """The extremes of a free decay, from one side to the other.

    Args:
        name: of the file or run.
        time_s: increasing.
        time_std: standard deviation of the times as stated; None where it is not stated.
        angle_std: standard deviation of the angles as stated; None where it is not stated.
        remarks: how they were read.
    """

    name: str
    time_s: Times
    angle_rad: Angles
    time_std: Times | None = None
    angle_std: Angles | None = None
    remarks: tuple[str, ...] = ()

    @property
    def half_periods(self) -> PerSample:
        """The number of half periods from the first turning point to each."""
        steps = np.diff(self.time_s)
        counted: Array = np.concatenate([[0.0], np.cumsum(np.round(steps / np.median(steps)))])
        return counted


def are_turning_points(time_s: Times, angle: PerSample) -> bool:
    """Whether every reading of a table is on the opposite side of the previous one, as with turning points."""
    if time_s.size < LEAST:
        return False
    swings, steps = np.diff(angle), np.diff(time_s)
    sizes, step = np.abs(swings), np.median(steps)
    if not ((sizes > 0.0).all() and step > 0.0) or (np.sign(swings[1:]) == np.sign(swings[:-1])).any():
        return False
    with np.errstate(over="ignore", invalid="ignore"):  # numbers may be larger than in any motion
        ratio, halves = sizes[1:] / sizes[:-1], steps / step
        whole = np.round(halves)  # a turning point may be missing on either side, two at a time
        even = (np.abs(halves - whole) <= _MISSED) & (whole % 2.0 == 1.0)
    return bool((ratio < _GROWS).all() and (ratio > _SHRINKS).all() and even.all())


class HoldsTurningPoints(TunnelError):
    """The table contains turning points, from which no campaign can be made."""

    def __init__(self, points: TurningPoints, where: str) -> None:
        self.points = points
        super().__init__(
            f"contains {points.time_s.size} turning points only, not the motion between them",
            where=where,
            remedy="use tunnel identify FILE for ωn and ζ; a campaign and a diagnosis need the whole motion, with "
            "five samples a cycle or more",
        )
