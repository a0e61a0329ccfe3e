"""The hum of the mains: found as a spectral line, and removed before any effect is fitted."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import chdtri

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.mains_lines import (
    HARMONICS,
    MainsLine,
    alike,
    apparent,
    mains_lines,
    shown_multiples,
)
from diagnosis.model.fact import Fact, Noted
from diagnosis.model.similarity import REFERENCE_FREQUENCY, Similarity
from diagnosis.model.similarity import frequency as motion_frequency
from diagnosis.noise.sensor_noise import SmoothCurve
from diagnosis.settings import ReadOffSettings
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array, Record

HUM_RUNS: Final = 0.75
"""Minimum share of the runs that must show the hum. Judgement."""
HUM_CONTRAST: Final = 4.0
"""Minimum ratio of the drop of χ² at the line of the hum to the largest drop nearby, all runs combined.
Judgement. The spectrum also rises at natural frequencies of the rod and at corner frequencies."""
HUM_STEADY: Final = 0.25
"""Minimum ratio of the hum's power in one half of the runs to its power in the other half. Judgement. Hum
from an amplifier or a lamp may change by a factor of two. A mode excited at the release decays more."""
HUM_ALIKE: Final = 0.02
"""Maximum relative difference in evidence at which two mains frequencies explain the lines equally well.
Judgement."""

#: Fastest swelling of its amplitude that is sought, Hz.
_SWELL_UP_TO = 0.6
_KNOTS = 12.0  # per cycle of the motion: a curve follows motions slower than six times it
_BELOW = 0.6  # of the lowest line: a curve follows the motion up to there
_NEAR = 0.25  # of 1/duration: range in which the frequency of a line is refined


@dataclass(frozen=True)
class Hum:
    """A hum that was found.

    Args:
        frequency: frequency of the mains, Hz.
        amplitude: amplitude of its strongest line, rad, root mean square over the runs that show it.
        std: standard deviation of the amplitude, rad.
        frequency_std: standard deviation of the frequency, Hz; None where the amplitude is not above the noise.
        excess: its contribution to the mean squared residual over the noise variance, a ratio.
        harmonic: the multiple of the frequency at which the strongest line is.
    """

    frequency: float
    amplitude: float
    std: float
    frequency_std: float | None
    excess: float
    harmonic: int = 1


def find_hum(nominal: Fit) -> float | None:
    """The frequency of the mains whose hum is in the residuals of the nominal fit, Hz; None where there is none.

    It is sought near 50 and 60 Hz and their multiples, at one joint rate of false alarms. Where several
    frequencies explain the same sampled lines, the one of least folding, then of the lowest multiple, is taken.
    """
    chosen = nominal.settings.read_off
    stated = chosen.mains_hz
    found = [line for line in mains_lines(nominal, stated) if _is_hum(line, chosen, known=stated > 0.0)]
    if not found:
        return None
    most = max(line.evidence for line in found)
    alike = (line for line in found if line.evidence >= (1.0 - HUM_ALIKE) * most)
    return min(alike, key=lambda line: line.plainness).parameter


def _is_hum(line: MainsLine, chosen: ReadOffSettings, *, known: bool) -> bool:
    """Whether a line exceeds chance and its surroundings, in most runs, and in their later halves as well.

    A ringing rod and the harmonics of a motion with corners also raise the spectrum beside the line, and are
    therefore rejected. A mode excited at the release decays. A line of another source may lie in any of the ranges
    that are searched, so a folded harmonic counts only beside a lower one, or where the mains are stated. No line
    counts where the ranges cover much of the spectrum.

    Args:
        known: whether the frequency of the mains is stated.
    """
    folded = line.harmonic > 1 and line.folds > 0 and not known
    if (folded or line.covered > chosen.hum_covered) and line.beside >= chosen.hum_run_rate:
        return False
    chance = float(chdtri(line.freedom, chosen.hum_rate / line.trials))
    shown = line.powers > chdtri(2.0 * line.pieces, chosen.hum_run_rate)
    return (
        line.drop > chance
        and line.contrast >= HUM_CONTRAST
        and float(np.mean(shown)) >= HUM_RUNS
        and HUM_STEADY <= line.later <= 1.0 / HUM_STEADY
    )


def refine_frequency(campaign: Campaign, frequency: float, motion: float = REFERENCE_FREQUENCY) -> float:
    """The frequency at which a sine and its harmonics remove most power from all records, Hz.

    Args:
        frequency: frequency of the mains, Hz, to within a quarter of a line's width.
        motion: frequency of the fastest motion, Hz; a line is sought beyond its harmonics.
    """
    shown = _showing(campaign, frequency, motion)
    cleared = [
        _without_motion(record, frequency, multiples, np.hanning(record.time_s.size))[1]
        for record, multiples in shown
        if multiples
    ]

    def left(trial: float) -> float:
        total = 0.0
        for (record, multiples), reading in zip((one for one in shown if one[1]), cleared, strict=True):
            wave = np.exp(-2j * np.pi * trial * (record.time_s - record.time_s[0]))
            turn = np.ones_like(wave)
            for multiple in range(1, max(multiples) + 1):
                turn = turn * wave
                total += float(abs(reading @ turn) ** 2) if multiple in multiples else 0.0
        return -total

    near = _NEAR / max((record.duration for record, multiples in shown if multiples), default=1.0)
    found = minimize_scalar(
        left, bounds=(frequency - near, frequency + near), method="bounded", options={"xatol": 5e-3 * near}
    )
    return float(found.x)


def remove_hum(
    campaign: Campaign,
    frequency: float,
    variance: float,
    chosen: ReadOffSettings,
    motion: float = REFERENCE_FREQUENCY,
) -> tuple[Campaign, Hum]:
    """Remove a hum and its harmonics from every record, where the record separates them from the motion.

    Args:
        frequency: frequency of the fundamental, Hz, visible in one record or more.
        variance: variance of the noise of one sample, rad².
        motion: frequency of the fastest motion, Hz; a line is removed beyond its harmonics.

    Returns:
        The campaign without it, and the hum that was removed. The standard deviation of its frequency is from
        the peak of all records' windowed spectra under white noise, for the strongest line only. For one record
        with window w the variance of ω is 2 S² Σw²τ²/(a Σwτ²)², τ from its middle: with a flat window that is the
        bound 24 S²/(a² n T²) (Rife & Boorstyn, IEEE Trans. Inf. Theory 20 (1974) 591, doi
        10.1109/TIT.1974.1055282).
    """
    shown = _showing(campaign, frequency, motion)
    harmonic = _strongest(shown, frequency)
    swells = _swells(shown, frequency, harmonic, variance, chosen.hum_swell_rate)
    cleaned, squares, powers, counts = [], [], [], []
    curvature, scatter = 0.0, 0.0
    for run, (record, multiples) in zip(campaign.runs, shown, strict=True):
        if not multiples:
            cleaned.append(run)
            powers.append(0.0)
            continue
        flat = np.hanning(record.time_s.size)
        swelling = [_swell(record, harmonic * frequency)] if swells and harmonic in multiples else []
        design = np.column_stack([_lines(record, frequency, multiples), *swelling])
        if swells:  # a window is blind to the ends, where a swelling or wandering hum goes its own way
            clear, reading = _beyond_motion(record, frequency, multiples)
        else:
            clear, reading = _without_motion(record, frequency, multiples, flat)
        coefficients = np.linalg.lstsq(clear(design), reading, rcond=None)[0]
        wave: Array = design @ coefficients
        cleaned.append(dataclasses.replace(run, record=Record(record.time_s, record.yaw_rad - wave)))
        powers.append(float(np.mean(wave**2)))
        if harmonic not in multiples:
            continue
        first = 2 * multiples.index(harmonic)
        squares.append(float(np.hypot(coefficients[first], coefficients[first + 1])) ** 2)
        counts.append(record.time_s.size)
        time = record.time_s - record.time_s.mean()
        curvature += float(flat.sum() * (flat @ time**2))
        scatter += float(flat.sum() ** 2 * (flat**2 @ time**2))
    count = sum(counts) / len(counts)
    noise = 4.0 * variance / count  # of a squared amplitude
    amplitude = float(np.sqrt(max(sum(squares) / len(squares) - noise, 0.0)))
    std = float(np.sqrt(2.0 * variance / (count * len(squares))))
    frequency_std = None
    if amplitude > 0.0:
        turns = amplitude * curvature * 2.0 * np.pi * harmonic
        frequency_std = float(np.sqrt(2.0 * variance * scatter) / turns)
    hum = Hum(frequency, amplitude, std, frequency_std, float(np.mean(powers)) / variance, harmonic)
    return dataclasses.replace(campaign, runs=tuple(cleaned)), hum


def hum_noted(campaign: Campaign, hum: Hum | None, similarity: Similarity) -> tuple[Noted, ...]:
    """Remarks on a hum for the user: the line stated, and the ambiguity of the sample rate.

    Args:
        campaign: the similar campaign in which the hum was found.
    """
    if hum is None:
        return ()
    found, runs = [], tuple(run.id for run in campaign.runs)
    mains = similarity.own(hum.frequency, "Hz")
    intervals = [similarity.own(run.record.sample_interval, "s") for run in campaign.runs]
    line = hum.harmonic * mains
    places = [float(abs(apparent(line, interval))) for interval in intervals]
    if hum.harmonic > 1:
        found.append(Fact("harmonic of the hum", {"line_hz": line, "harmonic": hum.harmonic}))
    if any(abs(place - line) > 1e-6 * line for place in places):
        span = sorted({min(places), max(places)})
        found.append(Fact("folded hum", {"line_hz": line, "places_hz": span}))
    other = alike(mains, hum.harmonic, intervals)
    if other is not None:
        found.append(Fact("other mains", {"other_hz": other, "mains_hz": mains}))
    return tuple(Noted(runs, one) for one in found)


def _showing(campaign: Campaign, frequency: float, motion: float) -> list[tuple[Record, list[int]]]:
    """Every record with the multiples of a frequency that it separates from the motion and from each other."""
    records = [run.record for run in campaign.runs]
    return [(r, shown_multiples(frequency, r.sample_interval, r.duration, motion)) for r in records]


def _strongest(shown: Sequence[tuple[Record, list[int]]], frequency: float) -> int:
    """The multiple of a frequency with most power in the records."""
    powers = dict.fromkeys(HARMONICS, 0.0)
    for record, multiples in shown:
        if multiples:
            clear, reading = _without_motion(record, frequency, multiples, np.hanning(record.time_s.size))
            found = np.linalg.lstsq(clear(_lines(record, frequency, multiples)), reading, rcond=None)[0]
            for multiple, pair in zip(multiples, found.reshape(-1, 2), strict=True):
                powers[multiple] += float(pair @ pair)
    return max(powers, key=powers.__getitem__)


def _swells(
    shown: Sequence[tuple[Record, list[int]]], frequency: float, harmonic: int, variance: float, rate: float
) -> bool:
    """Whether the amplitude or the phase of a hum's strongest line varies within the runs beyond chance."""
    gained, freedom = 0.0, 0
    for record, multiples in shown:
        if harmonic not in multiples or int(2.0 * _SWELL_UP_TO * record.duration) < 1:
            continue
        steady = _lines(record, frequency, multiples)
        window = np.hanning(record.time_s.size)
        clear, reading = _without_motion(record, frequency, multiples, window)
        columns = clear(np.column_stack([steady, _swell(record, harmonic * frequency)]))
        both = np.linalg.qr(columns)[0][:, steady.shape[1] :]
        # windowed white noise has the window's mean square
        share = both.T @ (both * window[:, None] ** 2)
        found = both.T @ reading
        gained += float(found @ np.linalg.solve(share, found)) / variance
        freedom += both.shape[1]
    return freedom > 0 and gained > float(chdtri(freedom, rate))


def _lines(record: Record, frequency: float, multiples: Sequence[int]) -> Array:
    """Sine and cosine at some multiples of a frequency, shape (n, 2 multiples)."""
    time = record.time_s - record.time_s[0]
    phases = [2.0 * np.pi * k * frequency * time for k in multiples]
    return np.stack([wave(phase) for phase in phases for wave in (np.sin, np.cos)], axis=1)


def _swell(record: Record, frequency: float) -> Array:
    """A line times slow cosines of time: a hum whose amplitude swells, shape (n, columns)."""
    time = record.time_s - record.time_s[0]
    orders = range(1, int(2.0 * _SWELL_UP_TO * time[-1]) + 1)
    slow = [np.cos(np.pi * k * time / time[-1]) for k in orders]
    phase = 2.0 * np.pi * frequency * time
    return np.stack([wave * s for s in slow for wave in (np.sin(phase), np.cos(phase))], axis=1)


#: A function that removes the motion from columns of samples, shape (n, k), and the reading without it, shape (n,).
_Cleared: TypeAlias = tuple[Callable[[Array], Array], Array]


def _without_motion(record: Record, frequency: float, multiples: Sequence[int], window: Array) -> _Cleared:
    """Columns and the reading, windowed, without the motion below some multiples of a frequency.

    The window keeps the motion from leaking into a line far above it. Unevenly spaced samples spread it over all
    frequencies, so a curve removes it first.
    """
    if record.uniform:
        level = np.linspace(record.yaw_rad[0], record.yaw_rad[-1], record.yaw_rad.size)
        return lambda columns: columns * window[:, None], (record.yaw_rad - level) * window
    clear, reading = _beyond_motion(record, frequency, multiples)
    return lambda columns: clear(columns) * window[:, None], reading * window


def _beyond_motion(record: Record, frequency: float, multiples: Sequence[int]) -> _Cleared:
    """Columns and the reading without a smooth curve, which follows the motion and no line."""
    lines = [abs(float(apparent(k * frequency, record.sample_interval))) for k in multiples]
    highest = min(0.5 * _KNOTS * motion_frequency(record), _BELOW * min(lines))
    curve = SmoothCurve(record.time_s, max(2, round(0.5 * record.sample_rate / highest)))
    return curve.residuals, curve.residuals(record.yaw_rad)
