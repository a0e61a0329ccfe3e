"""Motions of many runs at once, from the compiled integrator, and the sensor's readings of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from diagnosis.model.data import Data
from diagnosis.model.run_data import RunData
from tunnel_sim.effects import Effect, EffectChain
from tunnel_sim.effects.base import Drawn
from tunnel_sim.effects.chain import reads_plainly
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_run, integrate
from tunnel_sim.physics.input_moment import InputMoment, Lines
from tunnel_sim.physics.lagged_start import lagged_at_start
from tunnel_sim.physics.moment_law import run_dtype
from tunnel_sim.physics.rod_modes import Ringing, SlowMotion, separate_ringing
from tunnel_sim.physics.run_settings import (
    Motion,
    RunSettings,
    SettingsTable,
    column_places,
    released_by_spring_end,
)
from tunnel_sim.physics.steps import compensated, fit_stride, fit_substeps, input_substeps
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Rig

# motions in a part of the work, a multiple of the number that the integrator runs side by side
_TOGETHER = 16
_STEPS_OF_A_THREAD = 3e4  # minimum number of steps in a part: about a millisecond, several times its overhead
_SOFT_ROD = 2e-5  # rad/(N m): the ringing of a stiffer rod at the release is below the noise
#: Parameters of the law without effect in still air, and fields of a run that point to samples.
_AIR = (
    "air_density", "cn_beta", "cn_r", "moment_cubic", "damping_quadratic", "aero_lag", "flow_angle",
    "shedding_amplitude",
)  # fmt: skip
_Part = TypeVar("_Part")
_POINTERS = ("wind", "forcing", "program", "moment", "moment_time", "moment_slope")


@dataclass(frozen=True, eq=False)
class Asked:
    """Runs to be predicted; one run may occur several times with different parameters.

    Args:
        data: the campaign's data.
        runs: shape (n,), as for all fields below.
        stated: the physics of the runs without any effect.
        physics: the physics of the runs with the effects.
        effects: the effects that act in each run.
        drawn: the random part of each effect.
        zero: zero of the sensor, in the unit of the reading, shape (n,).
        resolve_rod_mode: as in `Problem`.
    """

    data: Data
    runs: Sequence[RunData]
    stated: SettingsTable
    physics: SettingsTable
    effects: Sequence[tuple[Effect, ...]]
    drawn: Sequence[tuple[Drawn, ...]]
    zero: Array
    resolve_rod_mode: bool

    def chain(self, place: int) -> EffectChain:
        """The effects of one of the runs."""
        return EffectChain(self.stated.row(place), self.effects[place], self.drawn[place])


@dataclass(frozen=True, eq=False)
class CompiledRuns:
    """Runs in the form that the compiled integrator takes.

    Args:
        law: shape (n, parameters), in the law's order.
        rows: rows of `run_dtype`, shape (n,).
        kept: arrays that the rows point to, apart from ``winds``, by run: first the samples of its wind, or the
            values and slopes of its input.
        winds: wind speeds that the rows point to, m/s, shape (n,).
        blocks: duration of each motion in block means, shape (n,).
        ringing: ringing of a rod, to be added, by run.
    """

    law: Array
    rows: NDArray[np.void]
    kept: Sequence[Sequence[Array]]
    winds: Array
    blocks: NDArray[np.int64]
    ringing: Sequence[Ringing | None]

    @classmethod
    def of(cls, asked: Asked, like: int | None = None) -> CompiledRuns:
        """The motions of some runs.

        Args:
            like: period after which the same runs follow at another point with the steps of the first point;
                None: each run has its own steps.
        """
        physics, runs, rig, count = (
            asked.physics.copy(),
            asked.runs,
            campaign_rig(asked.data),
            len(asked.runs),
        )
        inputs = {place: drive.exerted for place, drive in physics.inputs.items()}
        driven = np.isin(np.arange(count), list(inputs))
        slow = _separated(physics, asked, rig)
        rows, winds = np.zeros(count, run_dtype()), physics.wind_speed.copy()
        rows["angle"], rows["rate"] = physics["release_angle"], physics["release_rate"]
        rows["wind_count"] = 1.0
        rows["wind"] = winds.ctypes.data + winds.itemsize * np.arange(count)
        kept: list[Sequence[Array]] = [()] * count
        objects = zip(physics.rod_twist, physics.program, physics.drive, strict=True)
        for place, (series, given) in enumerate(zip(physics.series, objects, strict=True)):
            if series.keys() == {"wind_speed"} and not any(given):
                sampled = series["wind_speed"]
                speeds = np.array(sampled.values)
                kept[place], rows["wind"][place] = (speeds,), speeds.ctypes.data
                rows["wind_count"][place], rows["wind_interval"][place] = speeds.size, sampled.interval
            elif series or any(given):
                row, kept[place] = forward_run(physics.row(place))
                rows[place] = row[0]
        begins = np.array([run.start for run in runs])
        rows["lagged"] = lagged_at_start(physics, rig, begins)
        for place, one in slow.items():
            rows["lead"][place], rows["rod_stiffness"][place] = one.lead, one.rod_stiffness
            of_body = (1.0 + one.lead) * rows["lagged"][place]
            rows["lagged"][place] = one.body_release if begins[place] == 0.0 else of_body
        interval = np.array([run.interval for run in runs])
        size = np.array([run.reading.size for run in runs])
        length = np.array([run.duration for run in runs])
        blocks = size + np.ceil(np.maximum(0.0, physics["duration"] - length) / interval).astype(np.int64)
        substeps = fit_substeps(physics, interval)
        for place, drive in inputs.items():
            substeps[place] = input_substeps(int(substeps[place]), float(interval[place]), drive)
        # joins between steps would show in a derivative of the angle
        derived = np.array([run.derivative > 0 for run in runs])
        flexible = np.array([twist is not None for twist in physics.rod_twist])
        rough = (substeps > 1) | flexible | derived | driven
        stride = np.where(rough, 1, fit_stride(rig, physics, interval))
        if like is not None:
            points = count // like
            substeps, stride = np.tile(substeps[:like], points), np.tile(stride[:like], points)
            blocks = np.tile(blocks.reshape(points, like).max(axis=0), points)
        at, law, step = column_places(), physics.law.copy(), stride * interval / substeps
        law[:, at["frontal_area"]], law[:, at["width"]] = rig.body.frontal_area, rig.body.width
        law[:, at["reference_length"]] = rig.body.length
        speed = np.array([run.wind_speed for run in runs])
        better, longer = compensated(law, speed, step)
        # a longer step would shift the motion against its input
        law, step = np.where(driven[:, None], law, better), np.where(driven, step, longer)
        still = (physics.wind_speed == 0.0) & np.array([not series for series in physics.series])
        law[np.ix_(still, [at[name] for name in _AIR])] = 0.0
        rows["step"], rows["steps"], rows["stride"] = step / stride, substeps, stride
        for place, lines in _lines(inputs, step, blocks * substeps, count if like is None else like).items():
            row, parts = rows[place], (lines.values, lines.slopes, lines.time_s)
            for name, part in zip(("moment", "moment_slope", "moment_time"), parts, strict=True):
                row[name] = part.ctypes.data
            row["moment_count"], row["moment_interval"] = lines.values.size, lines.interval
            row["moment_delay"] = lines.delay
            kept[place] = (*parts, *kept[place])
        ringing = [slow[place].ringing if place in slow else None for place in range(count)]
        return cls(law, rows, kept, winds, blocks, ringing)

    def alike(self) -> list[list[int]]:
        """Indices of the runs grouped by equal motion: equal law, release and samples.

        Constant arrays are inputs; equal inputs are one object.
        """
        numbers = self.rows.copy()
        for name in _POINTERS:
            numbers[name] = 0
        parts = [self.law, self.winds[:, None], self.blocks[:, None]]
        parts = [np.ascontiguousarray(part).view(np.uint8) for part in parts]
        rows = np.concatenate([*parts, numbers.view(np.uint8).reshape(len(numbers), -1)], axis=1)
        found: dict[object, list[int]] = {}
        for place, (row, kept) in enumerate(zip(rows, self.kept, strict=True)):
            samples = (array.tobytes() if array.flags.writeable else id(array) for array in kept)
            found.setdefault((row.tobytes(), *samples), []).append(place)
        return list(found.values())

    def parts(self, places: Sequence[int], most: int) -> Iterator[list[int]]:
        """Motions in parts of at most a given number, each of equal steps and similar length."""
        equal: dict[tuple[float, float], list[int]] = {}
        for place in sorted(places, key=lambda place: int(self.blocks[place])):
            row = self.rows[place]
            equal.setdefault((float(row["steps"]), float(row["stride"])), []).append(place)
        for group in equal.values():
            for first in range(0, len(group), most):
                yield group[first : first + most]

    def integrated(self, places: Sequence[int]) -> tuple[Array, Array]:
        """Angle and rate at the block ends of runs of equal steps, without a rod's ringing.

        In rad and rad/s, shape (places, blocks of the longest + 1); infinite where a motion diverges.
        """
        samples = self.blocks[places] + 1
        angle, rate, status = integrate(self.law[places], self.rows[places], samples)
        first = 0
        while status:  # one motion diverged, and the later ones are not done
            angle[first + status - 1], rate[first + status - 1] = np.inf, np.inf
            first += status
            if first == len(places):
                break
            some = places[first:]
            rest, of_rest, status = integrate(self.law[some], self.rows[some], samples[first:])
            angle[first:, : rest.shape[1]], rate[first:, : rest.shape[1]] = rest, of_rest
        return angle, rate


def readings(asked: Asked) -> list[Array]:
    """Block means of the reading, by run, shape (blocks,) each; infinite where the motion diverges."""
    motions = CompiledRuns.of(asked)
    alike = {places[0]: places for places in motions.alike()}
    parts = [[alike[place] for place in part] for part in motions.parts(list(alike), _TOGETHER)]
    found: list[Array] = [np.zeros(0)] * len(asked.runs)

    def read(part: list[list[int]]) -> None:
        angle, rate = motions.integrated([places[0] for places in part])
        members = [(number, place) for number, places in enumerate(part) for place in places]
        values = read_together(asked, motions, members, angle, rate)
        for (_, place), one in zip(members, values, strict=True):
            found[place] = one

    side_by_side(read, parts, motions, asked.data)
    return found


def side_by_side(
    work: Callable[[_Part], None], parts: Sequence[_Part], motions: CompiledRuns, data: Data
) -> None:
    """Run some work on parts of a campaign's runs, in as many threads as the settings allow.

    Only the integrator runs in parallel. Short parts would wait for the interpreter, so one thread does them
    all.
    """
    threads = data.settings.work.threads
    steps = float(np.max(motions.blocks * motions.rows["steps"] / motions.rows["stride"], initial=0.0))
    apart = threads > 1 and len(parts) > 1 and steps * len(motions.blocks) / len(parts) > _STEPS_OF_A_THREAD
    list(_pool(threads).map(work, parts) if apart else map(work, parts))


@lru_cache(maxsize=4)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads)


def read_together(
    asked: Asked, motions: CompiledRuns, members: list[tuple[int, int]], angle: Array, rate: Array
) -> list[Array]:
    """Block means of the reading, from motions that were integrated together.

    Args:
        members: for each run, the index of its motion and its own index.
        angle: at the blocks' ends, rad, shape (motions, blocks of the longest + 1).
        rate: at the blocks' ends, rad/s, of the same shape.
    """
    places = [place for _, place in members]
    blocks = motions.blocks[places].tolist()
    if len(members) != len(angle):
        of = [number for number, _ in members]
        angle, rate = angle[of], rate[of]
    runs = [asked.runs[place] for place in places]
    for number, (place, run) in enumerate(zip(places, runs, strict=True)):
        ringing = motions.ringing[place]
        if ringing is not None:
            own = slice(blocks[number] + 1)
            slow = angle[number, own], rate[number, own]
            angle[number, own], rate[number, own] = ringing.added(*slow, run.interval)
    if reads_plainly(asked.effects[places[0]]):
        values = block_means(runs, angle, rate) + asked.zero[places, None]
        return [value[:count] for value, count in zip(values, blocks, strict=True)]
    found, chains = [], [asked.chain(place) for place in places]
    steady = [number for number, chain in enumerate(chains) if not chain.skips]
    of_steady = block_means([runs[i] for i in steady], angle[steady], rate[steady]) if steady else ()
    means = {number: mean[: blocks[number]] for number, mean in zip(steady, of_steady, strict=True)}
    for number, (chain, run) in enumerate(zip(chains, runs, strict=True)):
        zero = float(asked.zero[places[number]])
        if not np.isfinite(angle[number, 0]):  # the motion diverged
            found.append(np.full(run.reading.size, np.inf))
        elif chain.skips:
            ends = np.arange(blocks[number] + 1, dtype=np.float64) * run.interval
            motion = Motion(ends, angle[number, : ends.size], rate[number, : ends.size])
            found.append(sample_means(chain, motion, run, zero))
        else:
            found.append(chain.reading(chain.angle(means[number], run.times, run.derivative) + zero))
    return found


def _lines(inputs: Mapping[int, InputMoment], step: Array, steps: Array, like: int) -> dict[int, Lines]:
    """The inputs of driven runs as lines; a run and its counterparts start them at the same times.

    Args:
        inputs: by place, without actuators.
        step: step of every run, s, shape (n,).
        steps: number of steps, shape (n,).
        like: period after which the same runs follow.
    """
    apart = set()
    for place, drive in inputs.items():
        first = inputs[place % like]
        moved = drive.delay != first.delay or drive.time_s[0] != first.time_s[0]
        if moved or not drive.on_steps(float(step[place])):
            apart.add(place % like)
    return {
        place: drive.lines(float(step[place]), int(steps[place]), sampled=place % like not in apart)
        for place, drive in inputs.items()
    }


def end_weights(runs: Sequence[RunData], blocks: int) -> Array:
    """Weights with which the angles and rates at a block's ends enter its mean.

    For the first and last angle, and the first and last rate times the interval. Shape (runs, 4, 1), or (runs,
    4, blocks) where samples are not evenly spaced; 0 beyond the end of a run.

    Args:
        blocks: number of blocks of the longest run.
    """
    if all(run.samples is None for run in runs):
        return np.stack([run.weights for run in runs])[:, :, None]
    found = np.zeros((len(runs), 4, blocks))
    for place, run in zip(found, runs, strict=True):
        own = run.weights.reshape(4, -1)
        place[:, : blocks if own.shape[1] == 1 else own.shape[1]] = own
    return found


def block_means(runs: Sequence[RunData], angle: Array, rate: Array) -> Array:
    """Block means of the angle, or of the derivative that is read, from the block ends, shape (runs, blocks).

    Args:
        angle, rate: at the blocks' ends, rad and rad/s, shape (runs, blocks + 1). Values and means beyond the
            end of a run have no meaning.
    """
    weights = end_weights(runs, angle.shape[1] - 1)
    interval = np.array([run.interval for run in runs])[:, None]
    with np.errstate(invalid="ignore"):  # the motion diverged
        found: Array = (
            weights[:, 0] * angle[:, :-1]
            + weights[:, 1] * angle[:, 1:]
            + interval * (weights[:, 2] * rate[:, :-1] + weights[:, 3] * rate[:, 1:])
        )
    found[~np.isfinite(angle[:, 0])] = np.inf
    return found


def _separated(physics: SettingsTable, asked: Asked, rig: Rig) -> dict[int, SlowMotion]:
    """Replace runs with a flexible rod by their slow motion, or a stiff rod that would be resolved by a rigid one.

    Returns:
        What was separated from the runs, by place.
    """
    slow = {} if asked.resolve_rod_mode else separate_ringing(physics, rig)
    for place, twist in enumerate(physics.rod_twist):
        if twist is not None:
            run = physics.row(place)
            physics.put(place, released_by_spring_end(condensed(run, asked.data)))
    return slow


def blocks_beyond(physics: RunSettings, run: RunData) -> int:
    """Blocks by which a motion must extend beyond the record: 0 unless an effect reads it after the end."""
    return int(np.ceil(max(0.0, physics.duration - run.duration) / run.interval))


def sample_means(chain: EffectChain, motion: Motion, run: RunData, zero: float) -> Array:
    """Block means of the reading, rad, sample by sample.

    Args:
        motion: angle and rate at the blocks' ends.
        zero: zero of the sensor, rad.
    """
    reading = chain.reading(chain.sensed(motion, run.sample_times, run.derivative) + zero)
    return run.means(reading)


def condensed(physics: RunSettings, data: Data) -> RunSettings:
    """Replace a rod that is too stiff to ring visibly by its first-order effect on the slow motion.

    With compliance c, the body leads the sensor's end by φ = a θ, a = c (s Ka + (1 − s) Kr): the inertia at
    the sensor's end grows by the share (1 − s) a, and the air acts on (1 + a) θ. The neglected terms are of
    order (c Kr)².
    """
    twist = physics.rod_twist
    if twist is None or twist.compliance > _SOFT_ROD:
        return physics
    share = twist.inertia_share
    air = data.air_moment(physics) * physics.derivatives.cn_beta
    lead = twist.compliance * (share * air + (1.0 - share) * physics.spring_stiffness)
    rigid = physics.table.copy()
    rigid.rod_twist[0] = None
    for name in ("cn_beta", "cn_r"):
        rigid[name][0] *= 1.0 + lead
    rigid["yaw_inertia"][0] *= 1.0 + (1.0 - share) * lead
    return rigid.row(0)


def campaign_rig(data: Data) -> Rig:
    """A rig of the campaign's reference sizes."""
    return _rig(data.frontal_area, data.reference_length, data.width)


@lru_cache(maxsize=8)
def _rig(area: float, length: float, width: float) -> Rig:
    rig = load_rig()
    body = dataclasses.replace(rig.body, frontal_area=area, length=length, width=width)
    return dataclasses.replace(rig, body=body)
