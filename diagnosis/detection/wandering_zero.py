"""A zero that wanders like a random walk, as opposed to coloured noise.

Both make a spectrum that rises towards low frequencies. That of noise is level below some corner; that of a random
walk is not, because its zero goes ever further away.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize
from scipy.special import chdtri

from diagnosis.detection.noise_colour import HANN, Colour, between_harmonics
from diagnosis.fitting.least_squares import Fit
from diagnosis.policy import COLOUR_FALSE_ALARM_RATE
from tunnel_sim.vocabulary.record import Array

_LOWEST_CORNER = 1e-3  # of the colour's lowest frequency: as good as none
_CORNERS = (1.0, 4.0, 16.0)  # of the colour's lowest frequency, to start from
_WHITE = 30.0  # the level's natural logarithm stays within this of that of white noise


def zero_wanders(nominal: Fit, colour: Colour) -> bool:
    """Whether the noise's spectrum rises to the lowest frequencies of the runs without a corner.

    Args:
        nominal: the fit whose residuals have the colour, scaled as white.
        colour: of its noise; its lowest band is the lowest corner of stationary noise that counts as seen.

    Returns:
        The verdict of a likelihood ratio at `COLOUR_FALSE_ALARM_RATE`. The spectrum is that of white noise and a
        first-order process, which is a random walk where its corner is zero. It is fitted to the ordinates between
        the harmonics by Whittle's likelihood (P. Whittle, Ark. Mat. 2 (1953) 423, doi 10.1007/BF02590998).
    """
    spectra = [between_harmonics(nominal, index) for index in range(len(nominal.residuals))]
    frequency, power = (np.concatenate(column) for column in zip(*spectra, strict=True))
    relative = frequency / colour.frequency[0]
    seen = _least_loss(relative, power, 1.0)
    free = min(seen, _least_loss(relative, power, _LOWEST_CORNER))
    return bool(2.0 * (seen - free) / HANN > chdtri(1, 2.0 * COLOUR_FALSE_ALARM_RATE))


def _least_loss(frequency: Array, power: Array, lowest: float) -> float:
    """Least negative log-likelihood, nats, with the corner at or above a frequency.

    Args:
        frequency: over the colour's lowest, shape (n,).
        power: in units of white noise, shape (n,).
        lowest: corner, in the same unit.
    """

    def loss(place: Array) -> tuple[float, Array]:
        white, slow, corner = np.exp(place)
        response = 1.0 / (frequency**2 + corner**2)
        level = white + slow * response
        by_level = (1.0 - power / level) / level
        slopes = white, slow * response, -2.0 * slow * (corner * response) ** 2
        total = float(np.sum(np.log(level) + power / level))
        return total, np.array([float(np.sum(by_level * slope)) for slope in slopes])

    bounds = [(-_WHITE, _WHITE), (-_WHITE, _WHITE), (np.log(lowest), _WHITE)]
    starts = [np.array([0.0, np.log(power.max() * c**2 + 1.0), np.log(c)]) for c in (lowest, *_CORNERS)]
    return min(float(minimize(loss, start, jac=True, bounds=bounds).fun) for start in starts)
