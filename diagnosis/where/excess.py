"""Distribution of the squared residual over frequency, time and amplitude, and narrow lines in it.

Residuals are decomposed by the orthonormal cosine transform (Ahmed, Natarajan & Rao, IEEE Trans. Comput. 23
(1974) 90, doi 10.1109/T-C.1974.223784): it keeps the sum of squares, so that under white noise every squared
coefficient is χ² with one degree of freedom, and it does not treat a record's two ends as neighbours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import resonance
from diagnosis.model.run_data import RunData
from diagnosis.noise.bands import chance
from diagnosis.noise.sensor_noise import estimate_variance
from diagnosis.settings import WhereSettings
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array

LINE_CONTRAST: Final = 8.0
"""Minimum ratio of the power of a line in a run to the median around it. Judgement. The skirt of a resonance
has less."""
RUN_NOISE_STD: Final = 0.015
"""Relative standard deviation of the noise between runs. Judgement. Quantisation colours the noise."""

#: Bands by their upper edges in multiples of the run's own frequency.
BANDS: tuple[tuple[str, float], ...] = (
    ("0", 0.5),
    ("f0", 1.5),
    ("2f0", 2.5),
    ("3f0", 3.5),
    ("above", np.inf),
)
_OWN = 2.0  # parameters of a run that absorb residual: its angle and rate at the release


@dataclass(frozen=True, eq=False)
class RunExcess:
    """One run's squared residual by frequency.

    Args:
        frequency: frequencies of the coefficients, shape (n,), Hz.
        power: squared coefficients, shape (n,), in noise variances: one each under white noise.
        resonance: frequency of the run's free motion, Hz.
        relative: standard deviation of the noise variance, as a share of it.
        absorbed: degrees of freedom that the fit took from the run.
    """

    id: str
    frequency: Array
    power: Array
    resonance: float
    relative: float
    absorbed: float

    @property
    def excess(self) -> float:
        """Mean power minus one."""
        return float(self.power.mean()) - 1.0

    @property
    def std(self) -> float:
        """Standard deviation of the excess without a gap."""
        return float(np.hypot(np.sqrt(2.0 / self.power.size), self.relative))

    @property
    def band(self) -> np.ndarray:
        """Index into `BANDS` of every coefficient, shape (n,)."""
        return np.searchsorted([edge for _, edge in BANDS], self.frequency / self.resonance, side="right")

    def inside(self, bands: tuple[str, ...]) -> NDArray[np.bool_]:
        """Which coefficients lie in some bands, shape (n,)."""
        return np.isin(self.band, [index for index, (name, _) in enumerate(BANDS) if name in bands])

    def p_value(self) -> float:
        """Probability of as much power without a gap: the smallest p-value of the tests, times their number."""
        tests = [chance(float(self.power.sum()), self.power.size - self.absorbed, self.relative)]
        for index, (name, _) in enumerate(BANDS):
            power = self.power[self.band == index]
            if power.size:
                freedom = power.size - (self.absorbed if name == "f0" else 0.0)
                tests.append(chance(float(power.sum()), freedom, self.relative))
        return min(1.0, len(tests) * min(tests))


def run_excesses(campaign: Campaign, fit: Fit) -> list[RunExcess]:
    """Every run's squared residual by frequency; the campaign's records give the uncertainty of the noise."""
    data = fit.problem.data
    records = {run.id: run.record for run in campaign.runs}
    relative = [estimate_variance(records[run.id])[1] for run in data.runs]
    # by sample, not by block: if all runs share one level, it was pooled over them
    levels = [run.noise.variance * run.block for run in data.runs]
    if np.allclose(levels, levels[0], rtol=1e-9):
        relative = [float(np.mean(relative)) / np.sqrt(len(relative))] * len(relative)
    relative = [float(np.hypot(value, RUN_NOISE_STD)) for value in relative]
    shared = len(fit.problem.names) / len(data.runs)
    return [
        RunExcess(
            run.id,
            np.arange(residual.size) / (2.0 * residual.size * run.interval),
            np.asarray(dct(residual, norm="ortho")) ** 2,
            resonance(fit, i),
            relative[i],
            _OWN + shared,
        )
        for i, (run, residual) in enumerate(zip(data.runs, fit.residuals, strict=True))
    ]


@dataclass(frozen=True)
class BandExcess:
    """One band of the residual, all runs together.

    Args:
        excess: sum of power beyond white noise, in units of the noise variance.
        mean: excess per coefficient, a ratio.
        p_value: probability of as much power without a gap.
    """

    band: str
    excess: float
    mean: float
    p_value: float


def band_excesses(runs: list[RunExcess]) -> tuple[BandExcess, ...]:
    """The bands of a campaign's residual that contain coefficients."""
    result = []
    for index, (name, _) in enumerate(BANDS):
        power = np.concatenate([run.power[run.band == index] for run in runs])
        if power.size == 0:
            continue
        absorbed = sum(run.absorbed for run in runs) if name == "f0" else 0.0
        relative = float(np.mean([run.relative for run in runs]))
        excess = float(power.sum()) - power.size
        p_value = chance(excess + power.size, power.size - absorbed, relative)
        result.append(BandExcess(name, excess, excess / power.size, p_value))
    return tuple(result)


def bands_beyond_chance(bands: tuple[BandExcess, ...], chosen: WhereSettings) -> tuple[str, ...]:
    """The bands with power beyond chance; all bands if there are none."""
    level = chosen.band_rate / max(len(bands), 1)
    found = tuple(band.band for band in bands if band.p_value < level and band.excess > 0.0)
    return found or tuple(band.band for band in bands)


def within_bands(residual: Array, run: RunExcess, bands: tuple[str, ...]) -> tuple[Array, float]:
    """The part of a residual in some bands.

    Args:
        residual: scaled, shape (n,).

    Returns:
        The filtered residual, shape (n,), and the share of white noise's power that passes.
    """
    keep = run.inside(bands)
    filtered = idct(np.where(keep, dct(residual, norm="ortho"), 0.0), norm="ortho")
    return np.asarray(filtered, dtype=np.float64), float(keep.mean())


@dataclass(frozen=True, eq=False)
class Profile:
    """Excess squared residual over one quantity, all runs together.

    Args:
        edges: edges of the bins, shape (n + 1,), in the quantity's unit.
        energy: sum over a bin of power beyond white noise, shape (n,), in noise variances.
        mean: excess per residual, shape (n,); NaN where a bin is empty.
        std: standard deviation of the mean without a gap, shape (n,).
    """

    edges: Array
    energy: Array
    mean: Array
    std: Array

    def interval(self, share: float) -> tuple[float, float] | None:
        """The shortest interval that contains a share (a fraction) of the excess; None without an excess."""
        return shortest_interval(self.edges, self.energy, share)


def profile(
    edges: Array, place: list[Array], power: list[Array], expected: list[float], variance: list[float]
) -> Profile:
    """Gather squared residuals into bins.

    Args:
        edges: edges of the bins, ascending, shape (n + 1,).
        place: value of the quantity at every residual, by run, arrays of the shape of ``power``.
        power: squared residuals in noise variances, by run, arrays of shape (m,).
        expected: mean of the squared residuals under white noise, by run.
        variance: contribution of each squared residual to the variance of a sum under white noise, by run.
    """
    where = np.concatenate(place)
    excess = np.concatenate([p - e for p, e in zip(power, expected, strict=True)])
    spread = np.concatenate([np.full(p.size, v) for p, v in zip(power, variance, strict=True)])
    count = np.histogram(where, edges)[0].astype(np.float64)
    energy = np.histogram(where, edges, weights=excess)[0]
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(count > 0, energy / count, np.nan)
        std = np.where(count > 0, np.sqrt(np.histogram(where, edges, weights=spread)[0]) / count, np.nan)
    return Profile(edges, energy, mean, std)


def shortest_interval(edges: Array, energy: Array, share: float) -> tuple[float, float] | None:
    """The shortest sequence of bins with a share of the whole.

    Args:
        edges: edges of the bins, shape (n + 1,).
        energy: energy by bin, shape (n,); single bins may be negative.
        share: share of the sum, a fraction.

    Returns:
        The ends of the sequence; None where the sum is not positive.
    """
    total = float(energy.sum())
    if total <= 0.0:
        return None
    cumulative = np.concatenate([[0.0], np.cumsum(energy)])
    best = (float(edges[0]), float(edges[-1]))
    for i in range(energy.size):
        enough = cumulative[i + 1 :] - cumulative[i] >= share * total
        j = i + 1 + int(np.argmax(enough))
        if enough.any() and edges[j] - edges[i] < best[1] - best[0]:
            best = (float(edges[i]), float(edges[j]))
    return best


_WIDTH = 5  # coefficients a line spreads over
_AROUND = 60  # coefficients on either side for the median that a line must exceed
_HARMONIC = 0.2  # share of the run's frequency: a line this close to a harmonic belongs to the motion
_MOTION = 0.4  # share of the run's frequency: the same for the motion itself, because its frequency may drift
_LOWEST = 0.5  # share of the run's frequency below which drifts look like lines
_APART = 0.5  # share of the run's frequency between two lines: a closer line is the skirt of the first
_PER_RUN = 2
_OF_INPUT = 1e-3  # share of the power of a run's input: less may be interference in its wires
_MULTIPLES = 3  # multiple of an input's frequency: responses at higher frequencies are never most of a gap


@dataclass(frozen=True)
class ResidualLine:
    """A line in one run.

    Args:
        run: id of the run.
        frequency_hz: Hz.
        share: of the run's excess squared residual, a fraction.
        amplitude_rad: amplitude of the reading, in its unit.
    """

    run: str
    frequency_hz: float
    share: float
    amplitude_rad: float


def residual_lines(
    runs: list[RunExcess], data: Sequence[RunData], chosen: WhereSettings
) -> tuple[ResidualLine, ...]:
    """The prominent lines in the residual of single runs: at most two in each, the stronger first."""
    lines: list[ResidualLine] = []
    for run, run_data in zip(runs, data, strict=True):
        local = np.convolve(run.power, np.ones(_WIDTH), mode="same")
        open_to = away_from_motion(run.frequency / run.resonance) & ~of_drive(run.frequency.size, run_data)
        of_run: list[ResidualLine] = []
        for index in np.argsort(np.where(open_to, local, 0.0))[::-1][: 20 * _PER_RUN].tolist():
            excess = float(local[index]) - _WIDTH
            unlikely = len(runs) * run.power.size * chance(float(local[index]), _WIDTH, run.relative)
            if unlikely > chosen.line_rate or len(of_run) == _PER_RUN:
                break
            close = any(
                abs(line.frequency_hz - run.frequency[index]) < _APART * run.resonance for line in of_run
            )
            beside = np.concatenate(
                [
                    local[max(index - _AROUND, 0) : max(index - _WIDTH, 0)],
                    local[index + _WIDTH : index + _AROUND],
                ]
            )
            around = float(np.median(beside)) if beside.size else 0.0
            if not open_to[index] or close or local[index] < LINE_CONTRAST * around:
                continue
            near = slice(max(index - _WIDTH // 2, 0), min(index + _WIDTH // 2 + 1, run.power.size))
            whole = max(float(run.power.sum()) - run.power.size, excess)
            frequency = float(np.average(run.frequency[near], weights=run.power[near]))
            amplitude = float(run_data.noise_at(frequency)) * float(np.sqrt(2.0 * excess / run.power.size))
            of_run.append(ResidualLine(run.id, frequency, excess / whole, amplitude))
        lines += of_run
    return tuple(lines)


def of_drive(size: int, own: RunData) -> NDArray[np.bool_]:
    """Frequencies at which a line may be the response to a run's input: bands of its power, and their multiples.

    Args:
        size: number of coefficients, n; the result has the shape (n,).
    """
    mask = np.zeros(size, dtype=bool)
    if own.drive is None:
        return mask
    time = own.start + (np.arange(size) + 0.5) * own.interval
    values = np.interp(time, own.drive.time_s + own.drive.delay, own.drive.values)
    # tapered, because a sinusoid that does not fit into the record leaks into all frequencies
    power = dct((values - values.mean()) * np.hanning(values.size), norm="ortho") ** 2
    local = np.convolve(power, np.ones(_WIDTH), mode="same")
    for index in np.flatnonzero(local >= _OF_INPUT * float(power.sum())).tolist():
        for multiple in range(1, _MULTIPLES + 1):
            # a multiple is proportionally wider
            reach = _WIDTH + multiple // 2
            mask[max(multiple * index - reach, 0) : multiple * index + reach + 1] = True
    return mask


def away_from_motion(order: Array) -> NDArray[np.bool_]:
    """Whether a line does not belong to the motion, its drift or its harmonics.

    Args:
        order: frequency over the frequency of the run's motion, any shape.
    """
    harmonic = (np.abs(order - np.round(order)) < _HARMONIC) & (order < 3.5)
    harmonic |= np.abs(order - 1.0) < _MOTION
    return (order > _LOWEST) & ~harmonic
