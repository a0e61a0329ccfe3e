"""The two parameters of a fit that the runs separate least, among those of the nominal model and the effects."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from identification.trade_off import ROLES, Role, Setting, TradeOff, trade_off
from tunnel_sim.effects import Effect
from tunnel_sim.effects.parameters import ParameterInfo
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.units import angle_power, dimension


def least_separated(fit: Fit, campaign: Campaign) -> TradeOff | None:
    """The trade-off among the common parameters of a fit; None where the runs separate all of them.

    A parameter at the end of its range is not free, and is excluded.
    """
    free = [place for place, name in enumerate(fit.problem.names) if fit.bound(name) is None]
    names = [fit.problem.names[place] for place in free]
    covariance = fit.stated_covariance[np.ix_(free, free)]
    return trade_off(names, covariance, roles(fit), Setting.of(campaign), fit.settings.answer.trades_off_from)


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
    """The role of an effect's parameter, by its unit and by where its effect acts."""
    kg, _, s = dimension(info.unit)
    windy, damps = kind.condition == "wind_on", kind.channel == "damping"
    shapes = info != kind.parameters()[0]  # all but the severity
    return Role(
        amplitude=None if shapes else 1.0 - angle_power(info.unit),
        frequency=s + 2.0 if kg == 1.0 else float(windy and damps),
        wind=(1.0 if damps else 2.0) if windy else 0.0,
        input=kind.driven,
        reading=kind.channel == "sensor",
        stated=kind.chosen_spring() is not None,
        length=info.along_run,
    )
