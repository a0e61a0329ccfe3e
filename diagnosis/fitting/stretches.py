"""Runs cut into stretches of a few cycles, each with a release of its own, and fits that grow from them.

Where the model is far from the motion, its phase is lost within a few cycles, and a fit of the whole run has many
minima. In a stretch of two cycles the phase cannot be lost: what is wrong with the model shows as a frequency and a
damping that differ from stretch to stretch (multiple shooting; Bock, Springer Ser. Chem. Phys. 18 (1981) 102).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from diagnosis.fitting.least_squares import Fit, fit
from diagnosis.fitting.problem import Point, Problem
from diagnosis.fitting.run_data import Data
from diagnosis.fitting.similarity import REFERENCE_FREQUENCY

_CYCLES = 2
_LONGER = 3  # times, from one fit to the next: the phase at the end of a stretch is known to that much
_TOLERANCE = 1e-3  # of the fits on the way
_ITERATIONS = 15


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


def in_stretches(data: Data, length: int | None = None) -> Stretches:
    """Cut runs into stretches.

    Args:
        data: the runs.
        length: of a stretch, in blocks; two cycles where not given.

    Returns:
        The stretches. They may be fitted with effects that are autonomous.
    """
    if length is None:
        length = round(_CYCLES / (REFERENCE_FREQUENCY * data.runs[0].interval))
    parts, places = [], []
    for number, run in enumerate(data.runs):
        count = max(1, round(run.reading.size / length))
        begins = [k * length for k in range(count)]
        for begin, end in zip(begins, [*begins[1:], run.reading.size], strict=True):
            parts.append(dataclasses.replace(run.part(begin, end), id=f"{run.id} from block {begin}"))
            places.append((number, begin))
    return Stretches(data.with_runs(tuple(parts)), tuple(places), length)


def fit_whole(found: Fit, stretches: Stretches, data: Data) -> Fit:
    """Fit whole runs from a fit of their stretches, by ever longer stretches.

    Args:
        found: of the stretches.
        stretches: of the runs.
        data: the runs.

    Returns:
        The fit of the runs.

    Raises:
        FitError: when the model cannot be integrated.
    """
    longest = max(run.reading.size for run in data.runs)
    while stretches.length < longest:
        longer = in_stretches(data, stretches.length * _LONGER)
        known = dict(zip(stretches.places, found.point.release, strict=True))
        release = np.array([known[place] for place in longer.places])
        last = longer.length >= longest
        problem = dataclasses.replace(found.problem, data=data if last else longer.data)
        start = Point(found.point.common, release)
        found = fit(problem, start) if last else _on_the_way(problem, start)
        stretches = longer
    return found


def _on_the_way(problem: Problem, start: Point) -> Fit:
    return fit(problem, start, tolerance=_TOLERANCE, max_iterations=_ITERATIONS)
