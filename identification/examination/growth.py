"""Motion that grows with the wind off. A passive rig cannot do that, so the record or its labels are wrong."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.examination.swings import Swing
from identification.policy import REFUSAL_DEVIATIONS
from identification.remark import Outcome, Remark
from tunnel_sim.vocabulary.record import Array


def growing_runs(swings: Sequence[Swing]) -> tuple[Remark, ...]:
    """Refuse wind-off runs whose oscillation grows.

    Returns:
        One remark for all such runs, if any. A run grows if its decay rate is negative beyond chance and its swings
        become larger with time; a blow in mid-record does not look like that.
    """
    ids = tuple(s.run.id for s in swings if not s.run.wind_on and _grows(s))
    if not ids:
        return ()
    return (
        Remark(
            Outcome.REFUSED,
            ids,
            "the motion grows with the wind off, which is impossible on a passive rig",
            "check whether time runs backwards in the file, state the wind speed, or remove the run",
        ),
    )


def _grows(swing: Swing) -> bool:
    if swing.rate + REFUSAL_DEVIATIONS * swing.rate_std >= 0.0:
        return False
    quarters = [_power(part) for part in np.array_split(swing.motion, 4)]
    return quarters[3] > quarters[2] > max(quarters[0], quarters[1])


def _power(part: Array) -> float:
    return float(part @ part) / max(part.size, 1)
