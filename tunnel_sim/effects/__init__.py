"""The unmodelled effects: each is defined once and serves injection, fitting and reports."""

from __future__ import annotations

from collections.abc import Mapping

from tunnel_sim.effects.asymmetric_stiffness import AsymmetricStiffness
from tunnel_sim.effects.base import Effect, ParameterInfo, make_effect
from tunnel_sim.effects.buffeting import Buffeting
from tunnel_sim.effects.chain import EffectChain
from tunnel_sim.effects.coulomb_friction import CoulombFriction
from tunnel_sim.effects.cubic_stiffness import CubicStiffness
from tunnel_sim.effects.flow_misalignment import FlowMisalignment
from tunnel_sim.effects.free_play import FreePlay
from tunnel_sim.effects.gravity_stiffness import GravityStiffness
from tunnel_sim.effects.mains_hum import MainsHum
from tunnel_sim.effects.nonlinear_yaw_damping import NonlinearYawDamping
from tunnel_sim.effects.nonlinear_yaw_moment import NonlinearYawMoment
from tunnel_sim.effects.quadratic_damping import QuadraticDamping
from tunnel_sim.effects.rod_flexibility import RodFlexibility
from tunnel_sim.effects.sensor_clipping import SensorClipping
from tunnel_sim.effects.sensor_drift import SensorDrift
from tunnel_sim.effects.sensor_hysteresis import SensorHysteresis
from tunnel_sim.effects.sensor_nonlinearity import SensorNonlinearity
from tunnel_sim.effects.sensor_quantisation import SensorQuantisation
from tunnel_sim.effects.spring_miscalibration import SpringMiscalibration
from tunnel_sim.effects.structural_damping import StructuralDamping
from tunnel_sim.effects.unsteady_aero_lag import UnsteadyAeroLag
from tunnel_sim.effects.vortex_shedding import VortexShedding
from tunnel_sim.effects.wind_speed_drift import WindSpeedDrift
from tunnel_sim.effects.wind_speed_offset import WindSpeedOffset
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean

#: Every effect, in the order in which they are listed and applied.
ALL_EFFECTS: tuple[type[Effect], ...] = (
    CoulombFriction,
    QuadraticDamping,
    StructuralDamping,
    CubicStiffness,
    AsymmetricStiffness,
    FreePlay,
    GravityStiffness,
    RodFlexibility,
    NonlinearYawMoment,
    WindSpeedDrift,
    NonlinearYawDamping,
    UnsteadyAeroLag,
    Buffeting,
    VortexShedding,
    FlowMisalignment,
    SensorNonlinearity,
    SensorQuantisation,
    SensorHysteresis,
    SensorDrift,
    MainsHum,
    SensorClipping,
    SpringMiscalibration,
    WindSpeedOffset,
)


def effect_class(name: str) -> type[Effect]:
    """The class of the effect with a given name.

    Args:
        name: such as ``coulomb_friction``.

    Raises:
        TunnelError: when there is none; the message suggests the closest name.
    """
    for kind in ALL_EFFECTS:
        if kind.name == name:
            return kind
    raise TunnelError(
        f"unknown effect {name!r}", remedy=did_you_mean(name, [kind.name for kind in ALL_EFFECTS])
    )


def the_effect(**traits: object) -> type[Effect]:
    """The class of the only effect with given traits.

    Args:
        **traits: as listed in `Effect`.

    Raises:
        LookupError: when there is none, or more than one.
    """
    found = [kind for kind in ALL_EFFECTS if all(getattr(kind, t) == v for t, v in traits.items())]
    if len(found) != 1:
        raise LookupError(f"{len(found)} effects have the traits {traits}")
    return found[0]


def effect_from(name: str, parameters: Mapping[str, float]) -> Effect:
    """An effect by name.

    Args:
        name: such as ``coulomb_friction``.
        parameters: by name, in their units; the others take their defaults.

    Returns:
        The effect.

    Raises:
        TunnelError: when a name is unknown or a value out of range.
    """
    return make_effect(effect_class(name), parameters)


__all__ = [
    "ALL_EFFECTS",
    "Effect",
    "EffectChain",
    "ParameterInfo",
    "effect_class",
    "effect_from",
    "the_effect",
]
