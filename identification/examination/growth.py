"""Motion that grows with the wind off: a passive rig cannot, so the record is not what it is said to be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.examination.swings import Swing
from identification.policy import REFUSAL_DEVIATIONS
from identification.remark import Outcome, Remark
from tunnel_sim.vocabulary.record import Array


def growing_runs(swings: Sequence[Swing]) -> tuple[Remark, ...]:
    """Refuse wind-off runs whose oscillation grows.

    Args:
        swings: of the runs.

    Returns:
        One remark for all such runs; none where there is none. A run grows where its decay rate is negative
        beyond chance and its swings are the larger the later. A blow in mid-record does not look like that.
    """
    ids = tuple(s.run.id for s in swings if not s.run.wind_on and _grows(s))
    if not ids:
        return ()
    return (
        Remark(
            Outcome.REFUSED,
            ids,
            "the motion grows with the wind off, which a passive rig cannot",
            "check whether time runs backwards in the file, or state the wind's speed, or leave the run out",
        ),
    )


def _grows(swing: Swing) -> bool:
    if swing.rate + REFUSAL_DEVIATIONS * swing.rate_std >= 0.0:
        return False
    quarters = [_power(part) for part in np.array_split(swing.motion, 4)]
    return quarters[3] > quarters[2] > max(quarters[0], quarters[1])


def _power(part: Array) -> float:
    return float(part @ part) / max(part.size, 1)
