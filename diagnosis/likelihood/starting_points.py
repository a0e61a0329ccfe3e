"""Where fits start: the nominal model from the records alone, and an effect's severity from its signature."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from diagnosis.likelihood.least_squares import Fit, clip, damped_step, normal_equations
from diagnosis.likelihood.mains_lines import mains_line
from diagnosis.likelihood.nondimensional import REFERENCE_INERTIA
from diagnosis.likelihood.per_run import PerRunParameters, excited, ringing, skip
from diagnosis.likelihood.problem import Point, Problem
from diagnosis.likelihood.residuals import CHANNELS, Line, misfit, shedding_line
from diagnosis.likelihood.run_data import Data, RunData, departure
from identification.signal.decay_fit import Reading, fit_run
from identification.signal.driven import driven_start
from identification.signal.free_decay import Decay
from identification.signal.frequency import peak_of_swing, starting_decay
from tunnel_sim.effects import Effect
from tunnel_sim.effects.parameters import Circumstances, ParameterInfo
from tunnel_sim.vocabulary.record import Array, Record

_STILL = 0.02  # of the largest swing, below which a run or a stretch of it counts as at rest
_PHASES = 64  # of a cycle, for its mean
_NEARER = 0.02  # of the size that linear theory gives an effect
_FEW = 5  # blocks whose readings say how fast a run begins
_SLOW = 0.1  # 1/s: a small decay rate of the similar rig
_PADDING = 16  # zero padding of the spectrum that gives the first frequency


def decays_start(data: Data) -> Point | None:
    """A starting point for the nominal model from the runs' own decays, which `identify` gives.

    A frequency that depends on the amplitude spreads the peak of a spectrum, and χ² has a minimum for every cycle
    more or less that fits the record.

    Returns:
        As `nominal_start`; None where a run has no decay of its own.
    """
    if data.driven:
        return None
    decays = []
    for run in data.runs:
        record = Record(run.times, run.reading)
        start = starting_decay(record)
        found = None if start is None else fit_run(Reading.from_record(record), start)
        if found is None or not found.runs or found.runs[0].decay.stiffness <= 0.0:
            return None
        decays.append(found.runs[0].decay)
    return nominal_start(data, decays)


def nominal_start(data: Data, decays: Sequence[Decay] | None = None) -> Point:
    """A starting point for the nominal model.

    Args:
        decays: of the runs, where they are known; else their frequencies are those of their spectra, or of a
            driven run that of the resonance between input and motion.

    Returns:
        Inertia and aerodynamic stiffness by linear regression of the runs' frequencies, a small damping, and
        the releases from the first samples.
    """
    driven = [None if run.drive is None else _driven_start(run) for run in data.runs]
    if data.unrestrained:
        return _unrestrained_start(data, driven)
    squares = []
    for i, (run, response) in enumerate(zip(data.runs, driven, strict=True)):
        if decays is not None:
            squares.append(decays[i].stiffness)
        elif response is not None:
            squares.append(response[1])
        else:
            values = run.reading - run.reading.mean()
            size = _PADDING * values.size
            peak = float(peak_of_swing(values, size) / (size * run.interval))
            squares.append((2.0 * np.pi * peak) ** 2)
    omega2 = np.array(squares)
    swing = np.array([float(np.std(run.reading)) for run in data.runs])
    moving = (swing > _STILL * swing.max()).astype(np.float64)  # a body at rest has no frequency
    typical = float(np.median(omega2[moving > 0.0]))
    own = [float(np.mean(run.reading)) for run in data.runs]
    common = float(np.median(own))
    zeros = own if data.own_zeros else [common] * len(own)
    release = np.array([[np.mean(r.reading[:3]) - z, 0.0, z] for r, z in zip(data.runs, zeros, strict=True)])
    release, zero = (release, ()) if data.own_zeros else (release[:, :2], (common,))
    found = [one for one in driven if one is not None]
    losses = [2.0 * one[0] for one in found if one[0] > 0.0]
    loss = float(np.median(losses)) if losses else 0.01 * float(np.sqrt(typical))
    gains = [
        response[2] / run.drive.scale
        for run, response in zip(data.runs, driven, strict=True)
        if response is not None and run.gain_free and run.drive is not None
    ]
    gain: tuple[float, ...] = ((float(np.median(gains)) if gains else 0.0),) if data.gain_free else ()
    if data.normalised:
        still = (0.0, 0.0) if data.wind_on else ()
        return Point(np.array([typical, loss, *still, *gain, *zero]), release)
    spring = np.array([run.spring_stiffness for run in data.runs], dtype=np.float64)
    if data.law is not None and data.law.terms:  # seen at the amplitude of every run, by harmonic balance
        phase = 2.0 * np.pi * np.arange(_PHASES) / _PHASES
        amplitude = np.sqrt(2.0) * swing[:, None]
        further = departure(data.law).value({"b": amplitude * np.cos(phase), "r": 0.0})
        seen = spring - 2.0 * np.mean(further * np.cos(phase), axis=1) / np.maximum(amplitude[:, 0], 1e-12)
        spring = np.where(seen > 0.0, seen, spring)
    pressure = np.array([data.air_moment(run) for run in data.runs])
    # Kr = Izz ω² + pressure Cnβ, with equal relative errors
    design = np.column_stack([omega2, pressure]) / spring[:, None] * moving[:, None]
    if not data.wind_on:
        design = design[:, :1]
    solution = np.linalg.lstsq(design, moving, rcond=None)[0]
    inertia = float(solution[0]) if solution[0] > 0.0 else float(np.median((spring / omega2)[moving > 0.0]))
    air = (float(solution[1]), 0.0) if data.wind_on else ()
    damping = inertia * loss if losses else 0.01 * inertia * float(np.sqrt(typical))
    gain = tuple(inertia * one for one in gain)
    names = Problem(dataclasses.replace(data, law=None)).nominal_names
    start = dict(zip(names, [inertia, damping, *air, *gain, *zero], strict=True)) | {"added_stiffness": 0.0}
    return Point(np.array([start[name] for name in Problem(data).nominal_names]), release)


def _driven_start(run: RunData) -> tuple[float, float, float] | None:
    """Decay rate (1/s), stiffness (1/s²) and gain (rad/s² per unit); None where the run shows no resonance.

    Of a body without a spring the gain must be positive, in N m of the input.
    """
    sprung = run.spring_stiffness != 0.0
    found = driven_start(run.times, run.reading, run.input_means, sprung=sprung, derivative=run.derivative)
    if found is None or run.drive is None or (found[1] if sprung else found[2] * run.drive.scale) <= 0.0:
        return None
    return found


def joint_start(data: Data) -> Point | None:
    """A starting point for driven runs of a joint of one's own, which need not show a resonance; None of others.

    Inertia and damping are those of the response to known moments. The readings count as positions of the joint.
    """
    law = data.law
    if law is None or not data.driven or data.unrestrained or data.own_zeros:
        return None
    found = [(run.drive.scale, _driven_start(run)) for run in data.runs if run.drive is not None]
    shown = [(gain / one[2], one[0]) for gain, one in found if one is not None and gain * one[2] > 0.0]
    inertia, loss = np.median(shown, axis=0).tolist() if shown else (law.inertia, 0.0)
    damping = max(2.0 * loss * inertia, law.damping)
    known = {"yaw_inertia": inertia, "mechanical_damping": damping, "zero": law.rest}
    release = [
        [np.mean(r.reading[:3]) - law.rest, (r.reading[_FEW] - r.reading[0]) / (_FEW * r.interval)]
        for r in data.runs
    ]
    return Point(np.array([known.get(name, 0.0) for name in Problem(data).nominal_names]), np.array(release))


def _unrestrained_start(data: Data, driven: Sequence[tuple[float, float, float] | None]) -> Point:
    """Inertia and damping of a body that nothing holds by its response to known moments, and no other moment."""
    found = [
        (run.drive.scale / response[2], 2.0 * response[0])
        for run, response in zip(data.runs, driven, strict=True)
        if response is not None and run.drive is not None
    ]
    inertia, loss = np.median(found or [(REFERENCE_INERTIA, 0.0)], axis=0).tolist()
    release = [
        [np.mean(run.reading[:3]), (run.reading[1] - run.reading[0]) / run.interval] for run in data.runs
    ]
    start = {"yaw_inertia": inertia, "mechanical_damping": inertia * max(loss, _SLOW)}
    return Point(np.array([start.get(name, 0.0) for name in Problem(data).nominal_names]), np.array(release))


@dataclass(frozen=True, eq=False)
class StartingPoint:
    """Where the fit of an effect starts, and how much linear theory predicts that it closes.

    Args:
        problem: the fit with the effect added.
        point: where to start.
        predicted_drop: of χ² by linear theory, dimensionless.
        predicted: χ² beyond noise that linear theory leaves by channel, shape (6,), dimensionless.
        scaled: place of the common parameter that linear theory has scaled; None where it scaled none.
        second_order: whether the other parameters absorb the first order of the effect.
    """

    problem: Problem
    point: Point
    predicted_drop: float
    predicted: Array
    scaled: int | None
    second_order: bool = False

    def nearer(self) -> StartingPoint | None:
        """The point with much less of the effect; None where linear theory did not say how much.

        A fit from there goes down from the fit without the effect.
        """
        if self.scaled is None:
            return None
        common = self.point.common.copy()
        common[self.scaled] *= _NEARER
        return dataclasses.replace(self, point=Point(common, self.point.release))


def _of_line(line: Line | None) -> PerRunParameters | None:
    return (
        None if line is None else PerRunParameters((line.amplitude, line.parameter), line.phases, line.drop)
    )


#: How an effect with a number of its own in every run is found: a periodic one by what sets its frequency.
_FINDERS: Mapping[str, Sequence[Callable[[Fit], PerRunParameters | None]]] = {
    "mains": (lambda base: _of_line(mains_line(base)),),
    "shedding": (lambda base: _of_line(shedding_line(base)),),
    "ringing": (ringing, excited),
    "skips": (skip, partial(skip, with_input=True)),
}


def starting_points(base: Fit, kind: type[Effect]) -> list[StartingPoint]:
    """Starting points for adding one effect to a fitted problem, by the drop of χ² predicted, greatest first.

    One per trial; none where the effect cannot be seen in these runs.
    """
    data = base.problem.data
    if (kind.condition == "wind_on" and not data.wind_on) or (kind.driven and not data.driven):
        return []
    found: list[StartingPoint] = []
    if kind.line or kind.skips:
        for one in filter(None, (find(base) for find in _FINDERS[kind.line or "skips"])):
            of_input = tuple((f"{kind.name}.{i.name}", one.of_input) for i in kind.parameters() if i.of_input)
            fixed = (*base.problem.fixed, *(of_input if data.driven else ()))
            problem = dataclasses.replace(base.problem, effects=(*base.problem.effects, kind), fixed=fixed)
            infos = zip(one.values, _own_parameters(problem, kind), strict=True)
            values = [np.clip(value, info.lower, info.upper) for value, info in infos]
            release = np.column_stack([base.point.release, one.numbers])
            point = Point(np.concatenate([base.point.common, values]), release)
            predicted = misfit(base).excess
            predicted[CHANNELS.index("frequency" if kind.skips else "harmonics")] -= one.drop
            found.append(StartingPoint(problem, point, one.drop, predicted, base.point.common.size))
        return sorted(found, key=lambda start: -start.predicted_drop)
    for trial in kind.trials(_circumstances(data)):
        spring = kind.chosen_spring()
        held = {} if spring is None else {spring: trial.values[spring]}
        fixed = (*base.problem.fixed, *((f"{kind.name}.{name}", value) for name, value in held.items()))
        freed = any(info.form and info.name in trial.values for info in kind.parameters())
        free_forms = (*base.problem.free_forms, kind.name) if freed else base.problem.free_forms
        effects = (*base.problem.effects, kind)
        problem = dataclasses.replace(base.problem, effects=effects, fixed=fixed, free_forms=free_forms)
        own = _own_parameters(problem, kind)
        scaled = None if trial.scaled is None else [info.name for info in own].index(trial.scaled)
        sizes = np.array([trial.values.get(info.name, info.default) for info in own])
        names = base.problem.names
        replaced = names.index(trial.replaces) if trial.replaces in names else None
        change = _moderate_change(base, problem, sizes, scaled, replaced)
        if change is None:
            continue
        moved = None
        if trial.second_order:
            moved = absorbed(base, change)
            change = change_to(base, problem, Point(np.concatenate([moved.common, sizes]), moved.release))
        left = project_out(base, change)
        power = sum(float(c @ c) for c in left)
        if not 0.0 < power < np.inf:
            continue
        slope = sum(float(c @ r) for c, r in zip(left, base.residuals, strict=True)) / power
        if moved is not None and slope <= 0.0:
            continue
        start, drop = sizes.copy(), slope * slope * power
        if scaled is not None:
            by = slope if moved is None else np.sqrt(slope)
            moderate = np.clip(by * sizes[scaled], -trial.at_most, trial.at_most)
            start[scaled] = np.clip(moderate, own[scaled].lower, own[scaled].upper)
            if start[scaled] == 0.0:
                start[scaled], drop = 0.01 * sizes[scaled], 0.0
            if replaced is not None:
                start[scaled] = min(start[scaled], base.point.common[replaced])
        point = Point(_with_effect(base, start, scaled, replaced), base.point.release)
        if moved is not None and scaled is not None:
            part = start[scaled] / sizes[scaled]
            point.common[: moved.common.size] += part * (moved.common - base.point.common)
            release = point.release + part * (moved.release - base.point.release)
            point = clip(problem, Point(point.common, release))
        place = None if scaled is None else base.point.common.size + scaled
        after = [r - slope * c for c, r in zip(left, base.residuals, strict=True)]
        predicted = misfit(base, after).excess
        found.append(StartingPoint(problem, point, drop, predicted, place, trial.second_order))
    return sorted(found, key=lambda start: -start.predicted_drop)


def second_order_starts(base: Fit, kind: type[Effect]) -> list[StartingPoint]:
    """An effect whose first order is absorbed at the sizes of its trials, whether or not the readings ask for it.

    Empty for other effects, and where the runs cannot show it.
    """
    data, found = base.problem.data, []
    if kind.condition == "wind_on" and not data.wind_on:
        return []
    for trial in kind.trials(_circumstances(data)):
        if trial.second_order and trial.scaled is not None:
            problem = dataclasses.replace(base.problem, effects=(*base.problem.effects, kind))
            own = _own_parameters(problem, kind)
            sizes = np.array([trial.values.get(info.name, info.default) for info in own])
            point = Point(np.concatenate([base.point.common, sizes]), base.point.release)
            place = base.point.common.size + [info.name for info in own].index(trial.scaled)
            found.append(StartingPoint(problem, point, 0.0, np.zeros(len(CHANNELS)), place, True))
    return found


def misses_motion(fit: Fit) -> bool:
    """Whether a fit misses the motion itself, so that its sensitivities are of little use.

    Its residual then holds more than a given share of the power of the readings, both about their means in every
    cycle. A drift or a step of the zero is slower than the motion and leaves its phase known.
    """
    found = misfit(fit)
    at_motion = float(found.chi2.sum()) - float(found.chi2[CHANNELS.index("zero")])
    return at_motion > fit.settings.selection.gross_misfit * found.motion


def _own_parameters(problem: Problem, kind: type[Effect]) -> list[ParameterInfo]:
    """Those parameters of an effect that are free in a problem."""
    return [info for info in kind.parameters() if f"{kind.name}.{info.name}" in problem.names]


def _circumstances(data: Data) -> Circumstances:
    greatest = max(float(np.max(np.abs(run.reading))) for run in data.runs)
    slowest = min((run.wind_speed for run in data.runs if run.wind_on), default=0.0)
    return Circumstances(data.springs, greatest, data.normalised, slowest)


def _with_effect(base: Fit, values: Array, scaled: int | None, replaced: int | None) -> Array:
    """Common parameters with those of an effect; ``replaced`` is the place of the one that it replaces."""
    common = base.point.common.copy()
    if scaled is not None and replaced is not None:
        common[replaced] -= values[scaled]
    return np.concatenate([common, values])


def absorbed(base: Fit, change: Sequence[Array]) -> Point:
    """Where the parameters of a fit go to absorb a change of the scaled prediction, by one Gauss–Newton step."""
    return damped_step(base.problem, base.point, [-c for c in change], base.jacobian, 0.0)


def change_to(base: Fit, problem: Problem, point: Point) -> list[Array]:
    """Change of the scaled prediction from a fit to a point of a problem with further parameters."""
    moved, runs = problem.predict([point])[0], base.problem.data.runs
    return [run.scaled(m - run.reading) + r for m, run, r in zip(moved, runs, base.residuals, strict=True)]


def _moderate_change(
    base: Fit, problem: Problem, values: Array, scaled: int | None, replaced: int | None = None
) -> list[Array] | None:
    """Change of the scaled prediction by an effect, one value lowered until the change is moderate.

    ``values`` holds the effect's parameters and is changed in place to those that were used; ``scaled`` is the
    place of the one that is lowered, None where none may be, and ``replaced`` that of the one that it replaces.
    """
    limit = 3.0 * np.sqrt(base.total)
    for _ in range(12):
        change = change_to(
            base, problem, Point(_with_effect(base, values, scaled, replaced), base.point.release)
        )
        size = float(np.sqrt(sum(float(c @ c) for c in change)))
        if np.isfinite(size) and (size <= limit or scaled is None):
            return change
        if scaled is None:
            return None
        values[scaled] *= 0.1 if not np.isfinite(size) else max(0.01, 0.5 * limit / size)
    return None


def unabsorbed(base: Fit, kind: type[Effect]) -> tuple[Array, float] | None:
    """What an effect of typical size changes that the fitted parameters cannot absorb.

    Args:
        kind: an effect without numbers of its own in every run.

    Returns:
        The scaled change of all runs, shape (n,), and its norm as a share of the whole change; None where the
        runs cannot show the effect.
    """
    data = base.problem.data
    trial = next(iter(kind.trials(_circumstances(data))), None)
    if trial is None or (kind.condition == "wind_on" and not data.wind_on):
        return None
    effects = (*base.problem.effects, kind)
    problem = dataclasses.replace(base.problem, effects=effects, free_forms=(kind.name,))
    infos = _own_parameters(problem, kind)
    values = np.array([trial.values.get(info.name, info.default) for info in infos])
    scaled = None if trial.scaled is None else [info.name for info in infos].index(trial.scaled)
    change = _moderate_change(base, problem, values, scaled)
    if change is None:
        return None
    left, whole = np.concatenate(project_out(base, change)), np.concatenate(change)
    size = float(np.linalg.norm(whole))
    return None if size == 0.0 else (left, float(np.linalg.norm(left)) / size)


def project_out(base: Fit, columns: list[Array]) -> list[Array]:
    """The part of a change of the prediction, by run, that the fitted common parameters and releases cannot absorb.

    Args:
        columns: scaled change by run, each of shape (n,).
    """
    matrix, gradient, solutions = normal_equations(base.jacobian, columns, products=base.products)
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    step = np.linalg.lstsq(matrix / np.outer(scale, scale), gradient / scale, rcond=1e-12)[0] / scale
    return [
        column - common @ step - release @ (solution[:, -1] - solution[:, :-1] @ step)
        for column, (common, release), solution in zip(columns, base.jacobian, solutions, strict=True)
    ]
