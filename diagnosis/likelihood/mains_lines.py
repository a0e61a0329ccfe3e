"""Mains lines in residuals: at 50 or 60 Hz and their multiples, as sampled.

A line above half the sample rate appears at another frequency, because the spectrum of samples repeats: 60 Hz
sampled at 100 Hz appears at 40 Hz. Every line is therefore sought at its own frequency less the nearest
multiple of the sample rate. It is not sought on the motion or its harmonics, nor at the ends of the spectrum,
where sine and cosine are not distinct.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import (
    ResidualSpectrum,
    SpectralLine,
    block_gain,
    resonance,
    smooth_spectra,
)
from diagnosis.model.run_data import RunData
from diagnosis.model.similarity import Similarity
from tunnel_sim.vocabulary.record import Array

#: Nominal frequencies of the mains, Hz.
MAINS = (50.0, 60.0)
#: The multiples to be searched. Rectifiers and lamps give the even multiples, transformers the odd ones.
HARMONICS = range(1, 6)
#: Greatest deviation of the mains, a share of their frequency: a grid without a synchronous connection to
#: others keeps 50 Hz within 2 % during 95 % of a week (EN 50160:2010, 4.2.1).
_WANDER = 0.02
#: Smallest search range, a share of the frequency: large grids keep 50 Hz within 1 % during 99.5 % of a year
#: (EN 50160:2010, 4.2.1) and 60 Hz within 0.5 Hz (NERC PRC-024-3, no-trip zone).
_LEAST_WANDER = 0.01
#: Largest search range of one line on either side, as a share of the spectrum beyond the motion's harmonics.
#: In a narrow spectrum a wider range often contains a line of another source. Judgement.
_OF_SPECTRUM = 0.05
_BEYOND_MOTION = 3.3  # multiple of the fastest motion's frequency: beyond its third harmonic by a tenth
_WIDTH = 2.0  # half a line's width with a Hann window, in 1/duration
#: Length of the pieces for adding powers, s of the rig as measured: the mains' phase is steady within a piece.
#: A standard measurement of the mains' frequency takes as long (IEC 61000-4-30:2015, 5.1).
_PIECE = 10.0
_LEAST_PIECE = 2.0  # minimum length of a piece, s of the similar rig: four cycles
_PADDING = 8
_BESIDE = (
    0.6,
    4.0,
)  # Hz of the similar rig: least and greatest distance of the spectrum compared with a line
# share of a multiple of the motion's frequency, which changes a little with the amplitude
_MOTION_KNOWN = 1e-3
_SAME = 1e-6  # cycles per sample
_CLEAR = 3.0  # or this multiple of 1/duration of a piece, if it is larger


@dataclass(frozen=True, eq=False)
class MainsLine(SpectralLine):
    """A line at a multiple of the mains' frequency.

    Args:
        parameter: frequency of the mains, Hz.
        drop: drop of χ² when the line is removed from the runs concerned, dimensionless.
        contrast: ratio of the drop at the line to the greatest drop beside it, dimensionless.
        amplitude: amplitude of the line at the sensor, rad, root mean square over the runs concerned.
        phases: of sine, rad, by run, shape (runs,); zero for runs not concerned.
        harmonic: the multiple.
        freedom: twice the number of pieces of records with added powers.
        trials: number of independent places searched for mains lines, over all lines.
        powers: drop of χ² of every run concerned, dimensionless, shape (runs concerned,).
        pieces: number of pieces of every run concerned, shape (runs concerned,).
        later: power in the later halves of these runs over the power in the earlier halves, dimensionless.
        evidence: drop of χ² beyond chance, at all visible multiples of the frequency, dimensionless.
        folds: number of times the line is folded, in the run of the lowest sample rate.
        beside: p-value of the clearest visible lower multiple; 1 if there is none.
        covered: share of the visible spectrum searched for mains lines as plain as this one: the probability
            that a line of another source is mistaken for it.
    """

    harmonic: int
    freedom: int
    trials: float
    powers: Array
    pieces: Array
    later: float
    evidence: float
    folds: int
    beside: float = 1.0
    covered: float = 0.0

    @property
    def plainness(self) -> tuple[int, int]:
        """Number of foldings, and the multiple: smaller numbers are more plausible."""
        return self.folds, self.harmonic


def apparent(frequency: float | Array, interval: float) -> Array:
    """Apparent frequency of a line in samples, Hz; negative where the phase runs backwards.

    Args:
        frequency: Hz, any shape.
        interval: between samples, s.
    """
    cycles = np.asarray(frequency, np.float64) * interval
    return np.asarray((cycles - np.round(cycles)) / interval, np.float64)


def resolvable(frequency: float | Array, interval: float, duration: float, motion: float) -> np.ndarray:
    """Whether samples separate a line from the motion, its harmonics and the ends of the spectrum.

    Args:
        frequency: Hz, any shape.
        interval: between samples, s.
        duration: length of the record that resolves the line, s.
        motion: frequency of the motion, Hz.
    """
    shown = np.abs(apparent(frequency, interval))
    lowest, highest = _limits(interval, duration, motion)
    return np.asarray((shown >= lowest) & (shown <= highest))


def shown_multiples(frequency: float, interval: float, duration: float, motion: float) -> list[int]:
    """The multiples of a frequency that are visible (`resolvable`) and distinct from the lower ones.

    Args:
        frequency: of the mains, Hz.
        interval: between samples, s.
        duration: length of the record that resolves a line, s.
        motion: frequency of the fastest motion, Hz.
    """
    found: list[int] = []
    taken: list[float] = []
    for multiple in HARMONICS:
        place = abs(float(apparent(multiple * frequency, interval)))
        apart = all(abs(place - other) * duration > 2.0 * _WIDTH for other in taken)
        if apart and resolvable(multiple * frequency, interval, duration, motion):
            found.append(multiple)
            taken.append(place)
    return found


def _limits(interval: float, duration: float, motion: float) -> tuple[float, float]:
    """Lowest and highest apparent frequency in the search for a line, Hz."""
    return _BEYOND_MOTION * motion + _WIDTH / duration, 0.5 / interval - _WIDTH / duration


def mains_interval(similarity: Similarity) -> float:
    """Longest block interval at which block means do not fold a mains line, s of the similar rig."""
    highest = HARMONICS[-1] * max(MAINS) * (1.0 + _WANDER)
    return 1.0 / (2.0 * similarity.similar(highest, "Hz"))


def alike(frequency: float, harmonic: int, intervals: list[float]) -> float | None:
    """The other nominal frequency of the mains, if its line coincides in all records; else None.

    Args:
        frequency: of the mains, Hz of the rig as measured.
        harmonic: multiple of the frequency at which the line is.
        intervals: between samples, s of the rig as measured, by record.
    """
    rate, line = 1.0 / intervals[0], harmonic * frequency
    for mains in MAINS:
        if abs(frequency - mains) <= _WANDER * mains:
            continue
        for turned in (line, -line):
            other = turned + rate * float(np.round((harmonic * mains - turned) / rate))
            shown = [np.abs(apparent(np.array([other, line]), interval)) for interval in intervals]
            same = all(abs(a - b) * h < _SAME for (a, b), h in zip(shown, intervals, strict=True))
            if same and abs(other / harmonic - mains) <= _WANDER * mains:
                return other / harmonic
    return None


@dataclass(frozen=True, eq=False)
class _Pieces:
    """The residuals of one run in pieces of equal length.

    Args:
        power: sum over the pieces of the drop of χ² when a sine is removed, by frequency, shape (n,).
        halves: the parts of ``power`` from the earlier and the later half of the run, shape (2, n).
        spacing: between the frequencies, Hz.
        count: number of pieces.
        duration: length of a piece, s.
        run: the run that is cut.
        motion: frequency of the fastest motion, Hz.
        own: frequency of the run's own motion, Hz.
    """

    power: Array
    halves: Array
    spacing: float
    count: int
    duration: float
    run: RunData
    motion: float
    own: float

    @classmethod
    def of(cls, run: RunData, residual: Array, motion: float, own: float, length: float) -> _Pieces:
        """Cut into an even number of pieces, at least two, about ``length`` s long."""
        count = 2 * max(1, round(0.5 * residual.size * run.interval / length))
        size = residual.size // count
        window = np.hanning(size)
        parts = residual[: count * size].reshape(count, size) * window
        spectra = np.abs(np.fft.rfft(parts, _PADDING * size, axis=1)) ** 2 * (2.0 / float(window @ window))
        halves = spectra.reshape(2, count // 2, -1).sum(axis=1)
        spacing = 1.0 / (_PADDING * size * run.interval)
        return cls(halves.sum(axis=0), halves, spacing, count, size * run.interval, run, motion, own)

    def index(self, frequency: float | Array) -> np.ndarray:
        """The nearest index of the spectrum to a line of this frequency."""
        place = np.round(np.abs(apparent(frequency, self.run.interval)) / self.spacing).astype(int)
        return np.asarray(np.minimum(place, self.power.size - 1))

    def of_motion(self, frequency: float) -> int:
        """The multiple of the motion's frequency at which a line appears; 0 for none."""
        place = abs(float(apparent(frequency, self.run.interval)))
        multiple = round(place / self.own)
        near = 1.0 / (self.run.reading.size * self.run.interval) + _MOTION_KNOWN * place
        return multiple if abs(place - multiple * self.own) < near else 0

    def multiples(self, without: int) -> float:
        """The largest drop of χ² at the multiples of the motion's frequency beyond the third, except one."""
        orders = np.arange(np.ceil(_BEYOND_MOTION), 0.5 / self.run.interval / self.own)
        places = self.index(self.own * orders[orders != without])
        return float(np.max(self.power[places], initial=0.0))

    def shows(self, frequency: float | Array) -> np.ndarray:
        """Whether the run separates a line of this frequency from the motion, as `resolvable`."""
        return resolvable(frequency, self.run.interval, self.duration, self.motion)

    def reach(self, frequency: float) -> float:
        """Search range about a frequency, as a share of it; 0 where the line is not searched for."""
        lowest, highest = _limits(self.run.interval, self.duration, self.motion)
        share = min(_WANDER, _OF_SPECTRUM * (highest - lowest) / frequency)
        ends = frequency * (1.0 + share * np.array([-1.0, 0.0, 1.0]))
        zones = np.floor(2.0 * ends * self.run.interval)
        whole = bool(np.all(self.shows(ends))) and bool(np.all(zones == zones[0]))
        return share if whole and share >= _LEAST_WANDER else 0.0


def fastest(fit: Fit) -> float:
    """Frequency of the fastest motion of the fitted model, Hz."""
    return max(resonance(fit, i) for i in range(len(fit.problem.data.runs)))


def mains_lines(fit: Fit, stated: float = 0.0) -> list[MainsLine]:
    """The strongest line at every visible multiple of each nominal frequency of the mains.

    Ordered by nominal frequency, then by multiple.

    Args:
        stated: nominal frequency of the mains, Hz of the rig as measured; 0: not stated, and both are tried.
    """
    data = fit.problem.data
    length = max(data.similarity.similar(_PIECE, "s"), _LEAST_PIECE)
    runs = [
        _Pieces.of(run, residual, fastest(fit), resonance(fit, i), length)
        for i, (run, residual) in enumerate(zip(data.runs, fit.residuals, strict=True))
    ]
    sought = list(_sought(runs, data.similarity, (stated,) if stated > 0.0 else MAINS))
    trials = sum(_places(runs, *one) for one in sought)
    whole = smooth_spectra(fit)
    found = (_line(runs, whole, *one, trials) for one in sought)
    lines = [line for line in found if line is not None]
    widths = [(_foldings(runs, *one), one[1], _share_of_spectrum(runs, *one)) for one in sought]
    covers = [sum(w for *plain, w in widths if tuple(plain) <= line.plainness) for line in lines]
    return [replace(line, covered=share) for line, share in zip(lines, covers, strict=True)]


def mains_line(fit: Fit) -> MainsLine | None:
    """The most prominent mains line; None where no multiple of the mains' frequency is visible."""
    return max(mains_lines(fit), key=lambda line: line.contrast, default=None)


def _sought(
    runs: list[_Pieces], similarity: Similarity, mains: Sequence[float]
) -> Iterator[tuple[float, int, float, tuple[int, ...]]]:
    """Nominal frequency (Hz), multiple, range (a share) and run numbers of every line of the search.

    Args:
        mains: the nominal frequencies, Hz of the rig as measured.
    """
    for own in mains:
        nominal = similarity.similar(own, "Hz")
        for harmonic in HARMONICS:
            reaches = [run.reach(harmonic * nominal) for run in runs]
            concerned = tuple(i for i, reach in enumerate(reaches) if reach > 0.0)
            if concerned:
                yield nominal, harmonic, min(reaches[i] for i in concerned), concerned


def _places(
    runs: list[_Pieces], nominal: float, harmonic: int, reach: float, concerned: tuple[int, ...]
) -> float:
    """Number of independent places in a range: two in each spectral line, as a window halves the record."""
    longest = max(runs[i].duration for i in concerned)
    return 2.0 * (2.0 * reach * harmonic * nominal * longest + 1.0)


def _foldings(
    runs: list[_Pieces], nominal: float, harmonic: int, reach: float, concerned: tuple[int, ...]
) -> int:
    """Number of times the middle of a range is folded, in the run of the lowest sample rate."""
    del reach
    return max(int(np.round(harmonic * nominal * runs[i].run.interval)) for i in concerned)


def _share_of_spectrum(
    runs: list[_Pieces], nominal: float, harmonic: int, reach: float, concerned: tuple[int, ...]
) -> float:
    """Width of a range as a share of the visible spectrum beyond the motion, in the run with the largest share."""
    width, shares = 2.0 * reach * harmonic * nominal, []
    for i in concerned:
        lowest, highest = _limits(runs[i].run.interval, runs[i].duration, runs[i].motion)
        shares.append(width / (highest - lowest))
    return max(shares)


def _line(
    runs: list[_Pieces],
    whole: list[ResidualSpectrum],
    nominal: float,
    harmonic: int,
    reach: float,
    concerned: tuple[int, ...],
    trials: float,
) -> MainsLine | None:
    """The strongest line in a range; None without a visible spectrum beside it."""
    among = [runs[i] for i in concerned]
    spacing = min(run.spacing for run in among)
    middle = harmonic * nominal
    grid = np.arange(middle * (1.0 - reach), middle * (1.0 + reach) + spacing, spacing)
    total = np.sum([run.power[run.index(grid)] for run in among], axis=0)
    place = float(grid[np.argmax(total)])
    clear = max(_BESIDE[0], _CLEAR / min(run.duration for run in among))
    offsets = np.arange(clear, max(_BESIDE[1], 2.0 * clear), spacing)
    beside = place + np.concatenate([-offsets, offsets])
    beside = beside[np.all([run.shows(beside) for run in among], axis=0)]
    if beside.size == 0:
        return None
    floor = float(np.max(np.sum([run.power[run.index(beside)] for run in among], axis=0)))
    places = [run.index(place) for run in among]
    powers = np.array([float(run.power[at]) for run, at in zip(among, places, strict=True)])
    earlier, later = np.sum([run.halves[:, at] for run, at in zip(among, places, strict=True)], axis=0)
    spectra = [whole[i] for i in concerned]
    refined = _refined(among, spectra, place)
    orders = [run.of_motion(refined) for run in among]
    # a line at a multiple of every run's motion must stand out from the other multiples
    if all(orders):
        floor = max(floor, sum(run.multiples(order) for run, order in zip(among, orders, strict=True)))
    sines = _sines(among, spectra, refined)
    phases = np.zeros(len(runs))
    # the transform is by cos − i sin: a sine a sin(ωt + φ) gives a exp(i(φ − π/2))
    phases[list(concerned)] = np.angle(sines) + np.pi / 2
    frequency = refined / harmonic
    return MainsLine(
        frequency,
        float(powers.sum()),
        float(powers.sum()) / max(floor, 1e-9),
        # the smoothed transform retains the noise level: lines lose a third of it
        float(np.sqrt(1.5 * np.mean(np.abs(sines) ** 2))),
        phases,
        harmonic=harmonic,
        freedom=2 * sum(run.count for run in among),
        trials=trials,
        powers=powers,
        pieces=np.array([float(run.count) for run in among]),
        later=float(later) / max(float(earlier), 1e-9),
        evidence=_evidence(runs, frequency),
        folds=max(int(np.round(refined * run.run.interval)) for run in among),
        beside=_beside(runs, frequency, harmonic),
    )


def _beside(runs: list[_Pieces], frequency: float, harmonic: int) -> float:
    """P-value of the clearest visible multiple below another one, times their number; 1 where none is visible."""
    tests = []
    for lower in range(1, harmonic):
        power, freedom = 0.0, 0
        for run in runs:
            shown = shown_multiples(frequency, run.run.interval, run.duration, run.motion)
            if lower in shown:
                power, freedom = (
                    power + float(run.power[run.index(lower * frequency)]),
                    freedom + 2 * run.count,
                )
        if freedom:
            tests.append(float(chdtrc(freedom, power)))
    return min(1.0, len(tests) * min(tests)) if tests else 1.0


def _refined(runs: list[_Pieces], spectra: list[ResidualSpectrum], place: float) -> float:
    """The frequency of greatest power in the whole records, within a piece's line, Hz."""
    width = 1.0 / max(run.duration for run in runs)
    near = np.arange(place - width, place + width, min(float(one.frequency[1]) for one in spectra))
    pairs = zip(runs, spectra, strict=True)
    total = np.sum([one.power(np.abs(apparent(near, run.run.interval))) for run, one in pairs], axis=0)
    return float(near[np.argmax(total)])


def _sines(runs: list[_Pieces], spectra: list[ResidualSpectrum], frequency: float) -> np.ndarray:
    """Complex amplitude of a sine in every reading, in its unit, shape (runs,)."""
    found = []
    for piece, spectrum in zip(runs, spectra, strict=True):
        run, shown = piece.run, float(apparent(frequency, piece.run.interval))
        value = complex(spectrum.at(abs(shown)))
        value = value if shown >= 0.0 else value.conjugate()
        gain = block_gain(frequency, run) * complex(run.response(frequency))
        found.append(value * run.noise.scale / gain)
    return np.array(found)


def _evidence(runs: list[_Pieces], frequency: float) -> float:
    """Drop of χ² beyond chance at all visible multiples of a frequency."""
    found = 0.0
    for run in runs:
        for multiple in shown_multiples(frequency, run.run.interval, run.duration, run.motion):
            found += max(float(run.power[run.index(multiple * frequency)]) - 2.0 * run.count, 0.0)
    return found
