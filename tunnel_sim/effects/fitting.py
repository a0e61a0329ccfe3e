"""What a fit passes to an effect about the runs, and the starting values that the effect returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

from tunnel_sim.effects.parameters import ParameterInfo


@dataclass(frozen=True)
class Circumstances:
    """What the starting values for the fit of an effect depend on.

    Args:
        springs: stated stiffnesses, ascending, N m/rad.
        greatest_reading: greatest absolute reading of any run, rad.
        normalised: whether runs are fitted per unit inertia.
        slowest_wind: least stated speed of the runs with the wind on, m/s; 0 where there are none.
    """

    springs: tuple[float, ...]
    greatest_reading: float
    normalised: bool
    slowest_wind: float


@dataclass(frozen=True)
class Trial:
    """Starting values for the fit of an effect.

    Args:
        values: by parameter name; the others start at their defaults.
        scaled: name of the parameter that linear theory rescales; None where the values are used as they are.
        at_most: greatest absolute value that linear theory may give it, in its unit.
        replaces: name of the nominal parameter that is lowered by as much, down to zero; None for none.
    """

    values: Mapping[str, float]
    scaled: str | None
    at_most: float = inf
    replaces: str | None = None


@dataclass(frozen=True)
class WindOnRun:
    """A wind-on run in the fitted model.

    Args:
        spring_stiffness: Kr, N m/rad.
        omega: natural frequency with the wind on, rad/s.
        still_omega: natural frequency of the same rig in still air, rad/s.
        per_cn_beta: ½ρV²Al, which multiplies Cnβ, N m.
        per_cn_r: ½ρVAl², which multiplies Cnr, N m s.
    """

    spring_stiffness: float
    omega: float
    still_omega: float
    per_cn_beta: float
    per_cn_r: float


def moment_scale(info: ParameterInfo, campaign: Circumstances) -> float:
    """Factor on a parameter's typical value: in normalised form moments are divided by about 0.1 kg m².

    Args:
        campaign: says whether runs are normalised.

    Returns:
        10 for a moment in normalised form, else 1.
    """
    return 10.0 if campaign.normalised and info.unit.startswith("N m") else 1.0
