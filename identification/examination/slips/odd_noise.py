"""A single run whose noise or bandwidth differs from all other runs: another range, sensor, cable or filter."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification import policy
from identification.examination.self_excited import Swing
from identification.examination.slips.base import SlipEvidence, StatementSlip
from identification.examination.slips.odd_gain import other_gain
from identification.show.numbers import significant
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.record import Array, evenly_spaced

_FEWEST = 4  # runs
_ABOVE = 8.0  # times the frequency of the motion: its harmonics have ended
_BELOW = 0.45  # of the lowest sample rate
_LEAST_BINS = 16  # of a record in a band: their median scatters by a quarter
_SPREAD = 1.7  # greatest ratio of the noise of the other runs: they have one sensor
_SPREADS = 4.0  # logarithms of that ratio


@dataclass(frozen=True)
class OddNoise(StatementSlip):
    """One run has far less or far more noise than all others, in some band of frequencies. Named.

    A run with far less noise is refused: a filter smooths its start, which looks like other oscillations.
    """

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """Compare the median power of all runs in octaves above the motion; a line of hum does not change it.

        The wind may add noise: a run is compared with others of as much wind, or as little. `OddGain` names a run
        of another gain.
        """
        if len(seen.swings) < _FEWEST or other_gain(seen) is not None:
            return ()
        bands, power = _powers(seen.swings)
        if not bands.size:
            return ()
        logs = 0.5 * np.log(power)
        pressure = np.array([(s.run.air_density or 0.0) * s.run.wind_speed**2 for s in seen.swings])
        for place, swing in enumerate(seen.swings):
            others, winds = np.delete(logs, place, axis=0), np.delete(pressure, place)
            spread = np.ptp(others, axis=0)
            if np.any(spread > np.log(_SPREAD)):
                continue
            ratio = logs[place] - others.mean(axis=0)
            odd = np.abs(ratio) > np.maximum(np.log(policy.ODD_NOISE), _SPREADS * spread)
            less, more = odd & (ratio < 0.0), odd & (ratio > 0.0)
            if less.any() and np.any(winds <= pressure[place]):
                return (_less(swing, float(bands[less][0]), float(ratio.min())),)
            if more.any() and np.any(winds >= pressure[place]):
                what = f"its noise is {np.exp(ratio.max()):.2g} times as large as that of every other run"
                remedy = "check the sensor's range, its cable and the unit, or leave the run out"
                return (Remark(Outcome.NOTED, (swing.run.id,), what, remedy),)
        return ()


def _less(swing: Swing, first: float, ratio: float) -> Remark:
    """The remark on a run with less noise, a refusal where the difference is large.

    Args:
        first: lower end of the lowest such band, Hz.
        ratio: logarithm of the least ratio of the noise to that of the others.
    """
    what = (
        f"above {first:.2g} Hz its noise is 1/{significant(np.exp(-ratio), 2)} of that of every other run: the "
        "logger filtered the run, or its file was smoothed"
    )
    remedy = "record or export it with the bandwidth of the others, or leave the run out"
    outcome = Outcome.REFUSED if ratio < -np.log(policy.FILTERED_NOISE) else Outcome.NOTED
    return Remark(outcome, (swing.run.id,), what, remedy)


def _powers(swings: tuple[Swing, ...]) -> tuple[Array, Array]:
    """Lower ends of octaves above the motion, shape (bands,), Hz, and their powers, shape (runs, bands)."""
    highest = max(float(np.sqrt(max(s.stiffness, 0.0))) for s in swings) / (2.0 * np.pi)
    records = [evenly_spaced(swing.run.record) for swing in swings]
    top = _BELOW * min(record.sample_rate for record in records)
    count = int(np.log2(top / (_ABOVE * highest))) if highest > 0.0 else 0
    if count < 1:
        return np.zeros(0), np.zeros((len(swings), 0))
    edges = np.array([top * 2.0**octave for octave in range(-count, 1)])
    rows = []
    for record in records:
        window = np.hanning(record.yaw_rad.size)
        spectrum = np.abs(np.fft.rfft(window * (record.yaw_rad - record.yaw_rad.mean()))) ** 2
        spectrum /= float(np.sum(window**2)) * record.sample_rate
        frequency = np.fft.rfftfreq(record.yaw_rad.size, 1.0 / record.sample_rate)
        inside = [spectrum[(frequency >= low) & (frequency < high)] for low, high in pairwise(edges.tolist())]
        if any(one.size < _LEAST_BINS for one in inside):
            return np.zeros(0), np.zeros((len(swings), 0))
        rows.append([float(np.median(one)) for one in inside])
    return edges[:-1], np.maximum(np.array(rows), 1e-300)
