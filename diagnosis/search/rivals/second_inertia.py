"""A cause from outside the vocabulary: a second inertia behind a spring, between the motor of a joint and its link.

The motor turns one inertia, which turns the other through a spring. The angle at the motor has an
antiresonance, at which only the link swings on the spring, and above it a resonance; their ratio gives the
ratio of the inertias. The angle at the link has only the resonance, at which its phase falls by half a turn.
The moments of the mechanism, such as friction, act at the end with the sensor.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, pi, sqrt
from typing import Any, ClassVar, Final, Self

import numpy as np

from diagnosis.likelihood.least_squares import Fit, scaled_residuals, try_fit
from diagnosis.likelihood.part_of_fit import restricted
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import project_out
from diagnosis.model.fact import Fact, as_stated
from diagnosis.model.parameters import Point
from diagnosis.model.run_data import RunData
from diagnosis.model.similarity import Similarity
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.rivals.rival import Rival, explains_all, explains_more
from identification.show.numbers import for_people, plain
from tunnel_sim.effects import Effect
from tunnel_sim.effects.base import Drawn
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import RodTwist, SettingsTable
from tunnel_sim.vocabulary.record import Array

SECOND_INERTIA_BESIDE: Final = 2
"""Number of sets of effects combined with a second inertia, beside the nominal model. Judgement. Time
against coverage."""
PARTNER_LEAVES: Final = 0.5
"""Maximum χ² with an effect over χ² of a second inertia alone, for the effect to be stated with it. Judgement.
The law has the damping at one end only, and an effect may compensate for that."""
RESONANCE_DRIVEN: Final = 0.05
"""Minimum amplitude of the input near a resonance, over its greatest, for the resonance to be stated.
Judgement. Beyond the input's band a delay or a filter looks like a distant resonance."""

_FRACTION = 0.08  # relative step from one tried frequency to the next
_CYCLES = 4.0  # cycles of the lowest tried frequency in the shortest run
_HIGHEST = 0.6  # highest tried frequency, as a share of the Nyquist frequency
_SHARP = 0.03  # damping ratio of the tried resonances
_STARTS = 3  # number of resonances of the scan at which fits start
_FIRST = 6  # number of iterations after which only the best fit continues
_BAND = 0.1  # share of a resonance's frequency, on either side
_LEAST_RATIO = 0.1  # ratio of the inertias, or its inverse, at a start
_EVEN = 1.0  # ratio of inertias where the reading does not show it
_MOST_DAMPED = 0.2  # maximum damping ratio of a resonance; with more it is a filter or a lag


@dataclass(frozen=True)
class SecondInertia(Effect):
    """A joint of two inertias, with a spring and a damper between them."""

    channel = "stiffness"
    condition = "always"
    autonomous = False
    driven = True
    by_angle_in_room = True

    #: Whether the motor turns the inertia that carries the sensor; else it turns the other one.
    at_motor: ClassVar[bool]

    resonance: float = parameter(
        "ω", "rad/s", "angular frequency of the resonance with both inertias free", scale=30.0, lower=0.0,
        upper=1e4, fit_lower=0.1,
    )  # fmt: skip
    damping_ratio: float = parameter(
        "ζ", "1", "share of critical damping", scale=0.01, lower=0.0, upper=0.9, fit_lower=1e-4,
        fit_upper=_MOST_DAMPED, default=0.01,
    )  # fmt: skip

    @property
    def behind(self) -> float:
        """The inertia at the other end of the spring over the inertia that carries the sensor."""
        return _EVEN

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Let the spring twist; if the motor is at the sensor, its input acts at that end."""
        del stated, drawn
        inertias = runs["yaw_inertia"].tolist()
        for place, (effect, inertia) in enumerate(zip(effects, inertias, strict=True)):
            if not effect.is_null:
                share = 1.0 / (1.0 + effect.behind)
                stiffness = effect.resonance**2 * inertia * share * (1.0 - share)
                runs.rod_twist[place] = RodTwist(1.0 / stiffness, share, effect.damping_ratio)
        runs.change_inputs(effects, cls._turning)

    def _turning(self, drive: InputMoment) -> InputMoment:
        return replace(drive, at_sensor=self.at_motor and not self.is_null)


@dataclass(frozen=True)
class LinkBehindSpring(SecondInertia):
    """The sensor is at the motor."""

    name = "link_behind_spring"
    at_motor = True

    ratio: float = parameter(
        "Jl/Jm", "1", "inertia of the link over the motor's", scale=0.1, lower=0.0, upper=1e3,
        fit_lower=0.01, fit_upper=100.0, default=_EVEN,
    )  # fmt: skip

    @property
    def behind(self) -> float:
        """The ratio, as fitted."""
        return self.ratio


@dataclass(frozen=True)
class MotorBehindSpring(SecondInertia):
    """The sensor is at the link; the reading hardly shows the ratio of the inertias."""

    name = "motor_behind_spring"
    at_motor = False


KINDS: tuple[type[SecondInertia], ...] = (LinkBehindSpring, MotorBehindSpring)


class TwoInertias(Rival):
    """A second inertia of a driven joint, beside effects that depend on its angle and rate alone."""

    def hypotheses(
        self, likely: Sequence[Hypothesis], known: Sequence[Hypothesis], nominal: Fit
    ) -> list[Hypothesis]:
        """The joint of two inertias, read at the motor and at the link.

        None where a set of effects explains the readings as well, or down to the noise: the set has a name.
        """
        del likely
        inputs = nominal.problem.data.inputs
        if not inputs or not all(drive.kind.by_actuator for drive in inputs):
            return []
        fits = [*(one.fit for one in known), nominal]
        least = min(fits, key=lambda fit: fit.total)
        if explains_all(least):
            return []
        sets = sorted((one for one in known if _bearable(one.fit.problem)), key=lambda one: one.fit.total)
        bases = [Hypothesis((), nominal), *(one for one in sets if one.effects)][: 1 + SECOND_INERTIA_BESIDE]
        tried = [one for base in bases for one in _beside(base)]
        better = [one for one in tried if explains_more(one.fit, least.total)]
        return [one for one in better if all(_adds(one, other) for other in better)]

    def fact(self, best: Hypothesis, similarity: Similarity) -> Fact | None:
        """The frequencies and the ratio of the inertias; None where the input hardly excites the resonance."""
        kind, fit = next(kind for kind in KINDS if kind.name in best.effects), best.fit
        names = [f"{kind.name}.{info.name}" for info in kind.parameters()]
        omega, ends = fit.value(names[0]), [fit.bound(name) for name in names[2:]]
        if any(ends) or fit.bound(names[1]) == "upper" or not _is_driven(fit.problem, omega):
            return None
        places = [fit.problem.names.index(name) for name in names]
        covariance = (1.0 + max(fit.excess, 0.0)) * fit.stated_covariance[np.ix_(places, places)]
        ratio = fit.value(names[-1]) if kind.at_motor else _EVEN
        # the unexplained share of the twist's amplitude may shift a resonance by the same share of its
        # half-width
        left = sqrt(max(fit.excess, 0.0) * fit.count / _power(fit, best.names, kind)) * fit.value(names[1])
        shift = hypot(left, _by_damping(fit, omega, ratio))

        def hertz(turn: float, slope: Array) -> dict[str, float]:
            std = hypot(sqrt(float(slope @ covariance @ slope)), shift * turn)
            return {
                "frequency_hz": similarity.own(turn / (2.0 * pi), "Hz"),
                "std_hz": similarity.own(std / (2.0 * pi), "Hz"),
            }

        figures: dict[str, object] = {
            "resonance": hertz(omega, np.eye(len(names))[0]),
            "beside": [name for name in best.names if name != kind.name],
        }
        if kind.at_motor:
            std = hypot(sqrt(float(covariance[-1, -1])), 2.0 * (1.0 + ratio) * shift)
            below = 1.0 / sqrt(1.0 + ratio)
            slope = np.array([below, 0.0, -0.5 * omega * below**3])
            figures |= {"antiresonance": hertz(omega * below, slope), "ratio": {"value": ratio, "std": std}}
        remedy = (
            "Lock the link, or measure its angle, too"
            if kind.at_motor
            else "Measure the angle at the motor, too"
        )
        return as_stated(_words(figures), "second inertia", figures, remedy=remedy)


def _words(found: Mapping[str, Any]) -> str:
    """A second inertia that would explain the gap, the frequencies that show it, and where the sensor is."""
    beside = f" beside {plain(*found['beside'])}" if found["beside"] else ""
    first = (
        "A second inertia behind a spring, between motor and link, would explain the gap"
        f"{beside}; it is not in the vocabulary. From moment to angle there is "
    )
    resonance = f"a resonance at {_hertz(found['resonance'])}"
    if "ratio" not in found:
        return (
            f"{first}{resonance} without an antiresonance: the angle is measured at the link. A resonance of the "
            "actuator or the sensor would look alike."
        )
    ratio = for_people(found["ratio"]["value"], found["ratio"]["std"], "1")
    return (
        f"{first}an antiresonance at {_hertz(found['antiresonance'])} and {resonance}: the angle is measured at "
        f"the motor, and the link's inertia is {ratio} times the motor's."
    )


def _hertz(found: Mapping[str, float]) -> str:
    return for_people(found["frequency_hz"], found["std_hz"], "Hz")


def _bearable(problem: Problem) -> bool:
    """Whether the engine can integrate the effects of a set together with a second inertia."""
    return all(kind.autonomous and not kind.on_spring for kind in problem.effects) and not problem.free_forms


def _adds(one: Hypothesis, other: Hypothesis) -> bool:
    """Whether a set has a justified effect more than another: its residual is much smaller, and not by chance."""
    larger = set(one.effects) > set(other.effects)
    much = one.fit.total < PARTNER_LEAVES * other.fit.total
    return not larger or (much and explains_more(one.fit, other.fit.total))


def _beside(base: Hypothesis) -> Iterator[Hypothesis]:
    """The best fits of a second inertia with the effects of a set, read at either end, where they are better."""
    resonances = _resonances(base.fit)
    for kind in KINDS:
        problem = replace(base.fit.problem, effects=(*base.fit.problem.effects, kind))
        starts = (_start(base.fit, kind, *one) for one in resonances)
        tried = (try_fit(problem, start, max_iterations=_FIRST) for start in starts)
        best = min(filter(None, tried), key=lambda fitted: fitted.total, default=None)
        if best is not None and best.total < base.fit.total:
            yield Hypothesis((*base.effects, kind.name), try_fit(problem, best.point) or best)


def _resonances(base: Fit) -> list[tuple[float, float]]:
    """The resonances that explain most of the residual if added to the motion of one inertia.

    Returns:
        Angular frequencies, rad/s, and for each the coefficient A of the moment M, rad/(N m): q is added to the
        angle, q̈ + 2 ζ ω q̇ + ω² q = A ω² M.
    """
    runs, drops = base.problem.data.runs, list[tuple[float, float, float]]()
    moments = [
        base.problem.stated(base.point.common, own, run).drive
        for own, run in zip(base.point.per_run, runs, strict=True)
    ]
    lowest = 2.0 * pi * _CYCLES / min(run.duration for run in runs)
    highest = _HIGHEST * pi / max(run.interval for run in runs)
    tried = np.exp(np.arange(np.log(lowest), np.log(highest), _FRACTION)).tolist()
    for omega in (one for one in tried if _is_driven(base.problem, one)):
        column = [
            np.zeros(run.reading.size)
            if moment is None
            else run.scaled(moment.oscillation(omega, _SHARP, run.times, run.derivative))
            for run, moment in zip(runs, moments, strict=True)
        ]
        added = project_out(base, column)
        power = sum(float(one @ one) for one in added)
        size = sum(float(a @ r) for a, r in zip(added, base.residuals, strict=True)) / max(power, 1e-300)
        drops.append((size**2 * power, omega, size))
    padded = [(0.0, 0.0, 0.0), *drops, (0.0, 0.0, 0.0)]
    tops = [
        here
        for before, here, after in zip(padded[:-2], drops, padded[2:], strict=True)
        if here[0] > max(before[0], after[0])
    ]
    return [(omega, size) for _, omega, size in sorted(tops, reverse=True)[:_STARTS]]


def _start(base: Fit, kind: type[SecondInertia], omega: float, size: float) -> Point:
    """Start of a fit: at the motor A ω² J is the ratio of the inertias, at the link −1."""
    ratio = size * omega**2 * float(np.median(base.linear[:, 0]))
    within = float(np.clip(ratio, _LEAST_RATIO, 1.0 / _LEAST_RATIO))
    start = {"resonance": omega, "damping_ratio": _SHARP, "ratio": within}
    own = [start[info.name] for info in kind.parameters()]
    return Point(np.concatenate([base.point.common, own]), base.point.per_run)


def _by_damping(fitted: Fit, omega: float, ratio: float) -> float:
    """The shift of a resonance, as a share, if the damping of the mechanism acts on the other inertia.

    The law has the damping at the sensor's end. In a resonance with damping ratio C/(2 J ω), where J is the
    reduced inertia, moving the damping changes the frequency by half the ratio's square at most.
    """
    inertia, damping, _ = np.median(fitted.linear, axis=0).tolist()
    reduced = inertia * ratio / (1.0 + ratio) ** 2
    return 0.5 * float(damping / (2.0 * reduced * omega)) ** 2


def _power(fitted: Fit, names: Sequence[str], kind: type[SecondInertia]) -> float:
    """Sum of squares of the second inertia's part of the readings, in noise variances."""
    rigid = restricted(fitted, [name for name in names if name != kind.name])
    without = scaled_residuals(rigid.problem, rigid.point)
    return sum(float(np.sum((a - b) ** 2)) for a, b in zip(without, fitted.residuals, strict=True))


def _is_driven(problem: Problem, omega: float) -> bool:
    """Whether the input of a run excites an oscillation (rad/s): its lines there are not small."""
    return any(run.drive is not None and _part_at(run, omega) > RESONANCE_DRIVEN for run in problem.data.runs)


def _part_at(run: RunData, omega: float) -> float:
    """The greatest amplitude of the input about a frequency (rad/s), over its greatest amplitude."""
    values = run.input_means - np.mean(run.input_means)
    size = np.abs(np.fft.rfft(values * np.hanning(values.size)))
    turn = 2.0 * pi * np.fft.rfftfreq(values.size, run.interval)
    near = size[np.abs(turn / omega - 1.0) < _BAND]
    return float(near.max(initial=0.0) / size.max())
