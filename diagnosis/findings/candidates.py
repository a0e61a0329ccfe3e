"""The answers with their probabilities and parameters, and the effect of each cause on a swing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from diagnosis.answer.held_out import Base
from diagnosis.answer.linear_theory import move_of_halves, parameter_shift
from diagnosis.findings.closing import Closing
from diagnosis.findings.units import own_parameters
from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import linear_coefficients, resonance
from diagnosis.model.parameters import Point
from diagnosis.search.prepared import COARSE_STEP, HUM
from diagnosis.search.random_spectra import LONGEST_BANDWIDTH
from diagnosis.search.study import Answer, Study
from diagnosis.search.weigh import UNKNOWN
from diagnosis.settings import GapSettings
from identification.show.numbers import significant, unit_shown
from identification.show.quantity import Quantity
from identification.signal.decay_fit import Reading, fit_run
from identification.signal.free_decay import Decay
from tunnel_sim.effects import BetweenRuns, known_effects
from tunnel_sim.effects.capabilities import Friction
from tunnel_sim.effects.parameters import ParameterInfo
from tunnel_sim.files.from_json import from_json_fields
from tunnel_sim.vocabulary.record import Array

UNDETERMINED_FROM: Final = 10.0
"""Ratio of the standard deviation to the value and the typical size of a parameter above which it is not
determined. Judgement. Even its order of magnitude is then unknown."""


@dataclass(frozen=True)
class Candidate:
    """An answer that was considered.

    Args:
        effect: name, ``none`` or ``unknown``; several names are joined by a plus sign.
        probability: that it is the answer, a fraction.
        excess_after: with it added, in the fitted runs, in units of the noise variance. Each instant and phase
            of a single run counts as 10 of χ².
        closed: share of the gap that it closes there.
        parameters: its fitted parameters by name (``effect.parameter`` where it has several effects).
    """

    effect: str
    probability: float
    excess_after: float
    closed: float
    parameters: Mapping[str, Quantity] = field(default_factory=dict)


_VISIBLE = 0.005  # least change of a damping ratio that is stated
_VISIBLE_FREQUENCY = 5e-5  # least relative change of a frequency that is stated


@dataclass(frozen=True)
class CauseSize:
    """Effect of a cause on three cycles of a swing, by the fitted model with it and without it.

    Args:
        run: id of the run whose conditions are taken.
        amplitude: of the release, rad.
        damping_ratio: with the cause, dimensionless.
        damping_ratio_without: with every cause but this one, dimensionless.
        frequency_change: of the natural frequency by the cause, a fraction.
        zero_change: of the middle of the swing by the cause, in the unit of the readings.
        reading_change: root mean square of the change of the reading, in its unit.
        stands: angle from rest within which the cause stops the body for good, rad; 0 where it does not.
    """

    effect: str
    run: str
    amplitude: float
    damping_ratio: float
    damping_ratio_without: float
    frequency_change: float
    zero_change: float
    reading_change: float
    stands: float = 0.0

    def to_json_dict(self) -> dict[str, Any]:
        """The fields, with the units of angles in their names."""
        found = dict(vars(self))
        return found | {"amplitude_rad": found.pop("amplitude"), "stands_rad": found.pop("stands")}

    def words(self, unit: str) -> str:
        """The effect in a sentence; damping and frequency where they change visibly.

        Args:
            unit: of the readings.

        Returns:
            Empty where the simulated run does not show it.
        """
        (mark, factor), angle = unit_shown(unit), unit_shown("rad")[1]
        mark = mark if mark == "°" else f" {mark}"
        changes = []
        zeta, without = self.damping_ratio, self.damping_ratio_without
        if abs(zeta - without) > _VISIBLE * max(abs(zeta), abs(without)):
            changes.append(f"damping ratio {significant(without, 3)} becomes {significant(zeta, 3)}")
        if abs(self.frequency_change) > _VISIBLE_FREQUENCY:
            change = 100.0 * self.frequency_change
            changes.append(f"frequency {'+' if change > 0.0 else ''}{significant(change, 2)} %")
        reading = factor * self.reading_change
        if abs(self.zero_change) > 0.5 * self.reading_change:
            changes.append(f"the middle moves by {significant(factor * self.zero_change, 2)}{mark}")
        if not changes and not reading:
            return ""
        changes.append(f"the reading changes by {significant(reading, 2)}{mark} root mean square")
        held = angle * self.stands
        stands = f"; it stops the body up to {significant(held, 2)}° from rest" if held > 0.0 else ""
        amplitude = significant(angle * self.amplitude, 2)
        return f"Over three cycles from {amplitude}°: {', '.join(changes)}{stands}"

    @from_json_fields
    @staticmethod
    def _fields(data: Mapping[str, Any]) -> Mapping[str, Any]:
        """The fields, without units in their names."""
        return {**data, "amplitude": data["amplitude_rad"], "stands": data["stands_rad"]}


def meant_parameter(found: Quantity, info: ParameterInfo, swing: float, undetermined: float) -> Quantity:
    """A fitted parameter, its standard deviation omitted where it is meaningless.

    Args:
        swing: largest angle of the motion, rad.
        undetermined: standard deviation over value and usual size from which it is meaningless, a ratio.

    Returns:
        The estimate; not determined where its standard deviation exceeds that of a uniform distribution over the
        allowed range, or that multiple of the parameter's value and usual size.
    """
    lower, upper = info.fit_range(swing)
    uniform = (upper - lower) / math.sqrt(12.0)
    size = undetermined * max(abs(found.value), info.scale)
    return _limited(found, min(uniform, size))


def meant_coefficient(estimate: Quantity, fit: Fit, name: str) -> Quantity:
    """A coefficient, its standard deviation omitted where it is meaningless.

    Args:
        name: ``cn_beta``, ``cn_r``, ``omega_n``, ``zeta`` or a parameter of a joint's law.

    Returns:
        The estimate; not determined where its standard deviation exceeds ωn itself, a damping ratio of 1, or the
        coefficient whose moment is that of the stiffness or of the critical damping in the fastest wind.
    """
    if name == "omega_n":
        return _limited(estimate, abs(estimate.value))
    if name == "zeta":
        return _limited(estimate, 1.0)
    if not name.startswith("cn_"):
        return estimate
    data, greatest = fit.problem.data, math.inf
    for index, run in enumerate(data.runs):
        if pressure := data.air_moment(run):
            inertia, _, stiffness = linear_coefficients(fit, index)
            if name == "cn_beta":
                own = abs(stiffness) / pressure
            else:
                critical = 2.0 * math.sqrt(inertia * abs(stiffness))
                own = critical * run.wind_speed / (pressure * data.reference_length)
            greatest = min(greatest, own)
    return _limited(estimate, greatest)


def _limited(found: Quantity, greatest: float) -> Quantity:
    if found.std is None or 0.0 < found.std <= greatest:  # 0: the readings do not depend on it
        return found
    return replace(found, std=None, determined=False)


_AT_LIMIT = 0.999  # of the greatest bandwidth: a search that ends above it is at the bound


def candidates(study: Study, base: Base, errors: Mapping[str, float] = {}) -> tuple[Candidate, ...]:
    """The answers, with their residual gap in the fitted runs by the fits' own integrator.

    Args:
        errors: standard deviations of the answer's parameters beside those of the noise, by ``effect.parameter``,
            in their units.

    Returns:
        Answers, ``none`` and ``unknown`` among them: the answer first, then the most probable ones. Their
        probabilities sum to 1.
    """
    block, rate = study.nominal.problem.data.mean_block, study.settings.gap.detection_rate
    excess = study.nominal.excess / block
    if not study.causes:
        return (
            Candidate("none", 1.0 - rate, excess, 0.0),
            Candidate("unknown", rate, excess, 0.0),
        )
    answers = []
    before = max(study.nominal.excess, 1e-9)
    for answer in study.answers:
        if answer.effects == UNKNOWN:
            answers.append(Candidate("unknown", answer.probability, before / block, 0.0))
            continue
        name = " + ".join(sorted({*study.named_beside(answer), *answer.effects} or _scatter(study)))
        left, closed = answer.share * before / block, max(0.0, 1.0 - answer.share)
        answers.append(Candidate(name, answer.probability, left, closed, _parameters(study, answer, errors)))
    if not study.answers:
        whole = excess + base.hum + base.extra
        closed = float(np.clip(1.0 - max(excess, 0.0) / max(whole, 1e-9), 0.0, 1.0))
        name = " + ".join(study.read_off)
        even = study.settings.weighing.even_share
        answers.append(Candidate(name, 1.0 - even, excess, closed, _parameters(study)))
        answers.append(Candidate("unknown", even, whole, 0.0))
    none = 0.0 if study.beside else min(study.gap.test.p_value, rate)
    answers.append(Candidate("none", none, before / block, 0.0))
    total = sum(candidate.probability for candidate in answers)
    first, *others = (replace(c, probability=c.probability / total) for c in answers)
    return (first, *sorted(others, key=lambda c: -c.probability))


def _scatter(study: Study) -> set[str]:
    """The chance differences that the runs may have: all that an answer without effects explains a gap by."""
    data = study.nominal.problem.data
    return {kind.name for kind in known_effects() if issubclass(kind, BetweenRuns) and data.may_show(kind)}


def inclusion(answers: Sequence[Candidate], read_off: Sequence[str], chosen: GapSettings) -> dict[str, float]:
    """Probability of every effect of the vocabulary to be among the causes.

    Returns:
        The sum of the probabilities of the answers that name the effect; for a cause detected in the records, 1
        minus the rate at which a campaign without a gap is said to have one.
    """
    found = {
        kind.name: min(sum(c.probability for c in answers if kind.name in c.effect.split(" + ")), 1.0)
        for kind in known_effects()
    }
    return found | dict.fromkeys(read_off, 1.0 - chosen.detection_rate)


def _parameters(
    study: Study, answer: Answer | None = None, errors: Mapping[str, float] = {}
) -> dict[str, Quantity]:
    """Parameters of the causes detected in the records, and of an answer; unprefixed for a single effect.

    Args:
        errors: as in `candidates`.
    """
    estimates: dict[str, Quantity] = {}
    prepared, hum = study.prepared, study.prepared.hum
    if hum is not None:
        amplitude, frequency = (f"{HUM.name}.{info.name}" for info in HUM.parameters())
        estimates[amplitude] = Quantity(hum.amplitude, hum.std, "rad")
        estimates[frequency] = Quantity(hum.frequency, hum.frequency_std, "Hz")
    if prepared.coarse:
        step = f"{COARSE_STEP.name}.{COARSE_STEP.parameters()[0].name}"
        estimates[step] = Quantity(prepared.step, None, "rad")
    random = None if answer is None else answer.random
    stated = None if answer is None else answer.stated
    hypothesis = stated if random is None else random.beside
    if hypothesis is not None:
        fit, problem = hypothesis.fit, hypothesis.fit.problem
        infos = {f"{kind.name}.{info.name}": info for kind in problem.effects for info in kind.parameters()}
        inflate = float(np.sqrt(1.0 + max(fit.excess, 0.0)))
        for name in problem.effect_names:
            bound = fit.bound(name)
            further = errors.get(name, 0.0) if fit is study.chosen else 0.0
            std = None if bound else math.hypot(fit.std(name) * inflate, further)
            given = Quantity(fit.value(name), std, infos[name].unit, bound=bound)
            estimates[name] = meant_parameter(given, infos[name], problem.data.swing, UNDETERMINED_FROM)
        for one in problem.scatter:
            if one.shown:
                spread = one.kind.parameters()[0]
                estimates[f"{one.name}.{spread.name}"] = Quantity(one.width, None, spread.unit)
        for name, value in problem.fixed:
            estimates[name] = Quantity(value, 0.0, infos[name].unit)
    if random is not None:
        seconds = random.process.interval * sum(i.size for i in random.process.innovations)
        data = study.nominal.problem.data
        for kind in random.kinds:
            parts = [one for one in random.process.spectrum if one.is_of(kind)]
            part = max(parts, key=lambda one: one.intensity)
            intensity = float(np.sqrt(sum(one.intensity**2 for one in parts)))
            severity, place = (f"{kind.name}.{info.name}" for info in kind.parameters())
            # their spread follows from the number of correlation times in the runs
            independent = max(seconds * min(4.0 * part.bandwidth, 1.0 / random.process.interval), 2.0)
            relative = float(np.sqrt(0.5 / independent))
            if part.strouhal_number > 0.0:
                size = float(np.sqrt(2.0)) * intensity
                speeds = [run.wind_speed for run in data.in_wind]
                reduced = float(np.sqrt(np.mean(np.square(speeds)))) / data.width  # Hz
                estimates[severity] = Quantity(size, size * relative, "1")
                estimates[place] = Quantity(part.strouhal_number, part.bandwidth / reduced * relative, "1")
            else:
                # a corner above the rig's frequencies looks white: only size over square root is known there
                limit = "upper" if part.bandwidth >= _AT_LIMIT * LONGEST_BANDWIDTH else None
                estimates[severity] = Quantity(intensity, intensity * relative, kind.parameters()[0].unit)
                estimates[place] = Quantity(part.bandwidth, None, "Hz", bound=limit)
    own = own_parameters(estimates, study.campaign, study.similarity, study.model)
    single = len({name.split(".")[0] for name in own}) == 1
    return {name.split(".")[1] if single else name: value for name, value in own.items()}


_CYCLES = 3.0
_FEWEST = 10  # block means in them
_CLOSE = 1e-12  # tolerance of the fit of a curve without noise
_SHARE = 0.5  # of the largest swing: an amplitude that every run passes through


def cause_sizes(study: Study) -> tuple[CauseSize, ...]:
    """Simulate the fitted model with each cause and without it.

    Returns:
        The size of every fitted cause, in the measured campaign's units. The simulated runs are free decays, so a
        cause has none if it was detected in the records, is random, stops the motion at once, acts on driven runs
        only, or acts on a body without a spring.
    """
    fit, data = study.chosen, study.chosen.problem.data.undriven()
    if not data.model.restored:
        return ()
    problem = replace(fit.problem, data=data)
    reading_unit, amplitude = study.similarity.own(1.0, study.similarity.reading), _SHARE * data.swing
    sizes = []
    for kind, effect in zip(problem.effects, problem.effects_at(fit.point.common), strict=True):
        severity = f"{kind.name}.{kind.parameters()[0].name}"
        if not data.may_show(kind) or severity not in problem.names:
            continue
        acts = np.flatnonzero(data.acts(kind)).tolist()
        release, without = fit.point.per_run.copy(), fit.point.common.copy()
        release[:, :2] = amplitude, 0.0
        without[problem.names.index(severity)] = 0.0
        both = problem.predict([Point(fit.point.common, release), Point(without, release)])
        # only some runs show a cause in one spring or one wind
        shown = [i for i in acts or range(len(data.runs)) if not np.array_equal(both[0][i], both[1][i])]
        if not shown:
            continue
        # the softest spring, on which a moment acts most
        index = min(shown, key=lambda i: data.runs[i].spring_stiffness or 0.0)
        run, frequency = data.runs[index], resonance(fit, index)
        count = min(run.reading.size, round(_CYCLES / (frequency * run.interval)))
        curves = [readings[index][:count] for readings in both]
        decay, decay_without = (_decay(run.interval, curve, frequency) for curve in curves)
        if decay is None or decay_without is None:
            continue
        size = CauseSize(
            effect=kind.name,
            run=run.id,
            amplitude=amplitude,
            damping_ratio=decay[1],
            damping_ratio_without=decay_without[1],
            frequency_change=decay[0] / decay_without[0] - 1.0,
            zero_change=reading_unit * (decay[2] - decay_without[2]),
            reading_change=reading_unit * float(np.sqrt(np.mean((curves[0] - curves[1]) ** 2))),
            stands=effect.stands(linear_coefficients(fit, index)[2]) if isinstance(effect, Friction) else 0.0,
        )
        sizes.append(size)
    return tuple(sizes)


def damping_ratio(fit: Fit) -> float | None:
    """The damping ratio of the fitted motion as a whole over three cycles from half of the largest swing.

    Returns:
        Of the first run; None where its motion there is not a decay.
    """
    data = fit.problem.data
    release = fit.point.per_run.copy()
    release[:, :2] = _SHARE * data.swing, 0.0
    run, frequency = data.runs[0], resonance(fit, 0)
    count = min(run.reading.size, round(_CYCLES / (frequency * run.interval)))
    decay = _decay(
        run.interval, fit.problem.predict([Point(fit.point.common, release)])[0][0][:count], frequency
    )
    return None if decay is None or decay[1] <= 0.0 else decay[1]


def _decay(interval: float, curve: Array, frequency: float) -> tuple[float, float, float] | None:
    """Angular frequency (rad/s), damping ratio and mean of a few cycles; None where they are not a decay."""
    if curve.size < _FEWEST or not np.all(np.isfinite(curve)):
        return None
    reading = Reading(interval * np.arange(curve.size, dtype=np.float64), curve)
    found = fit_run(reading, Decay(0.0, (2.0 * np.pi * frequency) ** 2), tolerance=_CLOSE)
    if not found.runs or found.runs[0].decay.omega_d == 0.0:  # without the cause the body does not swing
        return None
    decay = found.runs[0].decay
    return decay.omega_n, decay.zeta, found.zero


def parameter_errors(study: Study, closes: Closing) -> dict[str, float]:
    """Standard deviations of the parameters of the answer beside those of the noise, by ``effect.parameter``.

    Returns:
        In the parameters' units, those of the similar campaign. They are the change by MuJoCo's integrator, where
        it and that of the fits disagree; and the difference between the halves of the data, which differ by more
        than chance where the form of a cause is not exact (`move_of_halves`).
    """
    fit = study.chosen
    problem = fit.problem
    if not study.named or fit is study.nominal:
        return {}
    stepped = np.zeros(len(problem.names))
    if not closes.confirmation.agrees and not closes.confirmation.failure:
        stepped = parameter_shift(fit, [closes.shifts[run.id] for run in problem.data.runs])
    found = {}
    for place, name in enumerate(problem.names):
        if name in problem.effect_names and fit.bound(name) is None:
            halves = move_of_halves(fit, np.eye(len(problem.names))[place])
            found[name] = math.hypot(float(stepped[place]), halves)
    return found
