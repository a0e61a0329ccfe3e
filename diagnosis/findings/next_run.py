"""Runs to make: one that would distinguish two fitted models, and runs that narrow a coefficient."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from diagnosis.answer.linear_theory import coefficient_gradients
from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.normal_equations import Products, by_run, normal_equations, project_release
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.sensitivities import sensitivities
from diagnosis.model.data import Data
from diagnosis.model.parameters import Point
from diagnosis.model.run_data import RunData
from diagnosis.model.similarity import Similarity
from identification.show.numbers import reading_shown
from identification.show.quantity import Quantity
from tunnel_sim.effects.capabilities import OwnNumbers, Periodic
from tunnel_sim.vocabulary.campaign import speed_groups
from tunnel_sim.vocabulary.freedom import ANGLE, Freedom
from tunnel_sim.vocabulary.quantities import Seconds
from tunnel_sim.vocabulary.record import Array

SEPARATED_BY: Final = 3.0
"""Minimum difference between two answers for a run to distinguish them, in standard deviations. Convention.
Odds of about 100:1."""
ANOTHER_RUN: Final = 0.2
"""Relative difference of a wind speed or a release angle above which a planned run differs from a run that is made.
Judgement."""
WHOLE_RUN: Final = 0.3
"""Duration of a run that is made, as a share of the planned one, below which the planned run is another.
Judgement."""

_ANGLES = (1.0, 0.4)  # shares of the largest swing of the runs
_DURATIONS = (10.0, 30.0)  # s
_MOST_SPEEDS = 4
_ROUNDS = 3  # rounds of fitting the deviations of a planned run: they shift its phase far
_PHASES = 8  # phases of the true model's periodic effect, to average over
_PHASES_TRIED = (1, 720, 72)  # phases of each of the rival's periodic effects (none, one or two), to fit


@dataclass(frozen=True)
class PlannedRun:
    """A run to make.

    Args:
        spring_stiffness: Kr, N m/rad.
        wind_speed: V, m/s.
        release_angle: angle from the rest, rad.
        duration: length of the record, s.
    """

    spring_stiffness: float
    wind_speed: float
    release_angle: float
    duration: float

    def own(self, similarity: Similarity) -> Self:
        """The run in the measured campaign's units, rounded to values that can be set."""
        return dataclasses.replace(
            self,
            spring_stiffness=_adjustable(similarity.own(self.spring_stiffness, "N m/rad"), 0.01),
            wind_speed=_adjustable(self.wind_speed, 0.1),
            release_angle=_adjustable(
                similarity.own(self.release_angle, "rad"), _step_of_release(similarity)
            ),
            duration=_adjustable(similarity.own(self.duration, "s"), 1.0),
        )

    def conditions(self, freedom: Freedom = ANGLE, *, robot: bool = False) -> str:
        """The conditions of the run, in words.

        Args:
            freedom: of the body.
            robot: whether the body is the joint of a machine, which has neither a spring to choose nor a wind.
        """
        wind = "wind off, " if self.wind_speed == 0.0 else f"wind at {self.wind_speed:g} m/s, "
        wind = wind if freedom.windy else ""
        rig = "" if robot else f"spring of {self.spring_stiffness:g} {freedom.unit('N m/rad')}, {wind}"
        angle = reading_shown(self.release_angle, 2, next(iter(freedom.shown)))
        return f"{rig}release at {angle}{' from the rest' if robot else ''}, duration {self.duration:g} s"


@dataclass(frozen=True)
class NextRun(PlannedRun):
    """The run with the largest difference between the predictions of two models.

    Args:
        separation: expected difference of the predictions (see `separation`), in standard deviations.
    """

    separation: float

    @classmethod
    def between(cls, first: Fit, second: Fit) -> NextRun | None:
        """The run that separates two models fitted to the same runs.

        The rig can make the run: its spring, wind speed and angle are those of existing runs, but not all of one
        run. Both models explain that run already, and its like would decide no more.

        Returns:
            None where no stiffness is known, where every such run is made, or where a free decay cannot separate
                the models: every run is driven, or the models differ in an effect of the input.
        """
        data = first.problem.data
        differ = set(first.problem.effects) ^ set(second.problem.effects)
        if not data.decays or any(kind.driven for kind in differ):
            return None
        density = max((run.air_density for run in data.runs), default=0.0) or 1.2
        found = []
        for spring, speed, duration in itertools.product(
            data.model.planned_springs(data), _speeds(data), _DURATIONS
        ):
            run = planned_run(
                first, spring_stiffness=spring, wind_speed=speed, air_density=density, duration=duration
            )
            for angle in (share * data.swing for share in _ANGLES):
                if _made(first, run, angle):
                    continue
                apart = separation(first, second, run, angle)
                if apart is not None:
                    found.append(cls(spring, speed, angle, duration, apart))
        return max(found, key=lambda one: one.separation, default=None)

    def distinguishes(self) -> bool:
        """Whether the run distinguishes its answers."""
        return self.separation >= SEPARATED_BY

    def too_close(self) -> str:
        """The statement that no run distinguishes two answers."""
        return (
            "No run with the springs and wind speeds of this campaign distinguishes these answers: in the best one "
            f"they differ by {self.separation:.1f} standard deviations."
        )

    def words(self, freedom: Freedom = ANGLE, *, robot: bool = False) -> str:
        """The run to make, in words: arguments as in `conditions`."""
        made = self.conditions(freedom, robot=robot)
        return f"{made} (the answers differ by {self.separation:.0f} standard deviations)"


@dataclass(frozen=True)
class FurtherRuns(PlannedRun):
    """Equal runs that narrow a coefficient most, by their Fisher information in the model of the answer.

    Args:
        count: number of runs.
        left: by coefficient, the standard deviation due to noise with these runs, divided by the present one.
    """

    count: int
    left: Mapping[str, float]

    @classmethod
    def narrowing(cls, fit: Fit, after: Mapping[str, Quantity]) -> FurtherRuns | None:
        """The runs that narrow the widest coefficient most, as few as narrow its interval to `WIDE`.

        The rig can make the runs: their spring, wind speed and largest angle are those of existing runs.

        Args:
            after: the coefficients of the answer, in any units.

        Returns:
            None where the noise of the readings leaves no coefficient wide, no stiffness is known, every run is
                driven, or the runs differ by chance: then only the number of runs narrows a coefficient.
        """
        data, runs = fit.problem.data, []
        wide = [name for name, one in after.items() if source_of_width(name, one) == "noise"]
        if not wide or fit.problem.scatter or not data.decays:
            return None
        # a coefficient times unstated sizes is the fit's coefficient in other units
        names = data.model.coefficient_names(fit.problem.names)
        own = [next((one for one in after if f"{one}_".startswith(f"{name}_")), "") for name in names]
        widest = max(wide, key=lambda name: after[name].reach / abs(after[name].value))
        density = max((run.air_density for run in data.runs), default=0.0) or 1.2
        duration = max(run.duration for run in data.runs)
        kinds = [*itertools.product(data.model.planned_springs(data), _speeds(data))]
        for spring, speed in kinds:
            given = planned_run(
                fit, spring_stiffness=spring, wind_speed=speed, air_density=density, duration=duration
            )
            runs.append(given)
        if not runs or widest not in own:
            return None
        left = remaining(fit, runs, data.swing)
        of_widest, one = left[:, :, own.index(widest)], after[widest]
        best = int(np.argmin(of_widest[-1]))
        noise, now = one.shares["noise"], one.reach / abs(one.value)
        suffices = 1.0 - noise * (1.0 - of_widest[:, best] ** 2) <= (WIDE / now) ** 2
        few = int(np.argmax(suffices)) if suffices.any() else len(_COUNTS) - 1
        shares = {name: float(share) for name, share in zip(own, left[few, best], strict=True) if name}
        return cls(*kinds[best], data.swing, duration, _COUNTS[few], shares)


WIDE: Final = 0.1
"""Maximum half-width of a 95 % interval that needs no step, as a share of the coefficient. Judgement."""


def source_of_width(name: str, given: Quantity) -> str:
    """The largest source of a coefficient's variance if its 95 % interval is wide; else empty."""
    known = name != "moment_offset" and given.std and given.value and given.shares
    if not known or given.reach <= WIDE * abs(given.value):
        return ""
    return max(given.shares, key=given.shares.__getitem__)


_COUNTS = (2, 4, 8)  # numbers of further runs, to choose from


def remaining(fit: Fit, runs: list[RunData], angle: float) -> Array:
    """Standard deviations of the coefficients due to noise with further runs, over the present ones.

    Args:
        runs: from `planned_run`.
        angle: release angle, rad.

    Returns:
        Ratios, shape (counts, runs, coefficients); counts as in `_COUNTS`. A ratio is 1 if its run cannot be
        integrated.
    """
    problem, own = _planned(fit, tuple(runs), angle)
    found = sensitivities(problem, Point(fit.point.common, np.tile(own, (len(runs), 1))))
    present, _, _ = normal_equations(
        fit.jacobian, [np.zeros(len(common)) for common, _ in fit.jacobian], products=fit.products
    )
    known = Products.of(found, problem.parameters.precision)
    added, _, _ = by_run(found, [np.zeros(len(common)) for common, _ in found], products=known)
    added[~np.isfinite(added).all(axis=(1, 2))] = 0.0
    scale = np.sqrt(np.maximum(np.diag(present), 1e-300))
    gradients = coefficient_gradients(fit) / scale

    def variances(matrix: Array) -> Array:
        inverse = np.linalg.pinv(matrix / np.outer(scale, scale), rcond=1e-12, hermitian=True)
        found: Array = np.einsum("ci,ij,cj->c", gradients, inverse, gradients)
        return np.maximum(found, 1e-300)

    after = np.array([[variances(present + count * one) for one in added] for count in _COUNTS])
    return np.minimum(np.sqrt(after / variances(present)), 1.0)


OTHER_INPUT = "record a run with another input, such as half the amplitude or another band of frequencies"
OTHER_SPEED = "record a run at another wind speed, or with another input"


def _step_of_release(similarity: Similarity) -> float:
    """A power of ten: 0.01 rad of the similar rig, or less."""
    return float(10.0 ** math.floor(math.log10(similarity.own(0.01, "rad"))))


def _adjustable(value: float, step: float) -> float:
    """A whole number of steps, or two digits where it is only a few steps."""
    few = abs(value) < 10.0 * step
    return float(f"{value:.2g}") if few else round(round(value / step) * step, 6)


def _speeds(data: Data) -> list[float]:
    """Wind off, and up to `_MOST_SPEEDS` settings of the campaign's wind, the fastest among them, m/s."""
    known = sorted({0.0, *speed_groups(run.wind_speed for run in data.runs).values()}, reverse=True)
    return sorted({0.0, *known[:: -(-len(known) // _MOST_SPEEDS)]})


def planned_run(
    fit: Fit, *, spring_stiffness: float, wind_speed: float, air_density: float, duration: Seconds
) -> RunData:
    """A future run, with the sampling and the noise of the existing runs.

    Args:
        spring_stiffness: Kr, N m/rad.
        wind_speed: V, m/s.
        air_density: ρ, kg/m³; not used where the wind is off.
    """
    template = fit.problem.data.runs[0].undriven()
    blocks = round(duration / template.interval)
    return dataclasses.replace(
        template,
        id="next",
        reading=np.zeros(blocks),
        shorter=None if template.shorter is None else np.zeros(blocks * template.merges),
        spring_stiffness=spring_stiffness,
        wind_speed=wind_speed,
        air_density=air_density if wind_speed > 0.0 else 0.0,
        duration=duration,
        start=0.0,
        samples=None,
    )


def _made(fit: Fit, planned: RunData, angle: float) -> bool:
    """Whether a run of the same spring, wind speed and release angle exists, and is not much shorter."""
    return any(
        run.spring_stiffness == planned.spring_stiffness
        and abs(run.wind_speed - planned.wind_speed) <= ANOTHER_RUN * planned.wind_speed
        and abs(abs(own[0]) - angle) <= ANOTHER_RUN * angle
        and run.duration >= WHOLE_RUN * planned.duration
        for run, own in zip(fit.problem.data.runs, fit.point.per_run, strict=True)
    )


def separation(first: Fit, second: Fit, run: RunData, angle: float) -> float | None:
    """Difference between two models' predictions of one run, after its own parameters are refitted.

    Args:
        run: the conditions and the length of the run; its reading is not used.
        angle: release angle, rad.

    Returns:
        The misfit of the rival in standard deviations, after its release, its chance differences between runs and
        the phases of its periodic effects are refitted. A standard deviation is the noise, or the misfit that
        both models leave where that is larger. The phases of the true model cannot be chosen: the misfit is a
        root mean square over them. Each model is taken as the true one in turn, and the smaller misfit counts.
        None where a model's motion diverges. Half the square is the expected log-likelihood ratio of the run, in
        nats, if one of the two models is right.
    """
    one, other = _predict(first, run, angle), _predict(second, run, angle)
    if one is None or other is None:
        return None
    dispersion = max(1.0, min(1.0 + first.excess, 1.0 + second.excess))
    missed = (
        _missed(one, _nearer(other, one, second, run), run),
        _missed(other, _nearer(one, other, first, run), run),
    )
    return min(missed) / (run.noise.scale * float(np.sqrt(dispersion)))


@dataclass(frozen=True, eq=False)
class _Prediction:
    """A model's prediction of a run; behind its n readings the run's deviations, over their priors."""

    reading: Array  # mean over the phases of its periodic effects, rad, shape (n + deviations,)
    waves: Array  # contributions of the cosine and the sine of each phase, rad, (n + deviations, 2 × effects)
    slopes: Array  # changes by steps of the release and the deviations, rad, shape (n + deviations, steps)
    own: Array  # parameters of the run, shape (own,)
    steps: Array  # steps of these parameters, shape (steps, own)


def _predict(fit: Fit, run: RunData, angle: float, own: Array | None = None) -> _Prediction | None:
    """Predict a run; None where it cannot be integrated.

    The response to a periodic effect is of first order in its size, so it rotates with the effect's phase.

    Args:
        own: parameters of the run; None: a release at the angle, without deviations.
    """
    problem, start = _planned(fit, (run,), angle)
    own = start if own is None else own
    turns = _turning(problem)
    count = int(turns.sum())
    first = len(problem.parameters.own) - problem.parameters.of_effects
    deviations = problem.parameters.places(problem.scatter)
    widths = problem.parameters.precision[deviations] ** -0.5
    steps = np.zeros((2 + len(deviations), own.size))
    steps[[0, 1], [0, 1]] = 1e-4 * angle, 1e-3 * angle
    steps[range(2, len(steps)), deviations] = widths
    rows = [own, *(own + steps)]
    for turn in (0.5 * np.pi, np.pi):
        rows += list(own + turn * np.eye(own.size)[first:][turns])
    values = np.stack([v[0] for v in problem.predict([Point(fit.point.common, row[None]) for row in rows])])
    if not np.all(np.isfinite(values)):
        return None
    # a deviation of one standard deviation costs as much as one of the noise
    values = np.hstack([values, np.stack(rows)[:, deviations] / widths * run.noise.scale])
    base, *others = np.split(values, [1, 1 + len(steps), 1 + len(steps) + count])
    stepped, quarter, half = others
    cosine = 0.5 * (base - half)
    sine = quarter - base + cosine
    waves = np.stack([cosine, sine], axis=1).reshape(2 * count, base.size)
    return _Prediction(base[0] - cosine.sum(axis=0), waves.T, (stepped - base).T, own, steps)


def _nearer(rival: _Prediction, true: _Prediction, fit: Fit, run: RunData) -> _Prediction:
    """The rival's prediction with the run's deviations that bring it near the true model; unchanged without any."""
    for _ in range(_ROUNDS if fit.problem.scatter else 0):
        step = np.linalg.lstsq(rival.slopes, _onto(true.reading, rival, run) - rival.reading, rcond=1e-10)[0]
        again = _predict(fit, run, float(rival.own[0]), rival.own + step @ rival.steps)
        if again is None:
            break
        rival = again
    return rival


def _onto(true: Array, rival: _Prediction, run: RunData) -> Array:
    """Readings of the true model, and behind them no deviations of the rival, in place of its own."""
    found = np.zeros((len(rival.reading), *true.shape[1:]))
    found[: run.reading.size] = true[: run.reading.size]
    return found


def _planned(fit: Fit, runs: tuple[RunData, ...], angle: float) -> tuple[Problem, Array]:
    """The problem of planned runs, and the values of a run's own parameters, shape (own,)."""
    # one instant, whatever the number in existing runs
    problem = dataclasses.replace(fit.problem, data=fit.problem.data.with_runs(runs), instants=1)
    first = len(problem.parameters.own) - problem.parameters.of_effects
    start = np.zeros(first)  # no deviation, since it may have either sign
    start[0] = angle
    # samples are skipped in the middle of the run
    return problem, np.array([*start, *np.where(_turning(problem), 0.0, 0.5)])


def _turning(problem: Problem) -> NDArray[np.bool_]:
    """The effects with a phase as a parameter of every run."""
    own = [kind for kind in problem.effects if issubclass(kind, OwnNumbers)]
    return np.array([issubclass(kind, Periodic) for kind in own], bool)


def _missed(true: _Prediction, rival: _Prediction, run: RunData) -> float:
    """Root sum of squares of the refitted rival's misfit to the true model, rad."""
    change = _onto(np.column_stack([true.reading, true.waves]), rival, run)
    change[:, 0] -= rival.reading
    left, waves = project_release(change, rival.slopes), project_release(rival.waves, rival.slopes)
    count = waves.shape[1] // 2
    tried = _pointers(count, _PHASES_TRIED[count])
    power = np.einsum("ij,jk,ik->i", tried, waves.T @ waves, tried)
    squares = []
    for pointer in _pointers(true.waves.shape[1] // 2, _PHASES):
        missed = left @ np.append(1.0, pointer)
        squares.append(float(missed @ missed + np.min(power - 2.0 * tried @ (waves.T @ missed))))
    return float(np.sqrt(max(sum(squares) / len(squares), 0.0)))


def _pointers(count: int, phases: int) -> Array:
    """Cosine and sine of every combination of phases, shape (combinations, 2 × count)."""
    circle = 2.0 * np.pi * np.arange(phases) / phases
    combinations = list(itertools.product(circle.tolist(), repeat=count))
    grid = np.array(combinations).reshape(len(combinations), count)
    pointers: Array = np.stack([np.cos(grid), np.sin(grid)], axis=2).reshape(len(grid), 2 * count)
    return pointers
