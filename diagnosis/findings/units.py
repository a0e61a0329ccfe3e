"""The answer in the units of the measured campaign, and the influence of unstated sizes."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import replace

from diagnosis.findings.hidden import Hidden
from diagnosis.findings.repeatability import RunRepeatability
from diagnosis.model.fact import Fact
from diagnosis.model.nominal import NominalModel
from diagnosis.model.similarity import Similarity
from identification.show.quantity import Quantity
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties
from tunnel_sim.vocabulary.dimensions import NUMBER, dimension, in_si, product
from tunnel_sim.vocabulary.freedom import unit_of_frequency


def parameter_unit(name: str, campaign: Campaign, model: NominalModel) -> str:
    """The unit of an effect's parameter as identified.

    Returns:
        The parameter's own unit, divided by the unit of Izz where the nominal model is per unit inertia, and
        multiplied by the units of the frontal area, the reference length and the air density where these are not
        stated.
    """
    effect, _, parameter = name.partition(".")
    info = next(info for info in effect_class(effect).parameters() if info.name == parameter)
    rig = campaign.rig
    if info.per_pressure:
        factors = {
            "kg/m3": not campaign.states_density,
            "m2": rig.frontal_area is None,
            "m": rig.reference_length is None,
            "1/(kg m2)": model.per_inertia,
        }
        within = [dimension(unit) for unit, missing in factors.items() if missing]
        return in_si(functools.reduce(product, within, NUMBER))
    if info.unit == "l/V" and rig.reference_length is None:
        return "m"  # area times length, which over V is the time
    return model.identified_unit(info.unit)


#: By whether area and length are unstated: name and unit of the product that replaces a coefficient.
_PRODUCTS = {
    (True, False): {"cn_beta": ("cn_beta_area", "m2/rad"), "cn_r": ("cn_r_area", "m2/rad")},
    (False, True): {"cn_beta": ("cn_beta_length", "m/rad"), "cn_r": ("cn_r_length2", "m2/rad")},
    (True, True): {"cn_beta": ("cn_beta_area_length", "m3/rad"), "cn_r": ("cn_r_area_length2", "m4/rad")},
}


def sized_coefficients(found: Mapping[str, Quantity], rig: RigProperties) -> dict[str, Quantity]:
    """Coefficients under the names of the identified quantities.

    Args:
        found: ``cn_beta`` and ``cn_r``, with 1 for every unstated size; or other coefficients.

    Returns:
        The same coefficients where both sizes are stated; else Cnβ and Cnr times the unstated sizes, as their
        names
        say: ``cn_beta_area_length`` is Cnβ·A·l (m³/rad) and ``cn_r_area_length2`` is Cnr·A·l² (m⁴/rad).
    """
    products = _PRODUCTS.get((rig.frontal_area is None, rig.reference_length is None), {})
    sized = {}
    for name, value in found.items():
        identified, unit = products.get(name, (name, value.unit))
        sized[identified] = replace(value, unit=unit)
    return sized


def own_estimates(values: Mapping[str, Quantity], similarity: Similarity) -> dict[str, Quantity]:
    """Estimates by name, in the measured campaign's units."""
    return {
        name: own_estimate(value, similarity, unit_of_frequency(name, value.unit))
        for name, value in values.items()
    }


def own_fact(given: Fact, similarity: Similarity) -> Fact:
    """A fact in the measured campaign's units: figures with names ending in ``_rad`` are readings."""
    factor = similarity.own(1.0, similarity.reading)
    own = {name: factor * value if name.endswith("_rad") else value for name, value in given.figures.items()}
    return replace(given, figures=own)


def own_repeatability(given: RunRepeatability, similarity: Similarity) -> RunRepeatability:
    """The runs' repeatability with frequencies of the measured rig; all other figures are relative."""
    runs = (replace(one, frequency_hz=similarity.own(one.frequency_hz, "Hz")) for one in given.runs)
    return replace(given, runs=tuple(runs))


def own_parameters(
    given: Mapping[str, Quantity], campaign: Campaign, similarity: Similarity, model: NominalModel
) -> dict[str, Quantity]:
    """Parameters of effects in the measured campaign's units.

    Args:
        given: by ``effect.parameter``, in the effects' units, for the similar campaign.

    Returns:
        The same quantities, in the units of `parameter_unit`. The coefficient of a power of the rate other than
        the textbook's scales with that power of time.
    """
    found = {}
    for name, value in given.items():
        effect, _, parameter = name.partition(".")
        infos = {info.name: info for info in effect_class(effect).parameters()}
        exponent = infos[parameter].rate_exponent
        free = given.get(f"{effect}.{exponent}")
        beyond = 0.0 if free is None else free.value - infos[exponent].default
        own = own_estimate(value, similarity, unit_of_frequency(name, value.unit))
        factor = similarity.time**-beyond
        std = None if own.std is None else own.std * factor
        # An unstated size, density or inertia is 1 in own units: only the name of the unit changes.
        unit = parameter_unit(name, campaign, model)
        found[name] = replace(own, value=own.value * factor, std=std, unit=unit)
    return found


def own_hidden(
    given: Sequence[Hidden],
    coefficients: Mapping[str, Quantity],
    campaign: Campaign,
    similarity: Similarity,
    model: NominalModel,
) -> tuple[Hidden, ...]:
    """The effects that could hide, in the measured campaign's units, ordered by their influence on a coefficient.

    Args:
        coefficients: estimates of the similar campaign; their standard deviations are the reference of the
            moves.
    """

    def greatest(one: Hidden) -> float:
        stds = {name: known.std for name, known in coefficients.items() if known.std}
        return max((move.value / stds[name] for name, move in one.moves.items() if name in stds), default=0.0)

    found = []
    for one in sorted(given, key=lambda one: -greatest(one)):
        name = f"{one.effect}.{one.parameter}"
        size = own_parameters({name: one.size}, campaign, similarity, model)[name]
        moves = sized_coefficients(one.moves, campaign.rig)
        found.append(replace(one, size=size, moves=own_estimates(moves, similarity)))
    return tuple(found)


def own_estimate(estimate: Quantity, similarity: Similarity, unit: str = "") -> Quantity:
    """An estimate in the measured campaign's units, its value and standard deviation scaled alike.

    Args:
        unit: the unit with which it scales; empty: its own.
    """

    def own(value: float) -> float:
        return similarity.own(value, unit or estimate.unit)

    std, ends = estimate.std, estimate.interval
    return replace(
        estimate,
        value=own(estimate.value),
        std=None if std is None else own(std),
        interval=None if ends is None else (own(ends[0]), own(ends[1])),
    )
