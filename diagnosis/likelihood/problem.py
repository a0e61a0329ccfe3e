"""The model of a campaign as a function of parameters: nominal, or with effects added."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from diagnosis.model.chance import RunDeparture, Scatter, departure
from diagnosis.model.parameters import Parameter, ParameterSet, Point
from diagnosis.model.run_data import Data, RunData
from tunnel_sim.effects import Effect, EffectChain
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


@dataclass(frozen=True, eq=False)
class Problem:
    """What is fitted: prepared runs, and the effects added to the nominal model.

    Args:
        effects: effect classes whose parameters are free.
        fixed: value of effect parameters that are held, as ``effect.parameter``.
        free_forms: names of the effects whose form parameters are free; the others keep the textbook form.
        instants: how many instants every run has for an effect that skips samples.
        scatter: chance differences between runs beside the effects; each run has a deviation of its own of each.
        rod_followed: whether a flexible rod is integrated with its ringing; else the ringing is added to the slow
            motion, which is much faster and exact as far as the rig is linear.
    """

    data: Data
    effects: tuple[type[Effect], ...] = ()
    fixed: tuple[tuple[str, float], ...] = ()
    free_forms: tuple[str, ...] = ()
    instants: int = 1
    scatter: Scatter = ()
    rod_followed: bool = False

    @cached_property
    def parameters(self) -> ParameterSet:
        """All parameters: the nominal model's first, then the effects' in their order."""
        nominal, held = self.data.model.parameters(self.data), dict(self.fixed)
        found, swing = list(nominal), self.data.swing
        found += [one.parameter for one in self.scatter]
        for kind in self.effects:
            for info in kind.parameters():
                name = f"{kind.name}.{info.name}"
                free = not info.of_input and (not info.form or kind.name in self.free_forms)
                if free and name not in held and self.data.model.tells(info, swing):
                    low, high = info.fit_range(swing)
                    found.append(Parameter(name, info.unit, low, high, info.scale, effect=kind.name))
            for own in kind.own_numbers(self.instants):
                found.append(Parameter(f"{kind.name}.{own}", "1", owner="per_run", effect=kind.name))
        return ParameterSet(tuple(found))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all common parameters, the nominal ones first."""
        return self.parameters.names

    @cached_property
    def effect_names(self) -> tuple[str, ...]:
        """Names of the free effect parameters, as ``effect.parameter``."""
        return tuple(one.name for one in self.parameters.common if one.effect)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest values of the common parameters."""
        return self.parameters.bounds

    def zero(self, common: Array, own: Array) -> float:
        """The sensor's zero in one run, in the unit of the reading.

        Args:
            common: as in `Point`, shape (common,).
            own: of the run, a row of ``Point.release``, shape (own,).
        """
        parameters = self.parameters
        if "zero" in parameters.names:
            return float(common[parameters.names.index("zero")])
        if "zero" in parameters.own_names:
            return float(own[parameters.own_names.index("zero")])
        return self.data.model.held.get("zero", 0.0)

    def _values(self, common: Array, own: Array) -> dict[str, float]:
        """Values of all parameters in one run by name, those held among them; arguments as in `zero`."""
        names, own_names = self.parameters.names, self.parameters.own_names
        fitted = dict(zip(names, common.tolist(), strict=True))
        return {**self.data.model.held, **fitted, **dict(zip(own_names, own.tolist(), strict=False))}

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
        return self.data.model.run_settings(self._values(common, release), run)

    def chain(
        self, common: Array, own: Array, run: RunData, effects: tuple[Effect, ...] | None = None
    ) -> EffectChain:
        """The effects of one run, with the phases and instants that it has.

        Args:
            common: as in `Point`, shape (common,).
            own: the run's own parameters, a row of ``Point.release``, shape (own,).
            effects: from `effects_at`, where they are known already.
        """
        phases = {name: own[place] for name, place in self.parameters.own_places.items()}
        drawn = tuple(
            phases.get(kind.name) if kind.skips or kind.name not in phases else float(phases[kind.name][0])
            for kind in self.effects
        )
        known = self.effects_at(common) if effects is None else effects
        stated = self.stated(common, own, run)
        if not self.scatter:
            return EffectChain(stated, known, drawn)
        changed = departure(
            self.scatter, own[self.parameters.places(self.scatter)].tolist(), stated, self.data
        )
        return EffectChain(stated, (*known, RunDeparture()), (*drawn, np.array(changed)))

    def predict(self, points: Sequence[Point]) -> list[list[Array]]:
        """Predicted block means of the reading, for every point, for every run.

        In rad; infinite where the motion grows without bound, or a parameter is not finite.
        """
        found = [[np.full(run.reading.size, np.inf) for run in self.data.runs] for _ in points]
        alike: dict[object, list[tuple[int, int, _Job]]] = {}  # those of one motion, which is integrated once
        # jobs whose moment law another run may share: the zero and, where no effect knows the time or the release,
        # the release do not matter to it
        first: dict[object, _Job] = {}
        of_physics = self.parameters.of_physics
        for i, point in enumerate(points):
            if not np.all(np.isfinite(point.common)):
                continue
            effects = self.effects_at(point.common)
            autonomous = not any(effect.depends_on_release for effect in effects)
            named = zip(self.names, point.common.tolist(), strict=True)
            law = tuple(value for name, value in named if name != "zero")
            for r, run in enumerate(self.data.runs):
                if np.all(np.isfinite(point.release[r])):
                    same = law, run.conditions, *(point.release[r, place] for place in of_physics)
                    like = first.get(same) if autonomous else None
                    job = _Job(self, point, r, effects) if like is None else like.released(self, point, r)
                    first.setdefault(same, job)
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
