"""The two most strongly correlated parameters of a campaign, and the run that would separate them.

Every parameter has a role: the powers with which its moment depends on the conditions of a run. Two parameters are
separated by a run that changes a condition on which they depend with different powers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.policy import TRADE_OFF_CORRELATION
from identification.show.quantity import INTERVAL
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True)
class Combination:
    """A combination of two parameters that the runs determine: the first plus a multiple of the second.

    Args:
        quantity: name of the first, or of the quantity to which both add up.
        factor: factor on the second, in ``unit`` per unit of the second.
        value, std: value of the combination with its standard deviation, in ``unit``.
        unit: unit of the combination.
        of_second: interval of 0.95 of the second's contribution within the bounds of both, in ``unit``.
    """

    quantity: str
    factor: float
    value: float
    std: float
    unit: str
    of_second: tuple[float, float]

    @classmethod
    def of(
        cls,
        quantity: str,
        values: Array,
        covariance: Array,
        bounds: Array,
        unit: str,
        further_std: Callable[[Array], float] = lambda _: 0.0,
    ) -> Combination | None:
        """The combination of least variance.

        Args:
            values: of both parameters, shape (2,), the first in the unit.
            covariance: covariance of both, shape (2, 2).
            bounds: least and greatest value of each, shape (2, 2).
            further_std: standard deviation of a combination by other sources than noise, in the unit, from the
                factors on both, shape (2,).

        Returns:
            None if the parameters do not add up: a larger one then needs a larger other.
        """
        factor = -float(covariance[0, 1] / covariance[1, 1])
        if not factor > 0.0:
            return None
        whole = float(values[0] + factor * values[1])
        by_noise = math.sqrt(max(float(covariance[0, 0] + factor * covariance[0, 1]), 0.0))
        std = math.hypot(by_noise, further_std(np.array([1.0, factor])))
        std_of_second = math.hypot(math.sqrt(float(covariance[1, 1])), further_std(np.array([0.0, 1.0])))
        own, reach = float(values[1]), INTERVAL * std_of_second
        low = max(own - reach, bounds[1, 0], (whole - bounds[0, 1]) / factor)
        high = min(own + reach, bounds[1, 1], (whole - bounds[0, 0]) / factor)
        ends = (
            factor * float(min(low, own)),
            factor * float(max(high, own)),
        )  # the estimate itself is possible
        return cls(quantity, factor, whole, std, unit, ends)


@dataclass(frozen=True)
class TradeOff:
    """Two strongly correlated parameters: the runs determine a combination better than either.

    Args:
        parameters: names of both, in the order of the fit; for effects ``effect.parameter``.
        correlation: correlation of their errors, −1 to 1, dimensionless.
        remedy: the run that would separate them, as a clause in the imperative.
        together: the combination that the runs determine; None if the two do not add up, or one of them shapes
            a law.
    """

    parameters: tuple[str, str]
    correlation: float
    remedy: str
    together: Combination | None = None

    @classmethod
    def from_json_dict(cls, data: Mapping[str, Any] | None) -> TradeOff | None:
        """The value in a document; None if it has none."""
        if data is None:
            return None
        first, second = data["parameters"]
        given = data.get("together")
        both = None if given is None else Combination(**{**given, "of_second": tuple(given["of_second"])})
        return cls((first, second), data["correlation"], data["remedy"], both)


@dataclass(frozen=True)
class Role:
    """The dependence of a parameter's moment on the conditions of a run.

    Args:
        amplitude: power of the amplitude of the motion, dimensionless; None: not a power, as for a parameter that
            shapes a law.
        frequency: power of the frequency of the motion, dimensionless.
        wind: power of the wind speed, dimensionless.
        weight: whether the angle under a known weight is its main evidence.
        input: whether it acts through the input of driven runs only.
        reading: whether it is an error of the reading, not a moment.
        stated: whether it is an error of a stated stiffness.
        length: whether it shapes a change along the run.
    """

    amplitude: float | None = 1.0
    frequency: float = 0.0
    wind: float = 0.0
    weight: bool = False
    input: bool = False
    reading: bool = False
    stated: bool = False
    length: bool = False


ROLES: Mapping[str, Role] = {
    "yaw_inertia": Role(frequency=2.0),
    "stiffness": Role(),
    "added_stiffness": Role(),
    "mechanical_damping": Role(frequency=1.0),
    "cn_beta": Role(wind=2.0),
    "cn_r": Role(frequency=1.0, wind=1.0),
    "drive_gain": Role(amplitude=0.0, input=True),
    "servo_kp": Role(weight=True),
    "moment_offset": Role(amplitude=0.0),
    "zero": Role(amplitude=0.0, reading=True),
}
"""Roles of the parameters of the nominal models, by name."""


@dataclass(frozen=True)
class Setting:
    """The conditions that can be changed between the runs of a rig.

    Args:
        springs: whether the spring can be exchanged, unlike the spring of a joint of a model.
        driven: whether the rig is driven.
    """

    springs: bool
    driven: bool

    @classmethod
    def of(cls, campaign: Campaign) -> Setting:
        """The setting of a campaign."""
        return cls(campaign.law is None and not campaign.unrestrained, campaign.driven)


def _at_other_frequencies(rig: Setting) -> str:
    if rig.springs:
        return "add runs with a much softer or stiffer spring"
    return (
        "drive it at lower and higher frequencies"
        if rig.driven
        else "add runs with a known inertia on the body"
    )


def _at_other_amplitudes(rig: Setting) -> str:
    return f"{'drive it to' if rig.driven else 'add releases from'} larger and smaller angles"


def _always(words: str) -> Callable[[Setting], str]:
    return lambda _: words


_RUNS: Sequence[tuple[Callable[[Role], object], Callable[[Setting], str]]] = (
    (lambda role: role.stated, _always("calibrate the springs by weights")),
    (lambda role: role.reading, _always("read the sensor at known angles")),
    (lambda role: role.wind, _always("add runs with the wind off or at another wind speed")),
    (lambda role: role.weight, _always("hold the link against a known weight")),
    (lambda role: role.input, _always("add free decays, or an input of another form")),
    (lambda role: role.length, _always("add longer runs")),
    (lambda role: role.amplitude, _at_other_amplitudes),
    (lambda role: role.frequency, _at_other_frequencies),
)
"""Conditions that can be changed, the most certain first, and the run that changes each."""


def separating(first: Role, second: Role, rig: Setting) -> str:
    """The run that separates two parameters, as a clause in the imperative."""
    if first.wind and second.wind and first.wind != second.wind:  # neither acts with the wind off
        return "add runs at another wind speed"
    for follows, run in _RUNS:
        if follows(first) != follows(second):
            return run(rig)
    if first.amplitude is None:  # both shape a law
        return _at_other_amplitudes(rig)
    return "measure one of them by itself"


def trade_off(
    names: Sequence[str],
    covariance: Array,
    roles: Mapping[str, Role],
    rig: Setting,
) -> TradeOff | None:
    """The two parameters with the most strongly correlated errors; None if no correlation is large.

    Args:
        names: names of the parameters.
        covariance: covariance of the parameters, in the products of their units, shape (p, p); a parameter that
            the fit does not determine has a variance of zero, and is left out.
        roles: roles by name.
    """
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    known = np.flatnonzero((std > 0.0) & np.isfinite(std))
    if known.size < 2:
        return None
    scaled = covariance[np.ix_(known, known)] / np.outer(std[known], std[known])
    sizes = np.triu(np.abs(scaled), 1)
    one, other = np.unravel_index(int(np.argmax(sizes)), sizes.shape)
    if not sizes[one, other] >= TRADE_OFF_CORRELATION:
        return None
    pair = names[known[one]], names[known[other]]
    correlation = float(np.clip(scaled[one, other], -1.0, 1.0))
    return TradeOff(pair, correlation, separating(roles[pair[0]], roles[pair[1]], rig))


def of_coefficients(names: Sequence[str], covariance: Array, campaign: Campaign) -> TradeOff | None:
    """The trade-off among the coefficients of an estimate.

    Args:
        names: names of the coefficients.
        covariance: covariance of the coefficients, in the products of their units, shape (p, p).
    """
    return trade_off(names, covariance, ROLES, Setting.of(campaign))
