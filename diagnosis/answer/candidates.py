"""The answers with their probabilities and parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from diagnosis.answer.determined import meant_parameter
from diagnosis.answer.own_units import own_parameters
from diagnosis.answer.reported import Base
from diagnosis.attribution.decide import UNKNOWN, Weighed
from diagnosis.attribution.process_noise import LONGEST_BANDWIDTH
from diagnosis.attribution.random_moments import RandomAnswer
from diagnosis.policy import EVEN_SHARE, GAP_FALSE_ALARM_RATE
from diagnosis.result import Candidate, ParameterEstimate
from diagnosis.study import COARSE_STEP, HUM, Study
from tunnel_sim.effects import known_effects

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
    hypothesis = study.hypothesis(answer.effects) if random is None else random.beside
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
