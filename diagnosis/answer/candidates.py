"""The answers with their probabilities and parameters, and what each cause does to a swing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from diagnosis.answer.reported import Base
from diagnosis.answer.units import own_parameters
from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.problem import Point
from diagnosis.likelihood.residuals import linear_coefficients, resonance
from diagnosis.policy import EVEN_SHARE, GAP_FALSE_ALARM_RATE, UNDETERMINED_FACTOR
from diagnosis.result import Candidate, CauseSize, ParameterEstimate
from diagnosis.search.investigate import COARSE_STEP, HUM, Study
from diagnosis.search.process_noise import LONGEST_BANDWIDTH
from diagnosis.search.random_moments import RandomAnswer
from diagnosis.search.weigh import UNKNOWN, Weighed
from tunnel_sim.effects import Effect, known_effects
from tunnel_sim.effects.parameters import ParameterInfo
from tunnel_sim.vocabulary.record import Array


def meant_parameter(found: ParameterEstimate, info: ParameterInfo, swing: float) -> ParameterEstimate:
    """A fitted parameter, without its standard deviation where that says nothing.

    Args:
        found: the estimate.
        info: the parameter's usual size and range.
        swing: largest angle of the motion, rad.

    Returns:
        The estimate; not determined where its standard deviation exceeds that of a uniform distribution over the
        range allowed, or ten times the parameter's value and usual size.
    """
    lower, upper = info.fit_range(swing)
    uniform = (upper - lower) / math.sqrt(12.0)
    size = UNDETERMINED_FACTOR * max(abs(found.value), info.scale)
    return _limited(found, min(uniform, size))


def meant_coefficient(found: ParameterEstimate, fit: Fit, name: str) -> ParameterEstimate:
    """A coefficient, without its standard deviation where that says nothing.

    Args:
        found: the estimate.
        fit: that it comes from.
        name: ``cn_beta``, ``cn_r``, ``omega_n``, ``zeta`` or a parameter of a joint's law.

    Returns:
        The estimate; not determined where its standard deviation exceeds ωn itself, a damping ratio of 1, or the
        coefficient whose moment is that of the stiffness or of the critical damping in the fastest wind.
    """
    if name == "omega_n":
        return _limited(found, abs(found.value))
    if name == "zeta":
        return _limited(found, 1.0)
    if not name.startswith("cn_"):
        return found
    return _limited(found, min((_own_moment(fit, i, name) for i in _windy(fit)), default=math.inf))


def _limited(found: ParameterEstimate, greatest: float) -> ParameterEstimate:
    if found.std is None or 0.0 < found.std <= greatest:  # 0: the readings do not depend on it
        return found
    return replace(found, std=None, determined=False)


def _windy(fit: Fit) -> list[int]:
    return [i for i, run in enumerate(fit.problem.data.runs) if run.wind_on]


def _own_moment(fit: Fit, index: int, name: str) -> float:
    """The coefficient whose moment would be that of a run's stiffness, or of its critical damping."""
    data = fit.problem.data
    run = data.runs[index]
    inertia, _, stiffness = linear_coefficients(fit, index)
    pressure = data.air_moment(run)
    if name == "cn_beta":
        return abs(stiffness) / pressure
    return 2.0 * math.sqrt(inertia * abs(stiffness)) * run.wind_speed / (pressure * data.reference_length)


_AT_LIMIT = 0.999  # of the greatest bandwidth: a search that ends above it was stopped by the bound


def candidates(study: Study, base: Base) -> tuple[Candidate, ...]:
    """The answers, with what they leave of the gap in the fitted runs by the fits' own integrator.

    Args:
        base: what an excess is measured against.

    Returns:
        Answers, ``none`` and ``unknown`` among them: the answer, then the most probable ones. Their probabilities
        sum to 1.
    """
    found = []
    if not study.causes:
        return (
            Candidate("none", 1.0 - GAP_FALSE_ALARM_RATE, study.nominal.excess / _block(study), 0.0),
            Candidate("unknown", GAP_FALSE_ALARM_RATE, study.nominal.excess / _block(study), 0.0),
        )
    before = max(study.nominal.excess, 1e-9)
    for answer in study.weighed:
        if answer.effects == UNKNOWN:
            found.append(Candidate("unknown", answer.probability, before / _block(study), 0.0))
            continue
        name = " + ".join(sorted({*study.read_off, *answer.effects}))
        left = answer.share * before / _block(study)
        parameters = {**_read_parameters(study), **_parameters(study, answer)}
        found.append(
            Candidate(name, answer.probability, left, max(0.0, 1.0 - answer.share), _short(parameters))
        )
    if not study.weighed:
        name = " + ".join(study.read_off)
        left = study.nominal.excess / _block(study)
        closed = 1.0 - max(left, 0.0) / max(left + base.hum + base.extra, 1e-9)
        found.append(
            Candidate(
                name,
                1.0 - EVEN_SHARE,
                left,
                float(np.clip(closed, 0.0, 1.0)),
                _short(_read_parameters(study)),
            )
        )
        found.append(Candidate("unknown", EVEN_SHARE, left + base.hum + base.extra, 0.0))
    none = 0.0 if study.read_off else min(study.test.p_value, GAP_FALSE_ALARM_RATE)
    found.append(Candidate("none", none, before / _block(study), 0.0))
    return _normalised(found)


def inclusion(answers: Sequence[Candidate], read_off: Sequence[str]) -> dict[str, float]:
    """For every effect of the vocabulary the probability that it is among the causes.

    Args:
        answers: with their probabilities.
        read_off: causes read off the records before any fit.

    Returns:
        The sum of the probabilities of the answers that name the effect; of a cause read off the records 1 minus
        the rate at which a campaign without a gap is said to have one.
    """
    names = [frozenset(candidate.effect.split(" + ")) for candidate in answers]
    found = {}
    for kind in known_effects():
        named = [c.probability for c, own in zip(answers, names, strict=True) if kind.name in own]
        found[kind.name] = min(sum(named), 1.0)
    return found | dict.fromkeys(read_off, 1.0 - GAP_FALSE_ALARM_RATE)


def _normalised(found: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """The first one first, then the most probable ones, their probabilities summing to 1."""
    total = sum(candidate.probability for candidate in found)
    answer, *others = (replace(c, probability=c.probability / total) for c in found)
    return (answer, *sorted(others, key=lambda c: -c.probability))


def _block(study: Study) -> int:
    """Samples in a block mean: a model's misfit has so many times the excess in block means as in samples."""
    return study.nominal.problem.data.runs[0].block


def _parameters(study: Study, answer: Weighed) -> dict[str, ParameterEstimate]:
    random = study.random_answer(answer.effects)
    hypothesis = study.stated(answer.effects) if random is None else random.beside
    found: dict[str, ParameterEstimate] = {}
    if hypothesis is not None:
        problem = hypothesis.fit.problem
        infos = {f"{kind.name}.{info.name}": info for kind in problem.effects for info in kind.parameters()}
        inflate = float(np.sqrt(1.0 + max(hypothesis.fit.excess, 0.0)))
        for name in problem.effect_names:
            fit = hypothesis.fit
            bound = fit.bound(name)
            std = None if bound else fit.std(name) * inflate
            given = ParameterEstimate(fit.value(name), std, infos[name].unit, bound)
            found[name] = meant_parameter(given, infos[name], problem.data.swing)
        for name, value in problem.fixed:
            found[name] = ParameterEstimate(value, 0.0, infos[name].unit)
    if random is not None:
        found |= _random_parameters(random)
    return own_parameters(found, study.campaign, study.similarity)


def _random_parameters(answer: RandomAnswer) -> dict[str, ParameterEstimate]:
    """Parameters of a random moment; their spread follows from the number of correlation times in the runs."""
    process, spectrum = answer.process, answer.process.spectrum
    kind = answer.kind
    severity, place = kind.parameters()
    seconds = process.interval * sum(i.size for i in process.innovations)
    independent = max(seconds * min(4.0 * spectrum.bandwidth, 1.0 / process.interval), 2.0)
    relative = float(np.sqrt(0.5 / independent))
    if spectrum.strouhal_number > 0.0:
        amplitude = float(np.sqrt(2.0)) * spectrum.intensity
        width = spectrum.bandwidth / max(spectrum.strouhal_number, 1e-9)
        return {
            f"{kind.name}.{severity.name}": ParameterEstimate(amplitude, amplitude * relative, "1"),
            f"{kind.name}.{place.name}": ParameterEstimate(
                spectrum.strouhal_number, spectrum.strouhal_number * width * relative, "1"
            ),
        }
    # a corner above the rig's frequencies looks white: only the size over its square root is known there
    return {
        f"{kind.name}.{severity.name}": ParameterEstimate(
            spectrum.intensity, spectrum.intensity * relative, "1"
        ),
        f"{kind.name}.{place.name}": ParameterEstimate(
            spectrum.bandwidth,
            None,
            "Hz",
            "upper" if spectrum.bandwidth >= _AT_LIMIT * LONGEST_BANDWIDTH else None,
        ),
    }


def _read_parameters(study: Study) -> dict[str, ParameterEstimate]:
    found: dict[str, ParameterEstimate] = {}
    if study.hum is not None:
        amplitude, frequency = (f"{HUM.name}.{info.name}" for info in HUM.parameters())
        found[amplitude] = ParameterEstimate(study.hum.amplitude, study.hum.std, "rad")
        found[frequency] = ParameterEstimate(study.hum.frequency, study.hum.frequency_std, "Hz")
    if study.coarse:
        found[f"{COARSE_STEP.name}.{COARSE_STEP.parameters()[0].name}"] = ParameterEstimate(
            study.step, None, "rad"
        )
    return own_parameters(found, study.campaign, study.similarity)


def _short(parameters: Mapping[str, ParameterEstimate]) -> dict[str, ParameterEstimate]:
    """Parameter names without the effect's, where there is one effect only."""
    effects = {name.split(".")[0] for name in parameters}
    if len(effects) != 1:
        return dict(parameters)
    return {name.split(".")[1]: value for name, value in parameters.items()}


_CYCLES = 3.0
_SHARE = 0.5  # of the largest swing: an amplitude that every run passes through


def cause_sizes(study: Study) -> tuple[CauseSize, ...]:
    """Simulate the fitted model with each cause and without it.

    Returns:
        The size of every fitted cause, in the measured campaign's units. A cause that was read off the records or
        is random has none, and neither has one that stops the motion at once, acts on driven runs only, or acts
        on a body that nothing holds: the runs simulated are free decays.
    """
    if study.nominal.problem.data.unrestrained:
        return ()
    fit = study.chosen
    found = (_size(study, fit, kind) for kind in fit.problem.effects if not kind.driven)
    return tuple(size for size in found if size is not None)


def _size(study: Study, fit: Fit, kind: type[Effect]) -> CauseSize | None:
    problem = fit.problem
    data = problem.data.undriven()
    problem = replace(problem, data=data)
    runs = range(len(data.runs))
    shown = [i for i in runs if data.runs[i].wind_on] if kind.condition == "wind_on" else []
    # the softest spring, where a moment of any size does most
    index = min(shown or runs, key=lambda i: data.runs[i].spring_stiffness or 0.0)
    amplitude = _SHARE * data.swing
    release = fit.point.release.copy()
    release[index, :2] = amplitude, 0.0
    without = fit.point.common.copy()
    severity = f"{kind.name}.{kind.parameters()[0].name}"
    if severity not in problem.names:
        return None
    without[problem.names.index(severity)] = 0.0
    both = problem.predict([Point(fit.point.common, release), Point(without, release)])
    run = data.runs[index]
    frequency = resonance(fit, index)
    count = min(run.reading.size, round(_CYCLES / (frequency * run.interval)))
    curves = [readings[index][:count] for readings in both]
    decay, decay_without = (_decay(run.interval, curve, frequency) for curve in curves)
    if decay is None or decay_without is None:
        return None
    rate, zeta, zero = decay
    rate_without, zeta_without, zero_without = decay_without
    own = study.similarity.own(1.0, study.similarity.reading)
    effect = next(effect for effect in problem.effects_at(fit.point.common) if isinstance(effect, kind))
    return CauseSize(
        effect=kind.name,
        run=run.id,
        amplitude=amplitude,
        damping_ratio=zeta,
        damping_ratio_without=zeta_without,
        frequency_change=rate / rate_without - 1.0,
        zero_change=own * (zero - zero_without),
        reading_change=own * float(np.sqrt(np.mean((curves[0] - curves[1]) ** 2))),
        stands=effect.stands(linear_coefficients(fit, index)[2]),
    )


def _decay(interval: float, curve: Array, frequency: float) -> Sequence[float] | None:
    """Angular frequency (rad/s), damping ratio and mean of a few cycles; None where they are no decay."""
    from scipy.optimize import least_squares  # only here: slow to load

    time = (np.arange(curve.size) + 0.5) * interval

    def left(point: Array) -> Array:
        omega, delta, a, b, zero = point
        swing: Array = np.exp(-delta * time) * (a * np.cos(omega * time) + b * np.sin(omega * time)) + zero
        return swing - curve

    if curve.size < 10 or not np.all(np.isfinite(curve)):
        return None
    size = 0.5 * float(np.ptp(curve))
    omega = 2.0 * np.pi * frequency
    try:
        with np.errstate(over="raise", invalid="raise"):
            found = least_squares(left, (omega, 0.0, size, 0.0, 0.0), method="lm")
    except (ValueError, FloatingPointError):
        return None
    if not found.success:
        return None
    omega, delta, *_, zero = found.x
    natural = float(np.hypot(omega, delta))
    return natural, float(delta) / natural, float(zero)
