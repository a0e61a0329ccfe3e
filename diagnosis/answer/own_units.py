"""The answer for the similar campaign in the units of the campaign that was measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from diagnosis.answer.reference_sizes import parameter_unit
from diagnosis.fitting.similarity import Similarity
from diagnosis.result import Confirmation, Diagnosis, NoiseSummary, ParameterEstimate
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.campaign import Campaign

_NEXT_RUN = {"spring_stiffness": "N m/rad", "duration": "s"}
_STEPS = {
    "spring_stiffness": 0.01,
    "wind_speed": 0.1,
    "release_angle": 0.01,
    "duration": 1.0,
}  # N m/rad, m/s, rad, s


def in_own_units(answer: Diagnosis, similarity: Similarity) -> Diagnosis:
    """The answer with the parameters of the measured rig; what remains (`Rest`) has its units already.

    Args:
        answer: for the similar campaign; its candidates, maps and places are in the measured campaign's units
            already.
        similarity: how that was made.

    Returns:
        The same answer in the measured campaign's units.
    """

    def own(values: Mapping[str, ParameterEstimate]) -> dict[str, ParameterEstimate]:
        return {name: own_estimate(value, similarity) for name, value in values.items()}

    return replace(
        answer,
        coefficients=replace(
            answer.coefficients,
            before=own(answer.coefficients.before),
            after=own(answer.coefficients.after),
        ),
        noise=_noise(answer.noise, similarity),
        confirmation=_confirmation(answer.confirmation, similarity),
        next_run=None if answer.next_run is None else own_next_run(answer.next_run, similarity),
    )


def own_parameters(
    given: Mapping[str, ParameterEstimate], campaign: Campaign, similarity: Similarity
) -> dict[str, ParameterEstimate]:
    """Parameters of effects in the measured campaign's units.

    Args:
        given: by ``effect.parameter``, in the effects' own units, for the similar campaign.
        campaign: says which sizes and springs are stated.
        similarity: how the similar campaign was made.

    Returns:
        The same quantities, in the units of `parameter_unit`. The coefficient of another power of the rate than the
        textbook's changes with that power of time.
    """
    found = {}
    for name, value in given.items():
        effect, _, parameter = name.partition(".")
        infos = {info.name: info for info in effect_class(effect).parameters()}
        exponent = infos[parameter].rate_exponent
        free = given.get(f"{effect}.{exponent}")
        beyond = 0.0 if free is None else free.value - infos[exponent].default
        own = own_estimate(value, similarity)
        factor = similarity.time**-beyond
        std = None if own.std is None else own.std * factor
        # A size, density or inertia that is not stated is 1 in own units: only the name of the unit changes.
        unit = parameter_unit(name, campaign)
        found[name] = replace(own, value=own.value * factor, std=std, unit=unit)
    return found


def own_estimate(estimate: ParameterEstimate, similarity: Similarity) -> ParameterEstimate:
    """An estimate in the measured campaign's units.

    Args:
        estimate: for the similar campaign.
        similarity: how that was made.

    Returns:
        The same quantity, its value and standard deviation changed alike.
    """

    def own(value: float) -> float:
        return similarity.own(value, estimate.unit)

    std, ends = estimate.std, estimate.interval
    return replace(
        estimate,
        value=own(estimate.value),
        std=None if std is None else own(std),
        interval=None if ends is None else (own(ends[0]), own(ends[1])),
    )


def _noise(noise: NoiseSummary, similarity: Similarity) -> NoiseSummary:
    stated = noise.stated_std
    return replace(
        noise,
        std=similarity.own(noise.std, similarity.reading),
        stated_std=None if stated is None else similarity.own(stated, similarity.reading),
    )


def _confirmation(found: Confirmation, similarity: Similarity) -> Confirmation:
    factor = similarity.own(1.0, similarity.reading)
    return replace(
        found,
        largest_difference=found.largest_difference * factor,
        rms_difference=found.rms_difference * factor,
        tolerance=found.tolerance * factor,
    )


def own_next_run(run: Mapping[str, Any], similarity: Similarity) -> dict[str, Any]:
    """A run to make (`separating_run`) in the measured campaign's units, rounded to what an operator can set.

    Args:
        run: for the similar campaign.
        similarity: how that was made.
    """
    own = {name: similarity.own(v, _NEXT_RUN[name]) if name in _NEXT_RUN else v for name, v in run.items()}
    return {name: _settable(value, _STEPS[name]) if name in _STEPS else value for name, value in own.items()}


def _settable(value: float, step: float) -> float:
    """A value that an operator can set: a whole number of steps, or two digits where it is only a few steps."""
    if abs(value) < 10.0 * step:
        return float(f"{value:.2g}")
    return round(round(value / step) * step, 6)
