"""Narrow lines in single runs' residuals, away from the motion and its harmonics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diagnosis.detection.gap import chance
from diagnosis.fitting.run_data import RunData
from diagnosis.localisation.excess import RunExcess
from diagnosis.policy import LINE_CONTRAST, PLACE_FALSE_ALARM_RATE
from tunnel_sim.vocabulary.record import Array

_WIDTH = 5  # coefficients a line spreads over
_AROUND = 60  # coefficients on either side, whose median a line must exceed
_HARMONIC = 0.2  # of the run's frequency: a line nearer to a harmonic belongs to the motion
_OWN = 0.4  # of the run's frequency: the same for the motion itself, whose frequency may drift
_LOWEST = 0.5  # of the run's frequency: below, drifts look like lines
_APART = 0.5  # of the run's frequency, between two lines: a nearer one is the skirt of the first
_PER_RUN = 2


@dataclass(frozen=True)
class ResidualLine:
    """A line in one run.

    Args:
        run: id.
        frequency: Hz.
        share: of the run's excess squared residual, a fraction.
        amplitude: of the reading, rad.
    """

    run: str
    frequency: float
    share: float
    amplitude: float


def residual_lines(runs: list[RunExcess], data: Sequence[RunData]) -> tuple[ResidualLine, ...]:
    """The lines that stand out of the residual of single runs.

    Args:
        runs: squared residuals by frequency.
        data: the runs they belong to.

    Returns:
        At most two per run, strongest first in each, in the order of the runs.
    """
    return tuple(line for run, own in zip(runs, data, strict=True) for line in _lines(run, own, len(runs)))


def _lines(run: RunExcess, own: RunData, runs: int) -> list[ResidualLine]:
    local = np.convolve(run.power, np.ones(_WIDTH), mode="same")
    open_to = away_from_motion(run.frequency / run.resonance)
    found: list[ResidualLine] = []
    for index in np.argsort(np.where(open_to, local, 0.0))[::-1][: 20 * _PER_RUN].tolist():
        excess = float(local[index]) - _WIDTH
        unlikely = runs * run.power.size * chance(float(local[index]), _WIDTH, run.relative)
        if unlikely > PLACE_FALSE_ALARM_RATE or len(found) == _PER_RUN:
            break
        near = any(abs(line.frequency - run.frequency[index]) < _APART * run.resonance for line in found)
        if not open_to[index] or near or local[index] < LINE_CONTRAST * _around(local, index):
            continue
        whole = max(float(run.power.sum()) - run.power.size, excess)
        frequency = float(np.average(run.frequency[_near(index, run)], weights=run.power[_near(index, run)]))
        amplitude = float(own.noise_at(frequency)) * float(np.sqrt(2.0 * excess / run.power.size))
        found.append(ResidualLine(run.id, frequency, excess / whole, amplitude))
    return found


def away_from_motion(order: Array) -> NDArray[np.bool_]:
    """Where a line does not belong to the motion, its drift or its harmonics.

    Args:
        order: frequency over that of the run's motion, any shape.
    """
    harmonic = (np.abs(order - np.round(order)) < _HARMONIC) & (order < 3.5)
    harmonic |= np.abs(order - 1.0) < _OWN
    return (order > _LOWEST) & ~harmonic


def _near(index: int, run: RunExcess) -> slice:
    return slice(max(index - _WIDTH // 2, 0), min(index + _WIDTH // 2 + 1, run.power.size))


def _around(local: Array, index: int) -> float:
    """Median of the smoothed power on either side."""
    beside = np.concatenate(
        [local[max(index - _AROUND, 0) : max(index - _WIDTH, 0)], local[index + _WIDTH : index + _AROUND]]
    )
    return float(np.median(beside)) if beside.size else 0.0
