"""The model of a campaign as a function of parameters: nominal, or with effects added."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from diagnosis.likelihood.run_data import Data, RunData
from tunnel_sim.effects import Effect, EffectChain
from tunnel_sim.effects.parameters import SWING
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_run, integrate, slow_motion
from tunnel_sim.physics.run_settings import Motion, RunSettings, released_by_spring_end
from tunnel_sim.physics.steps import compensated, fit_stride, fit_substeps
from tunnel_sim.vocabulary.plan import AeroDerivatives
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Rig

_THREADS = 2
_TOGETHER = 4  # motions that the integrator takes side by side
_SOFT_ROD = 2e-5  # rad/(N m): the ringing of a stiffer rod at the release is below the noise
_POOL = ThreadPoolExecutor(_THREADS)
#: Parameters of the law that do nothing without wind, and fields of a run that point to samples.
_AIR = (
    "air_density", "cn_beta", "cn_r", "moment_cubic", "damping_quadratic", "aero_lag", "flow_angle",
    "shedding_amplitude",
)  # fmt: skip
_POINTERS = ("wind", "forcing", "program", "moment", "moment_time")


@dataclass(frozen=True)
class Point:
    """A value of every parameter of a problem.

    Args:
        common: parameters common to the runs, in the order of `Problem.names`, shape (common,).
        release: of every run its own parameters, shape (runs, own): angle (rad) and rate (rad/s) of the sensor's
            end at the record's start, the sensor's zero (rad) where each run has its own, then in the effects'
            order the phase (rad) of each periodic one and the instants (shares of the run's length) of the one
            that skips samples.
    """

    common: Array
    release: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """What is fitted: prepared runs, and the effects added to the nominal model.

    Args:
        effects: effect classes whose parameters are free.
        fixed: value of effect parameters that are held, as ``effect.parameter``.
        free_forms: names of the effects whose form parameters are free; the others keep the textbook form.
        rod_followed: whether a flexible rod is integrated with its ringing; else the ringing is added to the slow
            motion, which is much faster and exact as far as the rig is linear.
    """

    data: Data
    effects: tuple[type[Effect], ...] = ()
    fixed: tuple[tuple[str, float], ...] = ()
    free_forms: tuple[str, ...] = ()
    rod_followed: bool = False

    @cached_property
    def nominal_names(self) -> tuple[str, ...]:
        """Names of the nominal model's common parameters."""
        first = "stiffness" if self.data.normalised else "yaw_inertia"
        spring = () if self.data.law is None else ("added_stiffness",)
        air = ("cn_beta", "cn_r") if self.data.wind_on else ()
        gain = ("drive_gain",) if self.data.gain_free else ()
        zero = () if self.data.own_zeros else ("moment_offset",) if self.data.unrestrained else ("zero",)
        names = (first, "mechanical_damping", *spring, *air, *gain, *zero)
        return tuple(name for name in names if name not in self._held)

    @cached_property
    def _held(self) -> Mapping[str, float]:
        return {} if self.data.law is None else self.data.law.held

    @property
    def first_phase(self) -> int:
        """Place of the first phase or instant among a run's own parameters."""
        return 3 if self.data.own_zeros else 2

    def zero(self, common: Array, own: Array) -> float:
        """The sensor's zero in one run, in the unit of the reading.

        Args:
            common: as in `Point`, shape (common,).
            own: of the run, a row of ``Point.release``, shape (own,).
        """
        if self.data.own_zeros:
            return float(own[2])
        if self.data.unrestrained:  # it cannot be separated from the initial angle
            return 0.0
        return self._held["zero"] if "zero" in self._held else float(common[self.nominal_names.index("zero")])

    @cached_property
    def effect_names(self) -> tuple[str, ...]:
        """Names of the free effect parameters, as ``effect.parameter``."""
        # in small swings the rest angle of a body that nothing else holds acts as a constant moment does
        law = self.data.law
        hangs = law is not None and law.hangs and "zero" not in self._held
        loose = self.data.normalised or hangs or (self.data.unrestrained and self.data.swing < SWING)
        names = [
            f"{kind.name}.{info.name}"
            for kind in self.effects
            for info in kind.parameters()
            if not info.of_input
            and (not info.form or kind.name in self.free_forms)
            and not (info.beside_spring and loose)
        ]
        held = dict(self.fixed)
        return tuple(name for name in names if name not in held)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All common parameters, the nominal ones first."""
        return self.nominal_names + self.effect_names

    @cached_property
    def phased(self) -> tuple[str, ...]:
        """Names of the effects that have a phase or instants of their own in every run."""
        return tuple(kind.name for kind in self.effects if kind.line or kind.skips)

    def own_places(self, width: int) -> dict[str, slice]:
        """Where the phase or the instants of each effect are among a run's own parameters, by the effects' names.

        ``width`` is the number of a run's own parameters, which gives the number of instants.
        """
        places, first = {}, self.first_phase
        instants = width - first - len(self.phased) + 1
        for kind in self.effects:
            if kind.name in self.phased:
                places[kind.name] = slice(first, first + (instants if kind.skips else 1))
                first = places[kind.name].stop
        return places

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest values of the common parameters."""
        low = {"yaw_inertia": 1e-9, "stiffness": 0.0, "mechanical_damping": 0.0}
        infos = {f"{kind.name}.{info.name}": info for kind in self.effects for info in kind.parameters()}
        ranges = {name: info.fit_range(self.data.swing) for name, info in infos.items()}
        found = np.array([ranges.get(name, (low.get(name, -np.inf), np.inf)) for name in self.names])
        return found[:, 0], found[:, 1]

    def effects_at(self, common: Array) -> tuple[Effect, ...]:
        """The effects with their parameters.

        Args:
            common: as in `Point`, shape (common,).
        """
        values = dict(zip(self.names, common.tolist(), strict=True)) | dict(self.fixed)
        return tuple(
            kind(**{i.name: values.get(f"{kind.name}.{i.name}", i.default) for i in kind.parameters()})
            for kind in self.effects
        )

    def stated(self, common: Array, release: Array, run: RunData) -> RunSettings:
        """The nominal physics of one run, before any effect.

        Args:
            common: as in `Point`, shape (common,).
            release: of the run, shape (2,).
        """
        value = {**self._held, **dict(zip(self.names, common.tolist(), strict=True))}
        law = self.data.law
        spring = value["stiffness"] if self.data.normalised else run.spring_stiffness
        assert spring is not None
        return RunSettings(
            spring_stiffness=max(spring + value.get("added_stiffness", 0.0), 0.0),
            derivatives=AeroDerivatives(value.get("cn_beta", 0.0), value.get("cn_r", 0.0)),
            yaw_inertia=1.0 if self.data.normalised else value["yaw_inertia"],
            mechanical_damping=value["mechanical_damping"],
            wind_speed=run.wind_speed,
            air_density=run.air_density,
            release_angle=float(release[0]),
            release_rate=float(release[1]),
            duration=run.duration,
            parameters={} if law is None else {"friction_moment": law.friction},
            program=self.data.program,
            drive=run.moment(value.get("drive_gain", 1.0), value.get("moment_offset", 0.0)),
        )

    def chain(
        self, common: Array, own: Array, run: RunData, effects: tuple[Effect, ...] | None = None
    ) -> EffectChain:
        """The effects of one run, with the phases and instants that it has.

        Args:
            common: as in `Point`, shape (common,).
            own: the run's own parameters, a row of ``Point.release``, shape (own,).
            effects: from `effects_at`, where they are known already.
        """
        phases = {name: own[place] for name, place in self.own_places(own.size).items()}
        drawn = tuple(
            phases.get(kind.name) if kind.skips or kind.name not in phases else float(phases[kind.name][0])
            for kind in self.effects
        )
        known = self.effects_at(common) if effects is None else effects
        return EffectChain(self.stated(common, own, run), known, drawn)

    def predict(self, points: Sequence[Point]) -> list[list[Array]]:
        """Predicted block means of the reading, for every point, for every run.

        In rad; infinite where the motion grows without bound, or a parameter is not finite.
        """
        found = [[np.full(run.reading.size, np.inf) for run in self.data.runs] for _ in points]
        alike: dict[object, list[tuple[int, int, _Job]]] = {}  # those of one motion, which is integrated once
        # jobs whose moment law another run may share: the zero and, where no effect knows the time or the release,
        # the release do not matter to it
        first: dict[object, _Job] = {}
        for i, point in enumerate(points):
            if not np.all(np.isfinite(point.common)):
                continue
            effects = self.effects_at(point.common)
            autonomous = not any(effect.depends_on_release for effect in effects)
            named = zip(self.names, point.common.tolist(), strict=True)
            law = tuple(value for name, value in named if name != "zero")
            for r, run in enumerate(self.data.runs):
                if np.all(np.isfinite(point.release[r])):
                    like = first.get((law, run.conditions)) if autonomous else None
                    job = _Job(self, point, r, effects) if like is None else like.released(self, point, r)
                    first.setdefault((law, run.conditions), job)
                    alike.setdefault(job.motion, []).append((i, r, job))
        motions = list(alike.values())
        groups = -(-len(motions) // _TOGETHER)
        half = max(1, -(-groups // _THREADS)) * _TOGETHER
        parts = [
            [[job for *_, job in motion] for motion in motions[i : i + half]]
            for i in range(0, len(motions), half)
        ]
        results = [values for part in _POOL.map(_run_jobs, parts) for values in part]
        for motion, readings in zip(motions, results, strict=True):
            for (i, r, _), values in zip(motion, readings, strict=True):
                found[i][r] = values
        return found


class _Job:
    """One run at one point."""

    def __init__(self, problem: Problem, point: Point, run_index: int, effects: tuple[Effect, ...]) -> None:
        run = problem.data.runs[run_index]
        self.run = run
        self.zero = problem.zero(point.common, point.release[run_index])
        self.chain = problem.chain(point.common, point.release[run_index], run, effects)
        rig = campaign_rig(problem.data)
        physics = self.chain.physics()
        driven = physics.drive is not None
        if problem.rod_followed or driven:
            physics = condensed(physics, problem.data)
        physics = released_by_spring_end(physics)
        slow = None if problem.rod_followed or driven else slow_motion(physics, rig)
        self.ringing = None if slow is None else slow.ringing
        if slow is None:
            self.row, self.keep_alive = forward_run(physics)
        else:
            physics = slow.run
            self.row, self.keep_alive = slow.forward_run()
        self.blocks = run.reading.size + blocks_beyond(physics, run)
        substeps = fit_substeps(physics, run.interval)
        # a derivative of the angle would show where steps are joined
        rough = substeps > 1 or physics.rod_twist is not None or run.derivative > 0 or driven
        stride = 1 if rough else fit_stride(rig, physics, run.interval)
        law, step = physics.law(rig), stride * run.interval / substeps
        if not driven:  # a longer step would shift the motion against its input
            law, step = compensated(law, run.wind_speed, step)
        if physics.wind_speed == 0.0 and not physics.series:
            law |= dict.fromkeys(_AIR, 0.0)
        self.steps = substeps, stride
        self.row["step"], self.row["steps"], self.row["stride"] = step / stride, substeps, stride
        self.law = np.array(list(law.values()), np.float64)  # which is in the law's order

    @property
    def motion(self) -> object:
        """What determines the motion: law, run and samples."""
        numbers = self.row.copy()
        numbers[list(_POINTERS)] = 0
        return self.blocks, self.law.tobytes(), numbers.tobytes(), *(a.tobytes() for a in self.keep_alive)

    def released(self, problem: Problem, point: Point, run_index: int) -> _Job:
        """Another run in equal conditions, where no effect knows the time or the release."""
        job = copy.copy(self)
        job.run = problem.data.runs[run_index]
        job.zero = problem.zero(point.common, point.release[run_index])
        job.row = self.row.copy()
        job.row["angle"] = job.row["lagged"] = point.release[run_index, 0]
        job.row["rate"] = point.release[run_index, 1]
        job.blocks = job.run.reading.size
        return job

    def reading(self, angle: Array, rate: Array) -> Array:
        """Block means of the reading from angle and rate at the blocks' ends."""
        if self.ringing is not None:
            angle, rate = self.ringing.added(angle, rate, self.run.interval)
        if self.chain.skips:
            ends = np.arange(angle.size, dtype=np.float64) * self.run.interval
            return sample_means(self.chain, Motion(ends, angle, rate), self.run, self.zero)
        weights = self.run.weights
        h = self.run.interval
        mean: Array = (
            weights[0] * angle[:-1]
            + weights[1] * angle[1:]
            + h * (weights[2] * rate[:-1] + weights[3] * rate[1:])
        )
        return self.chain.reading(self.chain.angle(mean, self.run.times, self.run.derivative) + self.zero)


def blocks_beyond(physics: RunSettings, run: RunData) -> int:
    """By how many blocks a motion must outlast the record: 0 unless an effect reads it after the end."""
    return int(np.ceil(max(0.0, physics.duration - run.duration) / run.interval))


def sample_means(chain: EffectChain, motion: Motion, run: RunData, zero: float) -> Array:
    """Block means of the reading, rad, sample by sample.

    Args:
        motion: at the blocks' ends.
        zero: of the sensor, rad.
    """
    reading = chain.reading(chain.seen(motion, run.sample_times, run.derivative) + zero)
    return run.means(reading)


def condensed(physics: RunSettings, data: Data) -> RunSettings:
    """Replace a rod that is too stiff to ring visibly by its first-order effect on the slow motion.

    With compliance c, the body leads the sensor's end by φ = a θ, a = c (s Ka + (1 − s) Kr): the inertia at the
    sensor's end grows by the share (1 − s) a, and the air sees (1 + a) θ. What is dropped is of order (c Kr)².
    """
    twist = physics.rod_twist
    if twist is None or twist.compliance > _SOFT_ROD:
        return physics
    share = twist.inertia_share
    air = data.air_moment(physics) * physics.derivatives.cn_beta
    lead = twist.compliance * (share * air + (1.0 - share) * physics.spring_stiffness)
    air_seen = AeroDerivatives(
        physics.derivatives.cn_beta * (1.0 + lead), physics.derivatives.cn_r * (1.0 + lead)
    )
    inertia = physics.yaw_inertia * (1.0 + (1.0 - share) * lead)
    return dataclasses.replace(physics, rod_twist=None, derivatives=air_seen, yaw_inertia=inertia)


def campaign_rig(data: Data) -> Rig:
    """A rig of the campaign's own reference sizes."""
    return _rig(data.frontal_area, data.reference_length, data.width)


@lru_cache(maxsize=8)
def _rig(area: float, length: float, width: float) -> Rig:
    rig = load_rig()
    body = dataclasses.replace(rig.body, frontal_area=area, length=length, width=width)
    return dataclasses.replace(rig, body=body)


def _run_jobs(motions: list[list[_Job]]) -> list[list[Array]]:
    """Readings of jobs by motion; motions of equal length and steps are integrated together."""
    out: list[list[Array]] = [[] for _ in motions]
    alike: dict[tuple[int, int, int], list[int]] = {}
    for i, (job, *_) in enumerate(motions):
        alike.setdefault((job.blocks, *job.steps), []).append(i)
    for (length, _, _), places in alike.items():
        at = np.array(places)
        while at.size:
            rows = np.concatenate([motions[i][0].row for i in at])
            law = np.stack([motions[i][0].law for i in at])
            angle, rate, status = integrate(law, rows, length + 1)
            done = at if status == 0 else at[: status - 1]
            for k, i in enumerate(done):
                out[i] = [job.reading(angle[k], rate[k]) for job in motions[i]]
            if status == 0:
                break
            failed = at[status - 1]
            out[failed] = [np.full(job.run.reading.size, np.inf) for job in motions[failed]]
            at = at[status:]
    return out
