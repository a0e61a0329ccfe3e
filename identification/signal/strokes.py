"""The energy that a motion loses between successive reversals.

At a reversal the body is at rest, and all its energy is potential. Between two reversals friction and damping
dissipate the work of the input less the gain in potential energy, whatever their laws; for free decays see
Feeny & Liang, J. Sound Vib. 195 (1996) 149, doi 10.1006/jsvi.1996.0411.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.vocabulary.quantities import Angles
from tunnel_sim.vocabulary.record import Array, running_integral

_WINDOW = 0.12  # share of the time between reversals, on both sides of one: the motion is a parabola there
_FEWEST = 2  # minimum number of samples on either side


@dataclass(frozen=True, eq=False)
class Strokes:
    """A motion from reversal to reversal, n strokes.

    Args:
        turns: indices of the reversals among the samples, shape (n + 1,).
        angle: at the reversals, rad, shape (n + 1,).
        lost: energy dissipated by friction and damping, J, shape (n,).
        spread: standard deviation of these angles over a white-noise sample's, a ratio, shape (n + 1,).
    """

    turns: NDArray[np.int64]
    angle: Array
    lost: Array
    spread: Array

    @property
    def travel(self) -> Array:
        """Angle passed in every stroke, rad, shape (n,)."""
        return np.abs(np.diff(self.angle))


def reversals(angle: Angles, least: float) -> NDArray[np.int64]:
    """Indices of the extremes between which a motion travels far enough, shape (k,).

    The ends of the record do not count: the body need not be at rest there.

    Args:
        least: minimum travel of a stroke, rad.
    """
    places, low, high, upward = [], 0, 0, 0
    for place, value in enumerate(angle.tolist()):
        if value > angle[high]:
            high = place
        if value < angle[low]:
            low = place
        if upward >= 0 and angle[high] - value >= least:  # it has reversed at a maximum
            places.append(high)
            upward, low = -1, place
        elif upward <= 0 and value - angle[low] >= least:
            places.append(low)
            upward, high = 1, place
    if places and (places[0] == 0):
        places = places[1:]
    return np.array(places, dtype=np.int64)


def strokes(
    angle: Array, turns: NDArray[np.int64], stiffness: float, moment: Array | None = None, centre: float = 0.0
) -> Strokes:
    """The energy balance of every stroke.

    Args:
        angle: angle at even times, rad, shape (n,).
        turns: reversals of this motion or of a nearly equal one, from `reversals`, shape (k,).
        stiffness: of the restoring moment, N m/rad.
        moment: moment of the input on the body at those times, N m, shape (n,); None: a free decay.
        centre: the angle at which the restoring moment is zero, rad.

    Returns:
        The strokes; the angles of the reversals are the extremes of parabolas through the samples around them.
    """
    gaps = np.diff(turns)
    found = [
        _extreme(angle, place, int(gaps[max(number - 1, 0) : number + 1].min(initial=angle.size)))
        for number, place in enumerate(turns.tolist())
    ]
    extreme, spread = np.array(found).reshape(-1, 2).T
    stored = 0.5 * stiffness * (extreme - centre) ** 2
    lost = -np.diff(stored)
    if moment is not None:
        path = angle.copy()
        path[turns] = extreme
        work = running_integral(moment, path)
        lost = lost + np.diff(work[turns])
    return Strokes(turns, extreme, lost, spread)


def _extreme(angle: Array, place: int, gap: int) -> tuple[float, float]:
    """The extreme of a parabola through the samples around a reversal, rad, and its std over the noise's."""
    reach = max(_FEWEST, round(_WINDOW * gap))
    first, last = max(place - reach, 0), min(place + reach + 1, angle.size)
    powers = np.vander(np.arange(first - place, last - place, dtype=np.float64), 3)
    inverse = np.linalg.pinv(powers)
    square, slope, value = inverse @ angle[first:last]
    top = 0.0
    if square != 0.0:
        top = float(np.clip(-0.5 * slope / square, first - place, last - 1 - place))
    at = np.array([top**2, top, 1.0])
    return float(at @ [square, slope, value]), float(np.linalg.norm(at @ inverse))
