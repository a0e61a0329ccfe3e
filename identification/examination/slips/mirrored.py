"""Readings of inverted sign, detected by the zero they swing about and by the side of the release.

A mirrored decay is also a decay. Only asymmetries reveal it: the sensor's zero, which changes its sign in a
mirrored run, and the release angle, where it is stated.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from identification import policy
from identification.examination.self_excited import Swing
from identification.examination.slips.base import SlipEvidence, StatementSlip
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import speed_groups
from tunnel_sim.vocabulary.record import Array

_FEWEST = 3  # runs: of two different zeros, either may be right
_NEAR = 0.25  # of the zero's size: greatest scatter of the zeros with right signs, so that the two sides are apart


@dataclass(frozen=True)
class MirroredRun(StatementSlip):
    """Some runs swing about the zero of the others with its sign inverted. Refused: it looks like an effect."""

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """Compare the zeros of all runs with those of some signs inverted."""
        swings = seen.swings
        if len(swings) < _FEWEST or seen.stated.sensor.zero == "per_run":
            return ()
        zeros = np.array([swing.zero for swing in swings])
        std = np.array([max(swing.zero_std, 1e-300) for swing in swings])
        size = float(np.median(np.abs(zeros)))
        # the runs that differ; if half of all, those that begin on the less usual side
        minus = zeros < 0.0
        odd = minus if 2 * minus.sum() < zeros.size else ~minus
        if not odd.any() or odd.all():
            return ()
        upright = np.where(odd, -zeros, zeros)
        freedom, allowed = zeros.size - 1, np.hypot(std, policy.ZERO_STEADINESS * size)
        agree = _scatter(upright, allowed) <= float(chdtri(freedom, policy.MISFIT_RATE))
        differ = _scatter(zeros, allowed) > float(chdtri(freedom, policy.REFUSAL_RATE))
        if not (agree and differ) or float(np.ptp(np.abs(zeros))) > _NEAR * size:
            return ()
        halves = 2 * int(odd.sum()) == zeros.size
        if _of_wind(swings, odd):
            return ()
        names = tuple(s.run.id for s, one in zip(swings, odd, strict=True) if one)
        rest = tuple(s.run.id for s, one in zip(swings, odd, strict=True) if not one)
        ids = names + rest if halves else names
        who = "half of the runs (" + ", ".join(names) + ")" if halves else "the reading"
        what = (
            f"{who} {'swing' if halves else 'swings'} about {_signed(swings, odd)} {seen.campaign.sensor.unit} and "
            f"the others about {_signed(swings, ~odd)}: the sign of the sensor is inverted between them"
        )
        return (
            Remark(
                Outcome.REFUSED, ids, what, "invert the sign of these readings, or state zero = 'per_run'"
            ),
        )


def _scatter(values: Array, std: Array) -> float:
    weights = std**-2.0
    mean = float(weights @ values / weights.sum())
    return float(weights @ (values - mean) ** 2)


def _signed(swings: tuple[Swing, ...], which: NDArray[np.bool_]) -> str:
    return f"{median(s.zero for s, one in zip(swings, which, strict=True) if one):+.3g}"


def _of_wind(swings: tuple[Swing, ...], odd: NDArray[np.bool_]) -> bool:
    """Whether the wind may have moved the centre: only one group has wind, and its runs share one condition.

    A moment of the air moves the centre by a different angle with another spring or speed.
    """
    windy = np.array([swing.run.wind_on for swing in swings])
    setting = speed_groups(s.run.wind_speed for s in swings)
    conditions = {(s.run.spring_stiffness, setting[s.run.wind_speed]) for s in swings if s.run.wind_on}
    return len(conditions) == 1 and bool(np.all(odd == windy) or np.all(odd == ~windy))


@dataclass(frozen=True)
class ReleaseOnTheOtherSide(StatementSlip):
    """A stated release angle of the opposite sign to the record. Asked about: no answer depends on it."""

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """Compare sides where the record begins at its turning point, and the angle is stated."""
        if seen.campaign.sensor.derivative:
            return ()
        ids = []
        for swing in seen.swings:
            stated, first = swing.run.release_angle or 0.0, float(swing.motion[0])
            turning = abs(first) > policy.CLEAR_RELEASE * swing.amplitude
            decays = swing.rate > policy.MISFIT_DEVIATIONS * swing.rate_std
            low, high = policy.RELEASE_AS_STATED
            if turning and decays and -high < first / (stated or np.inf) < -low:
                ids.append(swing.run.id)
        if not ids:
            return ()
        what = "the record begins on the other side than the stated release_angle"
        remedy = "correct the sign of release_angle, or of the readings"
        return (Remark(Outcome.NOTED, tuple(ids), what, remedy),)
