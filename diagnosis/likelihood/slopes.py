"""Changes of predicted readings to first order, from the derivatives that the compiled integrator carries.

The integrator gives the derivatives of a motion by the terms of its law. What a parameter does to these terms, and
to the reading of a motion, is cheap to compute: there a small step of the parameter serves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from diagnosis.likelihood.motions import Asked, Motions, block_means, end_weights, side_by_side
from tunnel_sim.effects.chain import reads_plainly
from tunnel_sim.physics.slopes import most_winds, slopes, terms
from tunnel_sim.physics.steps import meets_steps
from tunnel_sim.vocabulary.record import Array

#: The fields of a run that say which samples its input has.
_OF_SAMPLES = ("moment", "moment_time", "moment_count", "moment_delay", "moment_held", "moment_on_end")
_TOGETHER = 8  # motions in a part of the work: those that the integrator takes side by side


def changes(asked: Asked, count: int) -> list[Array]:
    """Changes of block means from a first point to others near it, to first order in what changes the motion.

    Args:
        asked: the runs at the first point, and the same runs at each other point.
        count: number of runs.

    Returns:
        By run, in the unit of the reading, shape (points, blocks); NaN throughout at a point where the motion has
        no derivative, its rod twists, the samples of an input are not at the starts of steps, or the motion is
        read at times of its own.
    """
    acting = {type(effect) for effects in asked.effects for effect in effects}
    inputs = zip(asked.runs[:count], asked.physics.drive, strict=False)
    between = any(drive is not None and not meets_steps(drive.exerted, run.interval) for run, drive in inputs)
    if between or any(effect.skips for effect in acting) or any(asked.physics.rod_twist):
        points = len(asked.runs) // count - 1
        return [np.full((points, run.reading.size), np.nan) for run in asked.runs[:count]]
    motions = Motions.of(asked, like=count)
    points = len(asked.runs) // count - 1
    values = terms(motions.law, motions.rows).reshape(points + 1, count, -1)
    moved = np.swapaxes(values[1:] - values[0], 0, 1)
    blown = [_winds(motions, place, count) for place in range(count)]
    redriven = [_has_other_input(motions.rows[place::count]) for place in range(count)]
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
        winds = [blown[place] for place in part]
        for place, change in zip(part, _part(asked, motions, part, moved[part], winds), strict=True):
            change[redriven[place]] = np.nan
            found[place] = change

    side_by_side(follow, parts, asked.data)
    return found


def _winds(motions: Motions, place: int, count: int) -> Array:
    """Changes of a run's wind of samples, m/s, shape (points, samples): none in a constant wind.

    NaN at a point where the wind has other samples than at the first.
    """
    rows, kept = motions.rows[place::count], motions.kept[place::count]
    first = np.array(kept[0][0] if rows["wind_count"][0] > 1.0 else motions.winds[place], ndmin=1)
    found = np.zeros((len(rows) - 1, first.size))
    for change, row, arrays in zip(found, rows[1:], kept[1:], strict=True):
        if (row["wind_count"], row["wind_interval"]) != (rows["wind_count"][0], rows["wind_interval"][0]):
            change[:] = np.nan
        elif first.size > 1:
            change[:] = arrays[0] - first
    return found


def _has_other_input(rows: NDArray[np.void]) -> NDArray[np.bool_]:
    """Whether a run's input has other samples than at the first point, shape (points,).

    Equal samples are one array, as `Motions.alike` has it.
    """
    of_samples = list(_OF_SAMPLES)
    return np.asarray(rows[of_samples][1:] != rows[of_samples][0], np.bool_)


def _part(
    asked: Asked, motions: Motions, part: list[int], moved: Array, blown: Sequence[Array]
) -> Sequence[Array]:
    """The changes of runs that are integrated side by side, shape (points, blocks) each.

    Args:
        part: their places.
        moved: changes of their terms, shape (runs, points, terms).
        blown: changes of their winds, by run, as of `_winds`.
    """
    count, points = len(asked.runs) // (moved.shape[1] + 1), moved.shape[1]
    columns = np.flatnonzero(moved.any(axis=(0, 1)))
    gusts = np.array([change.any(axis=1) for change in blown])  # a change that is NaN is one, too
    along = np.flatnonzero(gusts.any(axis=0))[: most_winds()]
    runs, blocks = [asked.runs[place] for place in part], int(motions.blocks[part[0]])
    effects = asked.effects[part[0]]
    weights = (
        end_weights(runs, blocks)
        * np.array([(1.0, 1.0, run.interval, run.interval) for run in runs])[:, :, None]
    )
    winds = [np.nan_to_num(change[along]) for change in blown]
    found = slopes(motions.law[part], motions.rows[part], blocks + 1, columns.tolist(), weights, winds)
    if found.status:
        return [np.full((points, run.reading.size), np.nan) for run in runs]
    changed = gusts[:, along, None] * (along[:, None] == np.arange(points))
    steps = np.concatenate([moved[:, :, columns], np.swapaxes(changed, 1, 2)], axis=2)
    unknown = np.isnan(found.by_angle[:, :, 0])
    lost = np.any((steps != 0.0) & unknown[:, None], axis=2)
    lost |= np.array([np.isnan(change).any(axis=1) for change in blown])
    lost |= gusts & ~np.isin(np.arange(points), along)
    found.by_angle[unknown] = 0.0
    result = list(steps @ found.by_angle)
    if reads_plainly(effects):
        zeros = asked.zero.reshape(points + 1, count)[:, part]
        for change, beside in zip(result, (zeros[1:] - zeros[0]).T, strict=True):
            change += beside[:, None]
    else:
        means = block_means(runs, found.angle, found.rate)
        result = [
            _read(asked, range(place, len(asked.runs), count), mean, change)
            for place, mean, change in zip(part, means, result, strict=True)
        ]
    for change, without in zip(result, lost, strict=True):
        change[without] = np.nan
    return result


def _read(asked: Asked, places: Sequence[int], mean: Array, moved: Array) -> Array:
    """The changes of a run's reading, shape (points, blocks).

    Args:
        places: of the run at the first point and at the others.
        mean: of the angle, by block, at the first point, rad, shape (blocks,).
        moved: changes of it, rad, shape (points, blocks).
    """
    run = asked.runs[places[0]]
    angles = np.concatenate([mean[None], mean + moved])
    chains = [asked.chain(place) for place in places]
    read = [
        chain.reading(chain.angle(angle, run.times, run.derivative) + zero)
        for chain, angle, zero in zip(chains, angles, asked.zero[list(places)].tolist(), strict=True)
    ]
    return np.stack(read[1:]) - read[0]
