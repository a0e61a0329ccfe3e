"""Whether a random moment is steady noise: white innovations, steady in time, without bursts, alike in all runs."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from diagnosis.attribution.process_noise import ProcessNoise
from diagnosis.policy import BURST, BURST_FALSE_ALARM_RATE, ONE_RUN_FALSE_ALARM_RATE, WHITE_INNOVATIONS
from tunnel_sim.vocabulary.record import Array


def is_steady_noise(result: ProcessNoise) -> bool:
    """Whether a random moment passes all tests.

    Args:
        result: a fit of process noise.

    Returns:
        False where its innovations are not white and steady, come in bursts, or are those of one run.
    """
    return (
        departure_from_white(result) <= WHITE_INNOVATIONS
        and bursts(result, BURST_FALSE_ALARM_RATE) <= BURST
        and of_all_runs(result) >= ONE_RUN_FALSE_ALARM_RATE
    )


def departure_from_white(result: ProcessNoise) -> float:
    """How far innovations are from white and steady.

    Args:
        result: a fit of process noise.

    Returns:
        Largest departure from 1 of the mean power in a frequency band, or in a quarter of the record in time, in
        its standard deviations.
    """
    departures = []
    for innovations in result.innovations:
        power = np.abs(np.fft.rfft(innovations - innovations.mean())) ** 2 / innovations.size
        for part in np.array_split(power[1:], 8):
            departures.append((float(part.mean()) - 1.0) * np.sqrt(part.size))
        for part in np.array_split(innovations, 4):
            departures.append((float(np.mean(part**2)) - 1.0) * np.sqrt(part.size / 2.0))
    return float(np.max(np.abs(departures)))


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
    highest = [float(np.max(_moving_power(i, n))) / float(chdtri(n, rate)) for i, n in windows]
    return max(highest, default=0.0)


def _moving_power(innovations: Array, length: int) -> Array:
    total = np.concatenate(([0.0], np.cumsum(innovations**2)))
    return np.asarray(total[length:] - total[:-length])


def of_all_runs(result: ProcessNoise) -> float:
    """Probability that a random moment that acts in all runs shows in one of them as much as this one does.

    A gust in one run is not turbulence. The power of the response to the narrowest random moment, which has two
    quadratures, is an exponential variable, and that of a broader one varies less. Fisher's test of the greatest of
    n such variables: Proc. R. Soc. A 125 (1929) 54, doi 10.1098/rspa.1929.0151.

    Args:
        result: a fit of process noise.

    Returns:
        The first term of Fisher's series, which is at least the probability; a fraction.
    """
    total = float(result.by_run.sum())
    share = float(result.by_run.max()) / total if total > 0.0 else 0.0
    return min(1.0, result.by_run.size * (1.0 - share) ** (result.by_run.size - 1))
