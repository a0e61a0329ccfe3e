"""Changes of predicted readings to first order, from the derivatives that the compiled integrator carries.

The integrator gives the derivatives of a motion by the terms of its law. What a parameter does to these terms, and
to the reading of a motion, is cheap to compute: there a small step of the parameter serves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from diagnosis.likelihood.motions import Asked, Motions, end_weights, side_by_side
from tunnel_sim.effects.chain import reads_linearly, reads_plainly
from tunnel_sim.physics.slopes import slopes, terms
from tunnel_sim.vocabulary.record import Array

_TOGETHER = 8  # motions in a part of the work: those that the integrator takes side by side


def changes(asked: Asked, count: int) -> list[Array]:
    """Changes of block means from a first point to others near it, to first order in what changes the motion.

    Args:
        asked: the runs at the first point, and the same runs at each other point.
        count: number of runs.

    Returns:
        By run, in the unit of the reading, shape (points, blocks); NaN throughout at a point where the motion has
        no derivative, its rod twists, or the reading is not linear in the angle.
    """
    acting = {type(effect): effect for effects in asked.effects for effect in effects}.values()
    sampled = not reads_linearly(tuple(acting)) or any(effect.skips for effect in acting)
    if sampled or any(asked.physics.rod_twist):  # reading a motion takes longer than the motion
        points = len(asked.runs) // count - 1
        return [np.full((points, run.reading.size), np.nan) for run in asked.runs[:count]]
    motions = Motions.of(asked, like=count)
    points = len(asked.runs) // count - 1
    values = terms(motions.law, motions.rows).reshape(points + 1, count, -1)
    moved = np.swapaxes(values[1:] - values[0], 0, 1)
    equal: dict[tuple[float, ...], list[int]] = {}
    for place in range(count):
        equal.setdefault(motions.steps(place), []).append(place)
    parts = [
        group[first : first + _TOGETHER]
        for group in equal.values()
        for first in range(0, len(group), _TOGETHER)
    ]
    found = [np.zeros(0)] * count

    def follow(part: list[int]) -> None:
        for place, change in zip(part, _part(asked, motions, part, moved[part]), strict=True):
            found[place] = change

    side_by_side(follow, parts, asked.data)
    return found


def _part(asked: Asked, motions: Motions, part: list[int], moved: Array) -> Sequence[Array]:
    """The changes of runs that are integrated side by side, shape (points, blocks) each.

    Args:
        part: their places.
        moved: changes of their terms, shape (runs, points, terms).
    """
    count, points = len(asked.runs) // (moved.shape[1] + 1), moved.shape[1]
    columns = np.flatnonzero(moved.any(axis=(0, 1)))
    runs, blocks = [asked.runs[place] for place in part], int(motions.blocks[part[0]])
    effects = asked.effects[part[0]]
    weights = (
        end_weights(runs, blocks)
        * np.array([(1.0, 1.0, run.interval, run.interval) for run in runs])[:, :, None]
    )
    found = slopes(motions.law[part], motions.rows[part], blocks + 1, columns.tolist(), weights)
    if found.status:
        return [np.full((points, run.reading.size), np.nan) for run in runs]
    steps = moved[:, :, columns]
    unknown = np.isnan(found.by_angle[:, :, 0])
    lost = np.any((steps != 0.0) & unknown[:, None], axis=2)
    found.by_angle[unknown] = 0.0
    zeros = asked.zero.reshape(points + 1, count)[:, part]
    result = list(steps @ found.by_angle + (zeros[1:] - zeros[0]).T[:, :, None])
    if not reads_plainly(effects):
        for place, change in zip(part, result, strict=True):
            change += _beside(asked, place, count)
    for change, without in zip(result, lost, strict=True):
        change[without] = np.nan
    return result


def _beside(asked: Asked, place: int, count: int) -> Array:
    """The changes of what the sensor sees beside the angle, shape (points, blocks)."""
    run = asked.runs[place]
    still = np.zeros(run.reading.size)
    seen = [
        asked.chain(at).angle(still, run.times, run.derivative) for at in range(place, len(asked.runs), count)
    ]
    return np.stack(seen[1:]) - seen[0]
