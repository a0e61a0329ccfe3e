"""Changes of predicted readings to first order, from the derivatives that the compiled integrator carries.

The integrator gives the derivatives of a motion by the terms of its law. How a parameter changes these terms,
and the reading of a motion, is cheap to compute by a small step of the parameter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from diagnosis.likelihood.motions import Asked, CompiledRuns, block_means, end_weights, side_by_side
from diagnosis.model.run_data import RunData
from tunnel_sim.effects.capabilities import Clock
from tunnel_sim.effects.chain import reads_plainly
from tunnel_sim.physics.rod_modes import Ringing
from tunnel_sim.physics.slopes import most_changes, slopes, terms
from tunnel_sim.vocabulary.record import Array

#: The fields of a run that state the times of its samples.
_OF_TIMES = (
    "wind_count",
    "wind_interval",
    "moment_count",
    "moment_interval",
    "moment_delay",
    "moment_on_end",
)
_TOGETHER = 8  # motions in a part of the work: as many as the integrator runs side by side


def changes(asked: Asked, count: int) -> list[Array]:
    """Changes of block means from a first point to others near it, to first order in the changes of the motion.

    Args:
        asked: the runs at the first point, and the same runs at each other point.
        count: number of runs.

    Returns:
        By run, in the unit of the reading, shape (points, blocks). NaN throughout at a point where the motion
        has no derivative, the ringing of its rod is resolved, or it is read at times of its own.
    """
    points = len(asked.runs) // count - 1
    unknown = [np.full((points, run.reading.size), np.nan) for run in asked.runs[:count]]
    kinds = {type(effect) for effects in asked.effects for effect in effects}
    skip = any(issubclass(kind, Clock) for kind in kinds)
    if skip or any(asked.physics.program[:count]):  # a moment stated by an expression has no derivative
        return unknown
    motions = CompiledRuns.of(asked, like=count)
    if motions.rows["twist_stiffness"].any():
        return unknown
    values = terms(motions.law, motions.rows).reshape(points + 1, count, -1)
    moved = np.swapaxes(values[1:] - values[0], 0, 1)
    sampled = [_samples(motions, place, count) for place in range(count)]
    parts = list(motions.parts(range(count), _TOGETHER))
    found = [np.zeros(0)] * count

    def follow(part: list[int]) -> None:
        of_part = [sampled[place] for place in part]
        for place, change in zip(part, _part(asked, motions, part, moved[part], of_part), strict=True):
            found[place] = change

    side_by_side(follow, parts, motions, asked.data)
    return found


def _samples(motions: CompiledRuns, place: int, count: int) -> Array:
    """Changes of the samples of a run's wind or drive, as in `slopes`, shape (points, samples); maybe none.

    NaN at a point where the sample times differ from the first point's.
    """
    rows, kept = motions.rows[place::count], motions.kept[place::count]
    of_wind, of_drive = rows["wind_count"][0] > 1.0, rows["moment_count"][0] > 0.0
    arrays = 1 if of_wind else 2 if of_drive else 0  # for a drive, the values and their slopes
    size = sum(array.size for array in kept[0][:arrays])
    found = np.zeros((len(rows) - 1, max(size, 1)))
    retimed = np.any([rows[name][1:] != rows[name][0] for name in _OF_TIMES], axis=0)
    for change, there, apart in zip(found, kept[1:], retimed.tolist(), strict=True):
        if apart:  # in another number of samples, too
            change[:] = np.nan
        elif any(one is not other for one, other in zip(kept[0][:arrays], there[:arrays], strict=True)):
            change[:] = np.concatenate(there[:arrays]) - np.concatenate(kept[0][:arrays])
    return found


def _part(
    asked: Asked, motions: CompiledRuns, part: list[int], moved: Array, sampled: Sequence[Array]
) -> Sequence[Array]:
    """The changes of runs that are integrated side by side, shape (points, blocks) each.

    Args:
        part: places of the runs.
        moved: changes of the runs' terms, shape (runs, points, terms).
        sampled: changes of the runs' samples, by run, as `_samples` returns them.
    """
    count, points = len(asked.runs) // (moved.shape[1] + 1), moved.shape[1]
    columns = np.flatnonzero(moved.any(axis=(0, 1)))
    resampled = np.array([change.any(axis=1) for change in sampled])  # a change to NaN is a change, too
    along = np.flatnonzero(resampled.any(axis=0))[: most_changes()]
    runs, blocks = [asked.runs[place] for place in part], motions.blocks[part]
    effects = asked.effects[part[0]]
    weights = (
        end_weights(runs, int(np.max(blocks)))
        * np.array([(1.0, 1.0, run.interval, run.interval) for run in runs])[:, :, None]
    )
    changed = [np.nan_to_num(change[along]) for change in sampled]
    found = slopes(motions.law[part], motions.rows[part], blocks + 1, columns.tolist(), weights, changed)
    if found.status:
        return [np.full((points, run.reading.size), np.nan) for run in runs]
    whole = resampled[:, along, None] * (along[:, None] == np.arange(points))
    steps = np.concatenate([moved[:, :, columns], np.swapaxes(whole, 1, 2)], axis=2)
    unknown = np.isnan(found.by_angle[:, :, 0])
    lost = np.any((steps != 0.0) & unknown[:, None], axis=2)
    lost |= np.array([np.isnan(change).any(axis=1) for change in sampled])
    lost |= resampled & ~np.isin(np.arange(points), along)
    found.by_angle[unknown] = 0.0
    result = [change[:, :size] for change, size in zip(steps @ found.by_angle, blocks, strict=True)]
    ringing = {}
    for number, (place, run) in enumerate(zip(part, runs, strict=True)):
        if any(motions.ringing[place::count]):
            ringing[number] = _ringing(motions.ringing[place::count], run, int(blocks[number]))
            result[number] += ringing[number][1:] - ringing[number][0]
    if reads_plainly(effects):
        zeros = asked.zero.reshape(points + 1, count)[:, part]
        for change, beside in zip(result, (zeros[1:] - zeros[0]).T, strict=True):
            change += beside[:, None]
    else:
        means = block_means(runs, found.angle, found.rate)
        for number, added in ringing.items():
            means[number, : added.shape[1]] += added[0]
        result = [
            _read(asked, range(place, len(asked.runs), count), mean[: change.shape[1]], change)
            for place, mean, change in zip(part, means, result, strict=True)
        ]
    for change, without in zip(result, lost, strict=True):
        change[without] = np.nan
    return result


def _ringing(ringing: Sequence[Ringing | None], run: RunData, blocks: int) -> Array:
    """Block means of the rod's part of the reading of a run at each point, rad, shape (points, blocks)."""
    none = np.zeros(blocks + 1)
    added = [(none, none) if one is None else one.added(none, none, run.interval) for one in ringing]
    return block_means([run] * len(added), np.stack([a for a, _ in added]), np.stack([r for _, r in added]))


def _read(asked: Asked, places: Sequence[int], mean: Array, moved: Array) -> Array:
    """The changes of a run's reading, shape (points, blocks).

    Args:
        places: indices of the run at the first point and at the others.
        mean: mean angle by block at the first point, rad, shape (blocks,).
        moved: changes of the mean, rad, shape (points, blocks).
    """
    run = asked.runs[places[0]]
    angles = np.concatenate([mean[None], mean + moved])
    chains = [asked.chain(place) for place in places]
    read = [
        chain.reading(chain.angle(angle, run.times, run.derivative) + zero)
        for chain, angle, zero in zip(chains, angles, asked.zero[list(places)].tolist(), strict=True)
    ]
    return np.stack(read[1:]) - read[0]
