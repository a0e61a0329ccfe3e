"""Whether the innovations of a random moment are those of steady noise: white, steady in time, without bursts."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from diagnosis.attribution.process_noise import ProcessNoise
from tunnel_sim.vocabulary.record import Array


def whiteness(result: ProcessNoise) -> tuple[float, float]:
    """How far innovations are from white and steady.

    Args:
        result: a fit of process noise.

    Returns:
        Largest departure of a frequency band's mean power from 1, in its standard deviations; and the same of a
        quarter of the record in time.
    """
    bands, quarters = [], []
    for innovations in result.innovations:
        power = np.abs(np.fft.rfft(innovations - innovations.mean())) ** 2 / innovations.size
        for part in np.array_split(power[1:], 8):
            bands.append((float(part.mean()) - 1.0) * np.sqrt(part.size))
        for part in np.array_split(innovations, 4):
            quarters.append((float(np.mean(part**2)) - 1.0) * np.sqrt(part.size / 2.0))
    return float(np.max(np.abs(bands))), float(np.max(np.abs(quarters)))


def bursts(result: ProcessNoise, false_alarm_rate: float) -> float:
    """The greatest power of innovations within a short time, divided by the greatest that chance explains.

    A blow is in few innovations, a gust in some more. Windows of 1, 2, 4, … innovations are moved over each run, up
    to a quarter of it.

    Args:
        result: a fit of process noise.
        false_alarm_rate: probability that a steady normal moment exceeds 1 in any window, at most, a fraction.

    Returns:
        A ratio.
    """
    lengths = [1 << k for k in range(20)]
    windows = [(i, n) for i in result.innovations for n in lengths if 4 * n <= i.size]
    rate = false_alarm_rate / max(sum(i.size - n + 1 for i, n in windows), 1)
    highest = [float(np.max(_moving_power(i, n))) / float(chi2.isf(rate, n)) for i, n in windows]
    return max(highest, default=0.0)


def _moving_power(innovations: Array, length: int) -> Array:
    total = np.concatenate(([0.0], np.cumsum(innovations**2)))
    return np.asarray(total[length:] - total[:-length])
