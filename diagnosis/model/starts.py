"""Motions in the records before any fit: frequencies, losses and gains of each run by itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from diagnosis.model.parameters import GAIN
from diagnosis.model.run_data import PreparedRuns, RunData
from identification.signal.decay_fit import Reading, fit_run
from identification.signal.forcing import driven_start
from identification.signal.frequency import peak_of_swing, starting_decay
from tunnel_sim.vocabulary.record import Array, Record

_STILL = 0.02  # share of the largest swing below which a run counts as at rest
_PADDING = 16  # zero padding of the spectrum that gives the first frequency


@dataclass(frozen=True, eq=False)
class Shown:
    """The quantities that each run shows by itself.

    Args:
        squares: angular frequency squared, shape (runs,), 1/s².
        swing: standard deviation of the reading, shape (runs,), rad.
        moving: 1 for a run that moves, 0 for one at rest, which has no frequency, shape (runs,).
        loss: rate of energy loss from the driven runs, 1/s; None where they show none.
        gain: gain of an unknown input, rad/s² per unit; 0 where no run shows it.
        zeros: mean readings, by run, rad.
    """

    squares: Array
    swing: Array
    moving: Array
    loss: float | None
    gain: float
    zeros: list[float]

    @property
    def typical(self) -> float:
        """The median angular frequency squared of the runs that move, 1/s²."""
        return float(np.median(self.squares[self.moving > 0.0]))

    @classmethod
    def of(cls, data: PreparedRuns, squares: list[float] | None = None) -> Shown:
        """The quantities shown by the runs of a campaign.

        Args:
            squares: squared frequencies of the runs, 1/s²; None: from their spectra, and for driven runs from the
                resonance between input and motion.
        """
        driven = [ShownResponse.of(run) for run in data.runs]
        if squares is None:
            squares = [
                _by_spectrum(run) if response is None else response.stiffness
                for run, response in zip(data.runs, driven, strict=True)
            ]
        swing = np.array([float(np.std(run.reading)) for run in data.runs])
        losses = [2.0 * one.rate for one in driven if one is not None and one.rate > 0.0]
        gains = [
            response.gain / response.scale
            for run, response in zip(data.runs, driven, strict=True)
            if response is not None and run.multiplied_by == GAIN
        ]
        return cls(
            np.array(squares),
            swing,
            (swing > _STILL * swing.max()).astype(np.float64),
            float(np.median(losses)) if losses else None,
            float(np.median(gains)) if gains else 0.0,
            [float(np.mean(run.reading)) for run in data.runs],
        )


def decay_squares(data: PreparedRuns) -> list[float] | None:
    """Angular frequency squared of each run from its own decay, 1/s²; None for a driven run or without a decay.

    A frequency that depends on the amplitude broadens the peak of a spectrum, and χ² has a minimum for every
    cycle too many or too few in the record.
    """
    if data.driven:
        return None
    found = []
    for run in data.runs:
        record = Record(run.times, run.reading)
        start = starting_decay(record)
        own = None if start is None else fit_run(Reading.from_record(record), start)
        if own is None or not own.runs or own.runs[0].decay.stiffness <= 0.0:
            return None
        found.append(own.runs[0].decay.stiffness)
    return found


@dataclass(frozen=True)
class ShownResponse:
    """The response of a run to its input.

    Args:
        rate: decay rate, 1/s.
        stiffness: stiffness over inertia, 1/s².
        gain: acceleration per unit of the input, rad/s².
        scale: moment of the input, N m per unit.
    """

    rate: float
    stiffness: float
    gain: float
    scale: float

    @classmethod
    def of(cls, run: RunData) -> ShownResponse | None:
        """The response of a run; None where it has no input or shows no resonance.

        Without a spring the gain must be positive, in N m of the input.
        """
        if run.drive is None:
            return None
        sprung, scale = run.spring_stiffness != 0.0, run.drive.scale
        found = driven_start(
            run.times, run.reading, run.input_means, sprung=sprung, derivative=run.derivative
        )
        if found is None or (found[1] if sprung else found[2] * scale) <= 0.0:
            return None
        return cls(*found, scale)

    @property
    def inertia(self) -> float:
        """The body's inertia, kg m², where the scale is known."""
        return self.scale / self.gain


def _by_spectrum(run: RunData) -> float:
    """The angular frequency squared of the peak of a run's spectrum, 1/s²."""
    values = run.reading - run.reading.mean()
    size = _PADDING * values.size
    peak = float(peak_of_swing(values, size) / (size * run.interval))
    return (2.0 * np.pi * peak) ** 2
