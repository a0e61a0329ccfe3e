"""Runs cut into stretches of a few cycles, each with a release of its own, and fits that grow from them.

Where the model is far from the motion, its phase is lost within a few cycles, and a fit of the whole run has many
minima. In a stretch of two cycles the phase cannot be lost: what is wrong with the model shows as a frequency and a
damping that differ from stretch to stretch (multiple shooting; Bock, Springer Ser. Chem. Phys. 18 (1981) 102).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Container
from dataclasses import dataclass
from math import ceil

import numpy as np

from diagnosis.fitting.least_squares import Fit, fit
from diagnosis.fitting.problem import Point
from diagnosis.fitting.run_data import Data
from diagnosis.fitting.similarity import REFERENCE_FREQUENCY
from diagnosis.policy import GROWN_ON

_SHORT, _LONG = 2, 18  # cycles
_LONGER = 3  # times, from one fit to the next: the phase at the end of a stretch is known to that much
_TOLERANCE = 1e-3  # of the fits on the way
_ITERATIONS = 15


def long_stretch(short: Stretches) -> int:
    """Length, in blocks, of the stretches on which sets of causes are compared.

    Over eighteen cycles a model of the motion shows in the phase as well; over a hundred the phase shows the clock,
    the temperature and the hand that let go.

    Args:
        short: stretches of two cycles.
    """
    return short.length * _LONG // _SHORT


@dataclass(frozen=True, eq=False)
class Stretches:
    """The runs of a campaign in stretches.

    Args:
        data: the stretches, as runs.
        places: of each stretch its run's number and the block it begins with.
        length: in blocks; the last of a run may be half as short or half as long again.
    """

    data: Data
    places: tuple[tuple[int, int], ...]
    length: int

    def only(self, places: Container[tuple[int, int]]) -> Stretches:
        """Those of the places given."""
        if all(place in places for place in self.places):
            return self
        kept = [k for k, place in enumerate(self.places) if place in places]
        runs = tuple(self.data.runs[k] for k in kept)
        return Stretches(self.data.with_runs(runs), tuple(self.places[k] for k in kept), self.length)


def in_stretches(data: Data, length: int | None = None) -> Stretches:
    """Cut runs into stretches.

    Args:
        length: of a stretch, in blocks; two cycles where not given. Multiples of it have ends in common.

    Returns:
        The stretches. They may be fitted with effects that are autonomous.
    """
    if length is None:
        length = round(_SHORT / (REFERENCE_FREQUENCY * data.runs[0].interval))
    parts, places = [], []
    for number, run in enumerate(data.runs):
        count = max(1, round(run.reading.size / length))
        begins = [k * length for k in range(count)]
        for begin, end in zip(begins, [*begins[1:], run.reading.size], strict=True):
            parts.append(dataclasses.replace(run.part(begin, end), id=f"{run.id} from block {begin}"))
            places.append((number, begin))
    return Stretches(data.with_runs(tuple(parts)), tuple(places), length)


def spread_out(short: Stretches, data: Data) -> Stretches:
    """Stretches of two cycles to grow sets of causes on, spread over the runs where all would be too many.

    Args:
        short: all of them.

    Returns:
        Those that lie in every k-th stretch of eighteen cycles, the first of each run among them. k is the least
        with which the runs divided by it have no more than `GROWN_ON` blocks.
    """
    each = ceil(sum(run.reading.size for run in data.runs) / GROWN_ON)
    long = in_stretches(data, long_stretch(short))
    kept: set[tuple[int, int]] = set()
    for run in range(len(data.runs)):
        begins = [begin for number, begin in long.places if number == run]
        ends = [*begins[1:], data.runs[run].reading.size]
        for begin, end in list(zip(begins, ends, strict=True))[::each]:
            kept.update(place for place in short.places if place[0] == run and begin <= place[1] < end)
    return short.only(kept)


def fit_longer(
    found: Fit, stretches: Stretches, data: Data, length: int | None = None
) -> tuple[Fit, Stretches]:
    """Fit ever longer stretches, each from the fit of shorter ones.

    Args:
        found: a fit of the stretches, the first of each run among them.
        length: to reach, in blocks; None: whole runs.

    Returns:
        The fit of the longest stretches, and these. Whole runs are one stretch each and keep their own names.

    Raises:
        FitError: when the model cannot be integrated.
    """
    longest = max(run.reading.size for run in data.runs)
    goal = longest if length is None else min(length, longest)
    while stretches.length < goal:
        known = dict(zip(stretches.places, found.point.release, strict=True))
        longer = in_stretches(data, min(stretches.length * _LONGER, goal)).only(known)
        if longer.length >= longest:
            longer = Stretches(data, tuple((i, 0) for i in range(len(data.runs))), longest)
        release = np.array([known[place] for place in longer.places])
        problem = dataclasses.replace(found.problem, data=longer.data)
        start = Point(found.point.common, release)
        if longer.length >= goal:
            found = fit(problem, start)
        else:
            found = fit(problem, start, tolerance=_TOLERANCE, max_iterations=_ITERATIONS)
        stretches = longer
    return found, stretches
