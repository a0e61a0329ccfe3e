"""What is identified where the rig's sizes or the springs are not stated: names and units that say so."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import replace

from diagnosis.result import ParameterEstimate
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties
from tunnel_sim.vocabulary.units import NUMBER, dimension, in_si, product

#: Units of what acts on the yaw axis, and of the same per unit inertia.
_PER_INERTIA = {
    "N m": "rad/s2",
    "N m/rad": "1/s2",
    "N m s/rad": "1/s",
    "N m s2/rad2": "1/rad",
    "rad/(N m)": "s2",
}


def parameter_unit(name: str, campaign: Campaign) -> str:
    """The unit of an effect's parameter as identified.

    Args:
        name: ``effect.parameter``.

    Returns:
        The parameter's own unit; over that of Izz where any run states no spring, and times those of the frontal
        area, the reference length and the air density where these are not stated.
    """
    effect, _, parameter = name.partition(".")
    info = next(info for info in effect_class(effect).parameters() if info.name == parameter)
    normalised = any(run.spring_stiffness is None for run in campaign.runs)
    rig = campaign.rig
    if info.per_pressure:
        dense = all(run.air_density is not None for run in campaign.runs if run.wind_on)
        factors = {
            "kg/m3": not dense,
            "m2": rig.frontal_area is None,
            "m": rig.reference_length is None,
            "1/(kg m2)": normalised,
        }
        within = [dimension(unit) for unit, missing in factors.items() if missing]
        return in_si(functools.reduce(product, within, NUMBER))
    if info.unit == "l/V" and rig.reference_length is None:
        return "m"  # a·l, which over V is the time
    return _per_inertia(info.unit) if normalised else info.unit


def _per_inertia(unit: str) -> str:
    """The unit of a quantity whose mass is divided by Izz."""
    if unit in _PER_INERTIA:
        return _PER_INERTIA[unit]
    of = dimension(unit)
    return in_si(product(of, dimension("kg m2"), -of[0])) if of[0] else unit


def sized_coefficients(
    found: Mapping[str, ParameterEstimate], rig: RigProperties
) -> dict[str, ParameterEstimate]:
    """Coefficients under the names of what was identified.

    Args:
        found: ``cn_beta`` and ``cn_r``, with 1 in place of every size that is not stated; or other coefficients.
        rig: which sizes are stated.

    Returns:
        The same where both sizes are stated; else Cnβ and Cnr times the missing ones, which their names say:
        ``cn_beta_area_length`` is Cnβ·A·l (m³/rad) and ``cn_r_area_length2`` is Cnr·A·l² (m⁴/rad).
    """
    names = _sized_names(rig)
    return {
        names[name][0] if name in names else name: replace(value, unit=names[name][1])
        if name in names
        else value
        for name, value in found.items()
    }


def _sized_names(rig: RigProperties) -> dict[str, tuple[str, str]]:
    """Name and unit of the product identified in place of each coefficient."""
    if rig.frontal_area is not None and rig.reference_length is not None:
        return {}
    if rig.reference_length is not None:
        return {"cn_beta": ("cn_beta_area", "m2/rad"), "cn_r": ("cn_r_area", "m2/rad")}
    if rig.frontal_area is not None:
        return {"cn_beta": ("cn_beta_length", "m/rad"), "cn_r": ("cn_r_length2", "m2/rad")}
    return {"cn_beta": ("cn_beta_area_length", "m3/rad"), "cn_r": ("cn_r_area_length2", "m4/rad")}


def size_note(rig: RigProperties, *, windy: bool) -> str:
    """What is identified in place of the coefficients where sizes are not stated.

    Args:
        rig: which sizes are stated.
        windy: whether there are aerodynamic coefficients at all.

    Returns:
        A sentence; empty where they are Cnβ and Cnr.
    """
    stated = {"frontal_area": rig.frontal_area, "reference_length": rig.reference_length}
    missing = [name for name, value in stated.items() if value is None]
    if not missing or not windy:
        return ""
    beta = "Cnβ" + "·A" * (rig.frontal_area is None) + "·l" * (rig.reference_length is None)
    rate = "Cnr" + "·A" * (rig.frontal_area is None) + "·l²" * (rig.reference_length is None)
    return (
        f"[rig] states no {' and no '.join(missing)}, so {beta} and {rate} are identified, not Cnβ and Cnr. State "
        f"{'both' if len(missing) > 1 else 'it'} to get Cnβ and Cnr."
    )
