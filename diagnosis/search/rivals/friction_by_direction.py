"""A cause from outside the vocabulary: friction that differs between drive and back-drive.

Where the motor's moment and the rate have the same sign, the motor drives the load; else the load drives the
motor. Gears rub more in one of these quadrants of moment and rate than in the other, by a moment, or by a share
of the moment that the joint carries (Hamon, Gautier & Garrec, IEEE Int. Conf. Robotics and Automation 2011,
1077).

Half the difference times the load is then a moment against the motor's, whatever the direction of the motion, and
at rest, beside friction of the mean size. Load and deflection are taken along the motion as it is known, so this
moment is a known function of time. If the load is always the motor's own moment, it only changes the gain:
without gravity no record shows a difference of shares.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import copysign, hypot, sqrt
from typing import Any, ClassVar, Final, Self

import numpy as np
from scipy.interpolate import CubicSpline

from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.likelihood.part_of_fit import restricted
from diagnosis.likelihood.problem import Problem
from diagnosis.model.fact import Fact, as_stated
from diagnosis.model.parameters import Point
from diagnosis.model.similarity import Similarity
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.rivals.rival import Rival, explains_all, explains_more
from identification.show.numbers import percent, plain, with_std
from tunnel_sim.effects import Effect
from tunnel_sim.effects.base import Drawn
from tunnel_sim.effects.capabilities import Friction
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.physics.moment_law import WEIGHTS
from tunnel_sim.physics.run_settings import Series, SettingsTable
from tunnel_sim.vocabulary.record import Array

DIRECTED_BESIDE: Final = 2
"""Number of sets of effects with dry friction beside which its difference between drive and back-drive is tried.
Judgement. Time against coverage."""
DIRECTED_LEAVES: Final = 0.25
"""Maximum residual beside friction that differs between drive and back-drive, as a share of the residual of every
set of effects (both in χ² above the noise), for the difference to be weighed. Judgement. A parameter more takes
up a part of any residual."""
DIRECTED_SHOWN: Final = 5.0
"""Minimum difference between the friction in drive and back-drive, in standard deviations. Convention."""

DIRECTED_EXACT: Final = 0.0015
"""Standard error of the friction in drive and in back-drive by the numerics, if the contact deflects before it
slides, as a share of the usual friction. Estimated."""
DIRECTED_GRIPS: Final = 8
"""Maximum number of fits of a contact that deflects before it slides, each along the motion of the one before.
Judgement. Time against accuracy."""

_SETTLED = 2e-3  # of χ²
_FINE, _FINEST = 8, 32  # points of the moment between samples of the input, in the search and at the end


@dataclass(frozen=True, eq=False)
class Course:
    """The angle of a run at the middles between evenly spaced times from its start on.

    Args:
        interval: s.
        angle: rad, the first half an interval before the start, shape (n + 1,).
        grip: deflection of the contact in the direction of the rate, as a share of the one at which it slides,
            shape (n + 1,); 1 where it slides.
    """

    interval: float
    angle: Array
    grip: Array

    @property
    def times(self) -> Array:
        """The times of the angle, s."""
        return np.asarray(self.interval * (np.arange(self.angle.size) - 0.5), np.float64)


@dataclass(frozen=True)
class DirectedFriction(Effect):
    """Half of each difference of friction, as a moment against the motor's."""

    name = "friction_by_direction"
    channel = "damping"
    condition = "always"
    autonomous = False
    driven = True
    by_angle_in_room = True
    jumps = True

    #: The runs by the samples of their inputs.
    courses: ClassVar[Mapping[bytes, Course]] = {}

    moment: float = parameter(
        "ΔTc", "N m", "friction in drive less friction in back-drive", scale=0.004, lower=-1e4, upper=1e4
    )
    share: float = parameter(
        "Δμ", "1", "share of the load in drive less share in back-drive", scale=0.1, lower=-1.8, upper=1.8
    )

    @property
    def is_null(self) -> bool:
        """Whether nothing differs."""
        return self.moment == 0.0 and self.share == 0.0

    @classmethod
    def along(cls, courses: Mapping[bytes, Course]) -> type[Self]:
        """The differences along the courses of some runs."""
        return dataclass(frozen=True)(type(cls.__name__, (cls,), {"courses": courses}))

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Add the moment to the runs with inputs."""
        del stated, drawn
        for place, drive in runs.inputs.items():
            course, effect = cls.courses.get(drive.values.tobytes()), effects[place]
            if course is None or effect.is_null:
                continue
            given = drive.at(course.times)
            terms = ((runs[size][place], runs[rest][place]) for size, rest in WEIGHTS)
            weight = sum(size * np.sin(course.angle - rest) for size, rest in terms)
            load = np.maximum(np.abs(given), np.abs(weight))
            against = 0.5 * np.sign(given) * course.grip * (effect.moment + effect.share * load)
            values = -0.5 * (against[1:] + against[:-1])
            added = Series(tuple(values.tolist()), course.interval)
            runs.series[place] = {**runs.series[place], "ambient": added}


_OF_MEAN = {"friction_moment": "moment", "load": "share"}
"""The differences by the parameter of friction that is their mean."""


class FrictionByDirection(Rival):
    """Dry friction of a driven joint that differs between drive and back-drive, beside other effects."""

    def hypotheses(
        self, likely: Sequence[Hypothesis], known: Sequence[Hypothesis], nominal: Fit
    ) -> list[Hypothesis]:
        """The difference as a share of the load, and as a moment, with the likeliest sets that have dry friction.

        None where a set of effects explains the readings down to their noise, and none where the difference leaves
        a considerable part of what every set leaves.
        """
        data = nominal.problem.data
        by_motor = bool(data.inputs) and all(drive.kind.by_actuator for drive in data.inputs)
        if not by_motor or any(run.derivative for run in data.runs):
            return []
        least = min([*(one.fit for one in known), nominal], key=lambda fit: fit.total)
        if explains_all(least):
            return []
        sets = {one.names: one for one in (*known, *likely) if _rubs(one.fit.problem)}
        ranked = sorted(sets.values(), key=lambda one: one.fit.total)
        alone = [one for one in ranked if len(one.names) == 1][:1]
        found = list[Hypothesis]()
        for base in dict.fromkeys((*alone, *ranked[:DIRECTED_BESIDE])):
            tried = _beside(base)
            if tried is not None:
                found += [one for one in (tried, *_alone(tried)) if _stands(one.fit, least)]
            if any(explains_all(one.fit) for one in found):
                break
        kept = [one for one in found if all(_adds(one, other) for other in found)]
        return [replace(one, fit=_gripping(one.fit, _FINEST)) for one in kept]

    def fact(self, best: Hypothesis, similarity: Similarity) -> Fact:
        """The friction in drive and in back-drive, and the part of the travel in which the load drives."""
        fit = best.fit
        rubbing = _rubbing(fit.problem)
        figures: dict[str, object] = {}
        inexact = _inexact(fit)
        for mean, difference in _OF_MEAN.items():
            names = (f"{rubbing.name}.{mean}", f"{DirectedFriction.name}.{difference}")
            if not set(names) <= set(fit.problem.names):
                continue
            places = [fit.problem.names.index(name) for name in names]
            covariance = (1.0 + max(fit.excess, 0.0)) * fit.stated_covariance[np.ix_(places, places)]
            unit = next(info.unit for info in DirectedFriction.parameters() if info.name == difference)
            sizes = {}
            for quadrant, sign in (("drive", 0.5), ("back_drive", -0.5)):
                slope = np.array([1.0, sign])
                value = slope @ fit.point.common[places]
                std = hypot(sqrt(float(slope @ covariance @ slope)), inexact[difference])
                sizes[quadrant] = {
                    "value": similarity.own(float(value), unit),
                    "std": similarity.own(std, unit),
                }
            figures[difference] = sizes
        shown = [name for name in _OF_MEAN.values() if _shown(fit, name)]
        beside = [name for name in best.names if name not in (DirectedFriction.name, rubbing.name)]
        figures |= {"differs": shown, "back_driven": _back_driven(fit), "beside": beside}
        return as_stated(_words(figures), "friction by direction", figures, remedy=_REMEDY)


_REMEDY = (
    "Raise and lower a known weight slowly: the motor's moment is greater than the weight's by the friction in "
    "drive, and smaller by the friction in back-drive"
)


def _words(found: Mapping[str, Any]) -> str:
    """Friction that differs between drive and back-drive, with both sizes and the motion that shows it."""
    beside = f" beside {plain(*found['beside'])}" if found["beside"] else ""
    drive, back = (_sizes(found, quadrant) for quadrant in ("drive", "back_drive"))
    alike = "" if "share" in found["differs"] else " A dead zone of the actuator would look alike."
    return (
        "Friction that differs between drive (the motor drives the load) and back-drive (the load drives the "
        f"motor) would explain the gap{beside}; it is not in the vocabulary. It is {drive} in drive, and {back} in "
        f"back-drive, which is {percent(found['back_driven'])} of the travel.{alike}"
    )


def _sizes(found: Mapping[str, Any], quadrant: str) -> str:
    one = found["moment"][quadrant]
    moment = f"{with_std(one['value'], one['std'])} N m"
    if "share" not in found:
        return moment
    share = found["share"][quadrant]
    return f"{moment} and {with_std(100.0 * share['value'], 100.0 * share['std'])} % of the moment carried"


def _inexact(fitted: Fit) -> dict[str, float]:
    """Standard errors by the numerics, by difference: of a contact that deflects."""
    problem, rubbing = fitted.problem, _rubbing(fitted.problem).name
    values = dict(zip(problem.names, fitted.point.common.tolist(), strict=True))
    if f"{rubbing}.presliding" not in values:
        return dict.fromkeys(_OF_MEAN.values(), 0.0)
    stated = [
        problem.stated(fitted.point.common, own, run)
        for own, run in zip(fitted.point.per_run, problem.data.runs, strict=True)
    ]
    load = sqrt(float(np.mean([np.mean(run.drive.at(run.drive.time_s) ** 2) for run in stated if run.drive])))
    usual = values[f"{rubbing}.friction_moment"] + values.get(f"{rubbing}.load", 0.0) * load
    return {"moment": DIRECTED_EXACT * usual, "share": DIRECTED_EXACT * usual / load}


def _rubbing(problem: Problem) -> type[Effect]:
    """The friction of a set."""
    return next(kind for kind in problem.effects if issubclass(kind, Friction))


def _rubs(problem: Problem) -> bool:
    """Whether a set has dry friction, and no rod, whose ends turn apart."""
    return any(issubclass(kind, Friction) for kind in problem.effects) and not problem.resolve_rod_mode


def _stands(fitted: Fit, least: Fit) -> bool:
    """Whether a fit leaves little of what every set of effects leaves, and a difference is not by chance."""
    left = max(fitted.total - fitted.count, 0.0)
    return (
        any(_shown(fitted, name) for name in _OF_MEAN.values())
        and explains_more(fitted, least.total)
        and left <= DIRECTED_LEAVES * max(least.total - least.count, 0.0)
    )


def _shown(fitted: Fit, difference: str) -> bool:
    """Whether a difference is within its bounds and not by chance."""
    name = f"{DirectedFriction.name}.{difference}"
    if name not in fitted.problem.names or fitted.bound(name):
        return False
    std = sqrt(1.0 + max(fitted.excess, 0.0)) * fitted.std(name)
    return abs(fitted.value(name)) > DIRECTED_SHOWN * std > 0.0


def _adds(one: Hypothesis, other: Hypothesis) -> bool:
    """Whether a set leaves much less than one of fewer effects."""
    fewer = len(other.names) < len(one.names)
    return not fewer or one.fit.total - one.fit.count < DIRECTED_LEAVES * (other.fit.total - other.fit.count)


def _beside(base: Hypothesis) -> Hypothesis | None:
    """The best fit of the differences with the effects of a set; None where it is no better than the set."""
    problem, rubbing = base.fit.problem, _rubbing(base.fit.problem)
    presliding, load = (f"{rubbing.name}.{name}" for name in ("presliding", "load"))
    own = [name for name in problem.free_forms if name.split(".")[0] != rubbing.name]
    forms, fixed = [*own, load], problem.fixed
    if not _hangs(problem):
        forms, fixed = own, (*fixed, (f"{DirectedFriction.name}.share", 0.0))
    effects = (*problem.effects, DirectedFriction.along(dict(_courses(base.fit))))
    starts = {f"{kind.name}.{info.name}": info.form_start for kind in effects for info in kind.parameters()}
    starts |= dict.fromkeys((f"{DirectedFriction.name}.{name}" for name in _OF_MEAN.values()), 0.0)
    starts |= dict(zip(problem.names, base.fit.point.common.tolist(), strict=True))
    best = base.fit
    for more in ((), (presliding,)):
        tried = replace(problem, effects=effects, free_forms=(*forms, *more), fixed=fixed)
        start = Point(np.array([starts[name] for name in tried.names]), base.fit.point.per_run)
        found = try_fit(tried, start)
        if found is not None and (found := _gripping(found)).total < best.total:
            best = found
    return None if best is base.fit else Hypothesis((*base.effects, DirectedFriction.name), best)


def _alone(found: Hypothesis) -> Iterator[Hypothesis]:
    """The friction without the other effects of a set, from the fit with them."""
    names = (_rubbing(found.fit.problem).name, DirectedFriction.name)
    if len(found.effects) > len(names):
        start = restricted(found.fit, names)
        fitted = try_fit(start.problem, start.point)
        if fitted is not None:
            yield Hypothesis(names, _gripping(fitted))


def _gripping(fitted: Fit, fine: int = _FINE) -> Fit:
    """The fit with the deflections of the contact along its motion, which change the motion.

    Args:
        fine: number of points between two samples of the input.
    """
    name = f"{_rubbing(fitted.problem).name}.presliding"
    for _ in range(DIRECTED_GRIPS if name in fitted.problem.free_forms else 0):
        problem = fitted.problem
        courses = dict(_courses(fitted, fitted.value(name), fine))
        again = try_fit(
            replace(problem, effects=(*problem.effects[:-1], DirectedFriction.along(courses))), fitted.point
        )
        if again is None:
            break
        fitted, before = again, fitted
        # χ² need not fall, because the contact changes
        if abs(fitted.total - before.total) < _SETTLED * before.total:
            break
    return fitted


def _hangs(problem: Problem) -> bool:
    """Whether gravity loads the joint: else the load is the motor's own moment."""
    terms = {*problem.data.model.law_parameters, *(t for kind in problem.effects for t in kind.law_terms)}
    return any(stiffness in terms for stiffness, _ in WEIGHTS)


def _courses(fitted: Fit, presliding: float = 0.0, fine: int = _FINE) -> Iterator[tuple[bytes, Course]]:
    """The measured angles of the driven runs, between the samples by straight lines, by the samples of the input.

    Args:
        presliding: range in which the contact deflects, rad, along the fitted motion; 0: it slides at once.
        fine: number of points between two samples of the input.
    """
    for place, run in enumerate(fitted.problem.data.runs):
        drive = fitted.problem.stated(fitted.point.common, fitted.point.per_run[place], run).drive
        if drive is not None:
            steps = np.diff(drive.time_s)
            interval = (float(np.median(steps)) if steps.size else run.interval) / fine
            times = interval * (np.arange(2 + round(run.duration / interval)) - 0.5)
            angle = np.interp(times, run.times, run.reading - fitted.zero(place))
            grip = np.ones_like(angle)
            if presliding:
                motion = run.reading - run.unscaled(fitted.residuals[place])
                grip = _grip(CubicSpline(run.times, motion)(times), presliding)
            yield drive.values.tobytes(), Course(interval, angle, grip)


def _grip(angle: Array, presliding: float) -> Array:
    """Dahl's deflection along a motion, as `Course.grip`."""
    ways = np.diff(angle, prepend=angle[0])
    deflection, found = 0.0, []
    for way, kept in zip(ways.tolist(), np.exp(-np.abs(ways) / presliding).tolist(), strict=True):
        side = copysign(1.0, way)
        deflection = deflection * kept + side * (1.0 - kept)
        found.append(side * deflection)
    return np.array(found)


def _back_driven(fitted: Fit) -> float:
    """The part of the travel in which the load drives the motor."""
    back = whole = 0.0
    courses = dict(_courses(fitted))
    for place, run in enumerate(fitted.problem.data.runs):
        drive = fitted.problem.stated(fitted.point.common, fitted.point.per_run[place], run).drive
        if drive is not None:
            course = courses[drive.values.tobytes()]
            ways, moment = np.diff(course.angle[::_FINE]), drive.at(course.times[::_FINE])[:-1]
            whole += float(np.abs(ways).sum())
            back += float(np.abs(ways[ways * moment < 0.0]).sum())
    return back / whole if whole else 0.0
