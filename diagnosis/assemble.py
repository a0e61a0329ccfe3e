"""From a study to the answer: figures on held-out runs, coefficients, rivals, words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version
from typing import Any

import numpy as np

from diagnosis.cautions import cautions
from diagnosis.coefficients import coefficients, rival_fits
from diagnosis.decide import RIVAL_PROBABILITY, Weighed
from diagnosis.gap import FALSE_ALARM_RATE
from diagnosis.held_out import HeldOut, predict_held_out
from diagnosis.least_squares import Fit
from diagnosis.localisation.maps import Maps
from diagnosis.next_run import separating_run
from diagnosis.random_moments import RandomAnswer
from diagnosis.result import (
    Candidate,
    Coefficients,
    Diagnosis,
    GapSummary,
    NoiseSummary,
    ParameterEstimate,
    RunGap,
    Where,
)
from diagnosis.study import Study
from diagnosis.verdict import blind_spots, cnr_note, verdict

_LATE_START = (
    "the nominal model misses the motion grossly, so records are read from their second passage through the middle "
    "on: a start driven by hand is no free decay"
)
_PACKAGES = ("virtual-wind-tunnel", "mujoco", "numpy", "scipy")


@dataclass(frozen=True)
class Base:
    """What an excess is measured against.

    Args:
        variance: of one sample, rad²: noise and stated resolution.
        extra: what a coarse step adds to that, as a share.
        hum: what a hum adds, as a share.
    """

    variance: float
    extra: float
    hum: float


def assemble(study: Study, where: Where, maps: Maps) -> Diagnosis:
    """Compose the answer.

    Args:
        study: what was found.
        where: where the gap is.
        maps: the pictures' data.

    Returns:
        The diagnosis.
    """
    base = excess_base(study)
    chosen = chosen_fit(study)
    nominal_out = predict_held_out(study.nominal)
    chosen_out = nominal_out if chosen is study.nominal else predict_held_out(chosen)
    gap = _gap(study, base, chosen, nominal_out, chosen_out)
    probability = study.weighed[0].probability if study.weighed else 1.0 - gap.false_alarm_rate
    rivals = rival_fits(study.weighed, study.hypotheses, chosen)
    data = study.nominal.problem.data
    return Diagnosis(
        campaign=study.campaign.name,
        causes=study.causes,
        verdict=verdict(
            study.causes,
            before=gap.excess_before,
            after=gap.excess_after,
            closed=gap.closed,
            probability=probability,
            held_out=any(run.held_out for run in gap.runs),
        ),
        gap=gap,
        where=where,
        maps=maps.to_json_dict(),
        candidates=_candidates(study, base),
        ambiguous_with=_rival_names(study),
        next_run=_next_run(study, chosen),
        coefficients=Coefficients(
            before=coefficients(
                study.nominal, nominal_out, study.campaign, [(chosen, 1.0)] if study.causes else ()
            ),
            after=coefficients(chosen, chosen_out, study.campaign, rivals),
            note=cnr_note(study.causes),
        ),
        noise=_noise(study),
        blind_spots=blind_spots(
            springs=len(data.springs),
            speeds=len({run.wind_speed for run in data.runs if run.wind_on}),
            wind_off=any(not run.wind_on for run in data.runs),
            wind_on=data.wind_on,
            normalised=data.normalised,
        ),
        seconds=study.seconds,
        provenance={"versions": {name: version(name) for name in _PACKAGES}},
        cautions=(
            *cautions(
                study.campaign,
                study.noise,
                gap.runs,
                named=bool(study.causes) and study.causes != ("unknown",),
            ),
            *((_LATE_START,) if study.started_late else ()),
        ),
    )


def chosen_fit(study: Study) -> Fit:
    """The fit of the answer; the nominal one where nothing fitted is part of it."""
    fitted = tuple(name for name in study.fitted if name != "unknown")
    random = study.random_answer(fitted)
    if random is not None:
        return study.nominal if random.beside is None else random.beside.fit
    hypothesis = study.hypothesis(fitted) if fitted else None
    return study.nominal if hypothesis is None else hypothesis.fit


def excess_base(study: Study) -> Base:
    """The noise that a perfect model would leave.

    Args:
        study: its noise, step and hum.

    Returns:
        The stated noise where it is stated and the records contradict it, or the readings' step does; else the
        noise estimated from the records.
    """
    estimated = float(np.mean(list(study.noise.variance.values())))
    stated = study.noise.stated_variance
    hum = 0.0 if study.hum is None else study.hum.excess
    if stated is not None and (study.coarse or study.test.noisy):
        return Base(stated, max(estimated / stated - 1.0, 0.0), hum * estimated / stated)
    if study.coarse:
        fine = (study.campaign.sensor.resolution or 0.0) ** 2 / 12.0
        alone = max(estimated - study.step**2 / 12.0, 0.05 * estimated) + fine
        return Base(alone, estimated / alone - 1.0, hum * estimated / alone)
    return Base(estimated, 0.0, hum)


def _gap(study: Study, base: Base, chosen: Fit, nominal_out: HeldOut, chosen_out: HeldOut) -> GapSummary:
    data = study.nominal.problem.data
    ratio = base.extra + 1.0  # of the estimated noise to the base
    random = study.random_answer(study.fitted)
    explained = 0.0 if study.coarse and "sensor_quantisation" in study.causes else base.extra
    runs, sizes = [], []
    before_out, after_out = [], []
    for run, residual, kept in zip(data.runs, study.nominal.residuals, chosen.residuals, strict=True):
        fitted = (float(np.mean(residual**2)) - 1.0) / run.block * ratio
        before = fitted + base.hum + base.extra
        left = chosen_out.excess.get(run.id)
        open_ = float(np.mean(kept**2)) - 1.0 if left is None else left
        after = open_ / run.block * ratio + explained
        if random is not None and run.wind_on:
            after = random.process.excess / run.block * ratio + explained
        if left is not None and run.id in nominal_out.excess:
            before_out.append(nominal_out.excess[run.id] / run.block * ratio + base.hum + base.extra)
            after_out.append(after)
        runs.append(RunGap(run.id, before, after, held_out=left is not None))
        sizes.append(run.reading.size * run.block)
    weight = np.array(sizes) / np.sum(sizes)
    total_before = float(weight @ [run.before for run in runs])
    total_after = float(weight @ [run.after for run in runs])
    named = bool(study.causes) and study.causes != ("unknown",)
    closed = 0.0
    if named and before_out and sum(before_out) > 0.0:
        closed = float(np.clip(1.0 - max(sum(after_out), 0.0) / sum(before_out), 0.0, 1.0))
    elif named and total_before > 0.0:
        closed = float(np.clip(1.0 - max(total_after, 0.0) / total_before, 0.0, 1.0))
    return GapSummary(
        detected=bool(study.causes),
        excess_before=total_before,
        excess_after=total_after if named else total_before,
        closed=closed,
        runs=tuple(runs) if named else tuple(replace(run, after=run.before) for run in runs),
        false_alarm_rate=FALSE_ALARM_RATE,
        p_value=0.0 if study.read_off else study.test.p_value,
        tests=study.test.tests,
    )


def _candidates(study: Study, base: Base) -> tuple[Candidate, ...]:
    found = []
    if not study.causes:
        return (
            Candidate("none", 1.0 - FALSE_ALARM_RATE, study.nominal.excess / _block(study), 0.0),
            Candidate("unknown", FALSE_ALARM_RATE, study.nominal.excess / _block(study), 0.0),
        )
    before = max(study.nominal.excess, 1e-9)
    for answer in study.weighed:
        if answer.effects == ("unknown",):
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
            Candidate(name, 0.99, left, float(np.clip(closed, 0.0, 1.0)), _short(_read_parameters(study)))
        )
        found.append(Candidate("unknown", 0.01 - FALSE_ALARM_RATE, left + base.hum + base.extra, 0.0))
    found.append(Candidate("none", min(study.test.p_value, FALSE_ALARM_RATE), before / _block(study), 0.0))
    return tuple(sorted(found, key=lambda c: -c.probability))


def _block(study: Study) -> int:
    """Samples in a block mean: a structural excess of block means is as many times that of samples."""
    return study.nominal.problem.data.runs[0].block


def _parameters(study: Study, answer: Weighed) -> dict[str, ParameterEstimate]:
    random = study.random_answer(answer.effects)
    hypothesis = study.hypothesis(answer.effects) if random is None else random.beside
    found: dict[str, ParameterEstimate] = {}
    if hypothesis is not None:
        problem = hypothesis.fit.problem
        units = {
            f"{kind.name}.{info.name}": info.unit for kind in problem.effects for info in kind.parameters()
        }
        inflate = float(np.sqrt(1.0 + max(hypothesis.fit.excess, 0.0)))
        for name in problem.effect_names:
            fit = hypothesis.fit
            found[name] = ParameterEstimate(fit.value(name), fit.std(name) * inflate, units[name])
        for name, value in problem.fixed:
            found[name] = ParameterEstimate(value, 0.0, units[name])
    if random is not None:
        found |= _random_parameters(random)
    return found


def _random_parameters(answer: RandomAnswer) -> dict[str, ParameterEstimate]:
    """Of a random moment; its size is known as well as the number of its correlation times allows."""
    process, spectrum = answer.process, answer.process.spectrum
    seconds = process.interval * sum(i.size for i in process.innovations)
    independent = max(seconds * min(4.0 * spectrum.bandwidth, 1.0 / process.interval), 2.0)
    relative = float(np.sqrt(0.5 / independent))
    if spectrum.strouhal_number > 0.0:
        amplitude = float(np.sqrt(2.0)) * spectrum.intensity
        width = spectrum.bandwidth / max(spectrum.strouhal_number, 1e-9)
        return {
            "vortex_shedding.amplitude": ParameterEstimate(amplitude, amplitude * relative, "1"),
            "vortex_shedding.strouhal_number": ParameterEstimate(
                spectrum.strouhal_number, spectrum.strouhal_number * width * relative, "1"
            ),
        }
    # a corner beyond the rig's own frequencies is seen as white: only the size over its root is known there
    return {
        "buffeting.intensity": ParameterEstimate(spectrum.intensity, spectrum.intensity * relative, "1"),
        "buffeting.bandwidth": ParameterEstimate(spectrum.bandwidth, spectrum.bandwidth, "Hz"),
    }


def _read_parameters(study: Study) -> dict[str, ParameterEstimate]:
    found: dict[str, ParameterEstimate] = {}
    if study.hum is not None:
        found["mains_hum.amplitude"] = ParameterEstimate(study.hum.amplitude, study.hum.std, "rad")
        found["mains_hum.frequency"] = ParameterEstimate(study.hum.frequency, 1e-3, "Hz")
    if study.coarse:
        found["sensor_quantisation.step"] = ParameterEstimate(study.step, 1e-7, "rad")
    return found


def _short(parameters: Mapping[str, ParameterEstimate]) -> dict[str, ParameterEstimate]:
    """Parameter names without the effect's, where there is one effect only."""
    effects = {name.split(".")[0] for name in parameters}
    if len(effects) != 1:
        return dict(parameters)
    return {name.split(".")[1]: value for name, value in parameters.items()}


def _rivals(study: Study) -> list[Weighed]:
    chosen = set(study.fitted)
    return [
        answer
        for answer in study.weighed[1:]
        if answer.probability >= RIVAL_PROBABILITY
        and answer.effects != ("unknown",)
        and not chosen <= set(answer.effects)
        and study.causes != ("unknown",)
    ]


def _rival_names(study: Study) -> tuple[str, ...]:
    names = {name for answer in _rivals(study) for name in answer.effects}
    return tuple(sorted(names - set(study.causes)))


def _next_run(study: Study, chosen: Fit) -> dict[str, Any] | None:
    for answer in _rivals(study):
        hypothesis = study.hypothesis(answer.effects)
        if hypothesis is not None and chosen is not study.nominal:
            return separating_run(chosen, hypothesis.fit)
    return None


def _noise(study: Study) -> NoiseSummary:
    noise = study.noise
    variance = float(np.mean(list(noise.variance.values())))
    stated = None if noise.stated_variance is None else float(np.sqrt(noise.stated_variance))
    return NoiseSummary(float(np.sqrt(variance)), stated, noise.source, noise.reason)
