"""Wind that is stated but not detected, and labels of wind and no wind exchanged throughout."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from identification import policy
from identification.examination.self_excited import Swing
from identification.examination.slips.base import SlipEvidence, StatementSlip
from identification.examination.slips.fits import Statements, agreement
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import speed_groups


@dataclass(frozen=True, eq=False)
class _Change:
    """Changes by the wind in a run, relative to the wind-off runs of its spring."""

    swing: Swing
    stiffness: float
    stiffness_std: float
    damping: float
    damping_std: float


def _changes(swings: tuple[Swing, ...]) -> list[_Change]:
    changes = []
    for swing in swings:
        same = [
            s for s in swings if not s.run.wind_on and s.run.spring_stiffness == swing.run.spring_stiffness
        ]
        if not swing.run.wind_on or not same:
            continue
        k, a = np.mean([s.stiffness for s in same]), np.mean([s.rate for s in same])
        k_std, a_std = (
            np.linalg.norm(v) / len(same)
            for v in ([s.stiffness_std for s in same], [s.rate_std for s in same])
        )
        if not a > 0.0:
            continue
        changes.append(
            _Change(
                swing,
                stiffness=float(swing.stiffness / k - 1.0),
                stiffness_std=float(np.hypot(swing.stiffness_std, k_std) / k),
                damping=float(swing.rate / a - 1.0),
                damping_std=float(np.hypot(swing.rate_std, a_std) / a),
            )
        )
    return changes


@dataclass(frozen=True)
class WindNotSeen(StatementSlip):
    """No wind-on run differs from the wind-off runs of its spring, though records would show it. Asked about."""

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """Compare frequency and decay rate with the wind on and off."""
        changes = _changes(seen.swings)
        if not changes:
            return ()
        for change in changes:
            damping_std = float(np.hypot(change.damping_std, policy.SCATTER_OF_DAMPING))
            if abs(change.stiffness) + policy.MISFIT_DEVIATIONS * change.stiffness_std > policy.LEAST_OF_WIND:
                return ()
            if abs(change.damping) > policy.MISFIT_DEVIATIONS * damping_std:
                return ()
            if policy.MISFIT_DEVIATIONS * damping_std > policy.LEAST_DAMPING_OF_WIND:
                return ()
        largest = (
            max(abs(change.stiffness) for change in changes),
            max(abs(change.damping) for change in changes),
        )
        what = (
            f"with the wind on, frequency and damping equal those with the wind off within {50.0 * largest[0]:.2g} "
            f"% and {100.0 * largest[1]:.2g} %: no body has so small an aerodynamic moment"
        )
        ids = tuple(change.swing.run.id for change in changes)
        return (Remark(Outcome.NOTED, ids, what, "check whether the fan was on, and wind_speed"),)


@dataclass(frozen=True)
class WindExchanged(StatementSlip):
    """All labels of wind on and off are exchanged: the wind seems to reduce the damping, and the springs disagree.

    Refused where the springs agree after an exchange: either sign alone may be an effect.
    """

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """Exchange wind on and off in all runs, where there is one speed."""
        swings = tuple(s for s in seen.swings if s.run.spring_stiffness)
        speeds = set(speed_groups(s.run.wind_speed for s in swings if s.run.wind_on).values())
        changes = _changes(swings)
        if len(speeds) != 1 or len({c.swing.run.spring_stiffness for c in changes}) == 1:
            return ()
        less = [-c.damping / float(np.hypot(c.damping_std, policy.SCATTER_OF_DAMPING)) for c in changes]
        if min(less, default=0.0) < policy.REFUSAL_DEVIATIONS:
            return ()
        labels = Statements.of(swings)
        tight = {"departure": policy.SPRING_TOLERANCE, "of_speed": policy.SPRING_TOLERANCE}
        stated = agreement(labels, **tight)
        exchanged = agreement(replace(labels, speed=speeds.pop() - labels.speed), **tight)
        gain = stated.squares - exchanged.squares
        if gain <= float(chdtri(1, policy.MISFIT_RATE)) or not exchanged.good:
            return ()
        what = (
            "as stated the wind reduces the damping and the springs disagree; they agree if the wind speeds of "
            "the runs with the wind on and off are exchanged"
        )
        ids = tuple(swing.run.id for swing in swings)
        return (Remark(Outcome.REFUSED, ids, what, "correct wind_speed or the file names of these runs"),)
