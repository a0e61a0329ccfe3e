"""The most strongly correlated pair of parameters of a fit, of the nominal model or of the effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from diagnosis.answer.linear_theory import move_of_halves
from diagnosis.findings.units import own_estimate, own_parameters
from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import linear_coefficients
from identification.show.quantity import Quantity
from identification.trade_off import ROLES, Combination, Role, Setting, TradeOff, trade_off
from tunnel_sim.effects import Effect
from tunnel_sim.effects.parameters import ParameterInfo
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.dimensions import angle_power, dimension
from tunnel_sim.vocabulary.record import Array


def least_separated(fit: Fit, campaign: Campaign) -> TradeOff | None:
    """The trade-off among the common parameters of a fit; None where the runs separate all of them.

    A parameter at the end of its range counts only beside one with which it adds up: the runs determine the
    sum, and the bound limits how it is split.
    """
    names, of, covariance = fit.problem.names, roles(fit), fit.stated_covariance.copy()
    shapes = [of[name].amplitude is None for name in names]
    for place, name in enumerate(names):
        if fit.bound(name) is not None:
            apart = shapes | (covariance[place] >= 0.0) if not shapes[place] else np.full(len(names), True)
            apart[place] = False
            covariance[place, apart] = covariance[apart, place] = 0.0
    found = trade_off(names, covariance, of, Setting.of(campaign))
    if found is None or any(of[name].amplitude is None for name in found.parameters):
        return found
    return replace(found, together=_together(fit, campaign, found.parameters))


def _together(fit: Fit, campaign: Campaign, pair: tuple[str, str]) -> Combination | None:
    """The combination of two parameters that a fit determines, in the units of the measured campaign.

    The mechanical damping of a body on a spring is stated as a damping ratio. The difference between halves of the
    data, beyond chance, counts as an error of the model.
    """
    problem, data = fit.problem, fit.problem.data
    places = [problem.names.index(name) for name in pair]
    inflated = fit.stated_covariance[np.ix_(places, places)] * (1.0 + max(fit.excess, 0.0))
    scales, units = zip(*(_own_scale(fit, campaign, name) for name in pair), strict=True)
    quantity, scale = pair[0], np.array(scales)
    inertia, _, stiffness = linear_coefficients(fit, 0)
    unit = units[0]
    critical = data.model.critical_damping(inertia, stiffness)
    if pair[0] == "mechanical_damping" and critical is not None:
        quantity, unit, scale[0] = "zeta", "1", 1.0 / critical
    bounds = np.array([[end[place] for end in problem.bounds] for place in places])

    def of_halves(factors: Array) -> float:
        gradient = np.zeros(len(problem.names))
        gradient[places] = factors * scale
        return move_of_halves(fit, gradient)

    return Combination.of(
        quantity,
        scale * fit.point.common[places],
        inflated * np.outer(scale, scale),
        bounds * scale[:, None],
        unit,
        of_halves,
    )


def _own_scale(fit: Fit, campaign: Campaign, name: str) -> tuple[float, str]:
    """Factor from a fit's parameter to its value in the units of the measured campaign, and its unit there."""
    data, (given,) = fit.problem.data, [one for one in fit.problem.parameters.common if one.name == name]
    one = Quantity(1.0, None, given.unit)
    if not given.effect:
        return own_estimate(one, data.similarity).value, given.unit
    known = {
        other: replace(one, value=1.0 if other == name else fit.value(other), unit=unit)
        for other, unit in (
            (o.name, o.unit) for o in fit.problem.parameters.common if o.effect == given.effect
        )
    }
    found = own_parameters(known, campaign, data.similarity, data.model)[name]
    return found.value, found.unit


def roles(fit: Fit) -> Mapping[str, Role]:
    """The role of every common parameter of a fit, by name."""
    kinds = {kind.name: kind for kind in fit.problem.effects}
    found = {}
    for name in fit.problem.names:
        effect, _, own = name.rpartition(".")
        if effect:
            (info,) = (one for one in kinds[effect].parameters() if one.name == own)
            found[name] = role_in_effect(kinds[effect], info)
        else:
            found[name] = ROLES.get(name, Role())
    return found


def role_in_effect(kind: type[Effect], info: ParameterInfo) -> Role:
    """The role of an effect's parameter, by its unit and by the place where its effect acts."""
    kg, _, s = dimension(info.unit)
    windy, damps = kind.condition == "wind_on", kind.channel == "damping"
    shapes = info != kind.parameters()[0]  # all parameters but the severity
    return Role(
        amplitude=None if shapes else 1.0 - angle_power(info.unit),
        frequency=s + 2.0 if kg == 1.0 else float(windy and damps),
        wind=(1.0 if damps else 2.0) if windy else 0.0,
        input=kind.driven,
        reading=kind.channel == "sensor",
        stated=kind.chosen_spring() is not None,
        length=info.along_run,
    )
