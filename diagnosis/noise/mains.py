"""The hum of the mains: found as a spectral line, and removed before any effect is fitted."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import chdtri

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.nondimensional import frequency as motion_frequency
from diagnosis.likelihood.residuals import mains_line, smooth_spectra
from diagnosis.noise.sensor_noise import SmoothCurve
from diagnosis.policy import FALSE_ALARM_RATE, HUM_CONTRAST, NOISE_FALSE_ALARM_SHARE, THROUGHOUT
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array, Record

_HARMONICS = 5
#: Fastest swelling of its amplitude that is sought, Hz.
_SWELL_UP_TO = 0.6
_KNOTS = 12.0  # per cycle of the motion: a curve follows what is slower than six times the motion


@dataclass(frozen=True)
class Hum:
    """A hum found.

    Args:
        frequency: Hz.
        amplitude: of the fundamental, rad, root mean square over the runs.
        std: of the amplitude, rad.
        frequency_std: standard deviation of the frequency, Hz; None where the amplitude is not above the noise.
        excess: what it adds to the mean squared residual over the noise variance, a ratio.
    """

    frequency: float
    amplitude: float
    std: float
    frequency_std: float | None
    excess: float


def find_hum(nominal: Fit) -> float | None:
    """The frequency of a hum in the residuals of the nominal fit, Hz; None where there is none beyond chance.

    A ringing rod and the harmonics of a motion with corners also raise the spectrum beside the line, and are
    therefore rejected.
    """
    line = mains_line(nominal)
    if line is None or line.contrast < HUM_CONTRAST:
        return None
    by_chance = float(chdtri(2, FALSE_ALARM_RATE))
    shown = [spectrum.power(line.parameter) > by_chance for spectrum in smooth_spectra(nominal)]
    return line.parameter if np.mean(shown) >= THROUGHOUT else None


def refine_frequency(campaign: Campaign, frequency: float) -> float:
    """The frequency at which a sine and its harmonics remove most power from all records, Hz.

    Args:
        frequency: of the mains, Hz, to within 0.02 Hz.
    """
    cleared = [_without_motion(run.record, np.hanning(run.record.time_s.size))[1] for run in campaign.runs]

    def left(trial: float) -> float:
        total = 0.0
        for run, reading in zip(campaign.runs, cleared, strict=True):
            wave = np.exp(-2j * np.pi * trial * (run.record.time_s - run.record.time_s[0]))
            turn, power = wave, 0.0
            for _ in _harmonics(run.record, trial):
                power += float(abs(reading @ turn) ** 2)
                turn = turn * wave
            total += power
        return -total

    found = minimize_scalar(
        left, bounds=(frequency - 0.02, frequency + 0.02), method="bounded", options={"xatol": 1e-4}
    )
    return float(found.x)


def remove_hum(campaign: Campaign, frequency: float, variance: float) -> tuple[Campaign, Hum]:
    """Remove a hum and its harmonics from every record.

    Args:
        frequency: of the fundamental, Hz.
        variance: of the noise of one sample, rad².

    Returns:
        The campaign without it, and the hum that was removed. The standard deviation of its frequency is that of
        the peak of all records' windowed spectra under white noise, of the fundamental only. Of one record of
        window w the variance of ω is 2 S² Σw²τ²/(a Σwτ²)², τ from its middle: with a flat window that is the bound
        24 S²/(a² n T²) (Rife & Boorstyn, IEEE Trans. Inf. Theory 20 (1974) 591, doi 10.1109/TIT.1974.1055282).
    """
    from scipy.signal.windows import tukey  # only here: slow to load

    cleaned, squares, powers = [], [], []
    curvature, scatter = 0.0, 0.0
    gained, freedom = 0.0, 0  # whether the hum's amplitude varies within the runs beyond chance
    for record in [run.record for run in campaign.runs]:
        if int(2.0 * _SWELL_UP_TO * (record.time_s[-1] - record.time_s[0])) < 1:
            continue
        steady, swelling = _lines(record, frequency), _swell(record, frequency)
        window = np.hanning(record.time_s.size)
        clear, reading = _without_motion(record, window)
        both = np.linalg.qr(clear(np.column_stack([steady, swelling])))[0][:, steady.shape[1] :]
        # windowed white noise has the window's mean square
        share = both.T @ (both * window[:, None] ** 2)
        found = both.T @ reading
        gained += float(found @ np.linalg.solve(share, found)) / variance
        freedom += swelling.shape[1]
    swells = freedom > 0 and gained > float(chdtri(freedom, NOISE_FALSE_ALARM_SHARE * FALSE_ALARM_RATE))
    for run in campaign.runs:
        record = run.record
        flat = np.hanning(record.time_s.size)
        design = np.column_stack(
            [_lines(record, frequency), *([_swell(record, frequency)] if swells else [])]
        )
        # a window that keeps the ends, where a swelling hum may be strongest
        clear, reading = _without_motion(record, tukey(record.time_s.size, 0.3) if swells else flat)
        coefficients = np.linalg.lstsq(clear(design), reading, rcond=None)[0]
        wave: Array = design @ coefficients
        cleaned.append(dataclasses.replace(run, record=Record(record.time_s, record.yaw_rad - wave)))
        squares.append(float(np.hypot(coefficients[0], coefficients[1])) ** 2)
        powers.append(float(np.mean(wave**2)))
        time = record.time_s - record.time_s.mean()
        curvature += float(flat.sum() * (flat @ time**2))
        scatter += float(flat.sum() ** 2 * (flat**2 @ time**2))
    count = sum(run.record.yaw_rad.size for run in campaign.runs) / len(campaign.runs)
    noise = 4.0 * variance / count  # of a squared amplitude
    amplitude = float(np.sqrt(max(sum(squares) / len(squares) - noise, 0.0)))
    std = float(np.sqrt(2.0 * variance / (count * len(squares))))
    frequency_std = None
    if amplitude > 0.0:
        frequency_std = float(np.sqrt(2.0 * variance * scatter) / (amplitude * curvature * 2.0 * np.pi))
    hum = Hum(frequency, amplitude, std, frequency_std, float(np.mean(powers)) / variance)
    return dataclasses.replace(campaign, runs=tuple(cleaned)), hum


def _harmonics(record: Record, frequency: float) -> list[int]:
    """The multiples of a frequency that a record resolves."""
    return [k for k in range(1, _HARMONICS + 1) if k * frequency < 0.48 * record.sample_rate]


def _lines(record: Record, frequency: float) -> Array:
    """Sine and cosine of the fundamental, then of its harmonics, shape (n, 2 harmonics)."""
    time = record.time_s - record.time_s[0]
    phases = [2.0 * np.pi * k * frequency * time for k in _harmonics(record, frequency)]
    return np.stack([wave(phase) for phase in phases for wave in (np.sin, np.cos)], axis=1)


def _swell(record: Record, frequency: float) -> Array:
    """The fundamental times slow cosines of time: a hum whose amplitude swells, shape (n, columns)."""
    time = record.time_s - record.time_s[0]
    orders = range(1, int(2.0 * _SWELL_UP_TO * time[-1]) + 1)
    slow = [np.cos(np.pi * k * time / time[-1]) for k in orders]
    phase = 2.0 * np.pi * frequency * time
    return np.stack([wave * s for s in slow for wave in (np.sin(phase), np.cos(phase))], axis=1)


def _without_motion(record: Record, window: Array) -> tuple[Callable[[Array], Array], Array]:
    """What takes the slow motion out of columns of samples, and the windowed reading without it.

    The window keeps the motion from leaking into a line far above it. Unevenly spaced samples spread it over all
    frequencies, so that a curve takes it out first.
    """
    if record.uniform:
        level = np.linspace(record.yaw_rad[0], record.yaw_rad[-1], record.yaw_rad.size)
        return lambda columns: columns * window[:, None], (record.yaw_rad - level) * window
    piece = max(2, round(record.sample_rate / (_KNOTS * motion_frequency(record))))
    curve = SmoothCurve(record.time_s, piece)
    return lambda columns: curve.left(columns) * window[:, None], curve.left(record.yaw_rad) * window
