"""Runs with the same statements that cannot have the same conditions."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from identification import policy
from identification.examination.self_excited import Swing
from identification.examination.slips.base import SlipEvidence, StatementSlip
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import speed_groups


@dataclass(frozen=True)
class EqualStatementsDiffer(StatementSlip):
    """Runs of equal spring, wind and swing differ in frequency or damping as never under one condition. Refused.

    This includes labels copied from run to run. The values on which the runs would agree are not known.
    """

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """Compare the runs that state the same, with equal amplitudes."""
        groups: dict[tuple[float | None, ...], list[Swing]] = defaultdict(list)
        setting = speed_groups(swing.run.wind_speed for swing in seen.swings)
        for swing in seen.swings:
            run = swing.run
            if run.spring_stiffness and swing.rate > 0.0:
                speed = setting[run.wind_speed]
                groups[run.spring_stiffness, speed, run.air_density if run.wind_on else None].append(swing)
        ids: list[str] = []
        largest = 0.0, 0.0
        for group in groups.values():
            low, high = min(group, key=lambda s: s.stiffness), max(group, key=lambda s: s.stiffness)
            stiffness, damping = _apart(low, high)
            if stiffness > np.log(policy.OTHER_SPRING) or (
                stiffness > np.log(policy.OTHER_WIND[0]) and damping > np.log(policy.OTHER_WIND[1])
            ):
                ids += [swing.run.id for swing in group]
                largest = max(largest, (stiffness, damping))
        if not ids:
            return ()
        what = (
            f"they state equal springs and winds, and differ by {100.0 * np.expm1(largest[0]):.2g} % or more in "
            f"omega_n^2 and {100.0 * np.expm1(largest[1]):.2g} % or more in damping"
        )
        remedy = "correct spring_stiffness or wind_speed of these runs, which may be copied from one another"
        return (Remark(Outcome.REFUSED, tuple(ids), what, remedy),)


def _apart(low: Swing, high: Swing) -> tuple[float, float]:
    """Least differences of stiffness and damping of two runs, in logarithms; 0 where their swings are unlike."""
    sizes = sorted((low.amplitude, high.amplitude))
    if low is high or sizes[0] < policy.EQUAL_SWINGS * sizes[1]:
        return 0.0, 0.0
    found = []
    for one, other, stds in (
        (
            high.stiffness,
            low.stiffness,
            (high.stiffness_std / high.stiffness, low.stiffness_std / low.stiffness),
        ),
        (high.rate, low.rate, (high.rate_std / high.rate, low.rate_std / low.rate)),
    ):
        found.append(max(abs(np.log(one / other)) - policy.REFUSAL_DEVIATIONS * float(np.hypot(*stds)), 0.0))
    return found[0], found[1]
