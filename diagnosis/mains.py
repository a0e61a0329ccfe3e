"""The hum of the mains: found as a line, taken out before anything else is fitted."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from diagnosis.least_squares import Fit
from diagnosis.spectra import Line, mains_line
from tunnel_sim.campaign import Campaign, Run
from tunnel_sim.record import Array, Record

_HARMONICS = 5
#: Drop of χ² over that beside the line, for two parameters a run: by chance below 1 in 10 000 campaigns.
_CONTRAST = 3.0


@dataclass(frozen=True)
class Hum:
    """A hum found.

    Args:
        frequency: Hz.
        amplitude: of the fundamental, rad, root mean square over the runs.
        std: its standard deviation, rad.
        excess: what it adds to the mean squared residual over the noise variance.
    """

    frequency: float
    amplitude: float
    std: float
    excess: float


def find_hum(nominal: Fit) -> Line | None:
    """The hum in the residuals of the nominal fit.

    Args:
        nominal: its residuals.

    Returns:
        The line, None where there is none beyond chance. A ringing rod or harmonics of a clipped motion raise the
        floor beside the line as well, and do not pass.
    """
    line = mains_line(nominal)
    if line is None:
        return None
    runs = len(nominal.residuals)
    beyond_chance = line.drop > 2.0 * runs + 6.0 * 2.0 * np.sqrt(runs) + 20.0
    return line if beyond_chance and line.contrast > _CONTRAST else None


def remove_hum(campaign: Campaign, frequency: float, variance: float) -> tuple[Campaign, Hum]:
    """Take a hum and its harmonics out of every record.

    Args:
        campaign: the runs.
        frequency: of the fundamental, Hz.
        variance: of the noise of one sample, rad².

    Returns:
        The campaign without it, and what was taken out.
    """
    cleaned, squares, powers = [], [], []
    for run in campaign.runs:
        record, amplitude, power = _remove(run.record, frequency)
        cleaned.append(dataclasses.replace(run, record=record))
        squares.append(amplitude**2)
        powers.append(power)
    count = np.mean([run.record.yaw_rad.size for run in campaign.runs])
    noise = 4.0 * variance / count  # of a squared amplitude
    amplitude = float(np.sqrt(max(np.mean(squares) - noise, 0.0)))
    std = float(np.sqrt(2.0 * variance / (count * len(squares))))
    hum = Hum(frequency, amplitude, std, float(np.mean(powers)) / variance)
    return dataclasses.replace(campaign, runs=tuple(_typed(cleaned))), hum


def _typed(runs: list[Run]) -> list[Run]:
    return runs


def _remove(record: Record, frequency: float) -> tuple[Record, float, float]:
    """A record without the line and its harmonics, the fundamental's amplitude and the mean square removed."""
    time = record.time_s - record.time_s[0]
    columns = []
    for k in range(1, _HARMONICS + 1):
        if k * frequency < 0.48 * record.sample_rate:
            phase = 2.0 * np.pi * k * frequency * time
            columns += [np.sin(phase), np.cos(phase)]
    design = np.stack(columns, axis=1)
    # the slow motion leaks little into a line 40 times its frequency, and less once windowed
    window = np.hanning(time.size)[:, None]
    coefficients = np.linalg.lstsq(design * window, _detrended(record.yaw_rad) * window[:, 0], rcond=None)[0]
    wave: Array = design @ coefficients
    amplitude = float(np.hypot(coefficients[0], coefficients[1]))
    return Record(record.time_s, record.yaw_rad - wave), amplitude, float(np.mean(wave**2))


def _detrended(values: Array) -> Array:
    line = np.linspace(values[0], values[-1], values.size)
    result: Array = values - line
    return result
