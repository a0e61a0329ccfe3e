"""The unmodelled effects: each is defined once and serves injection, fitting and reports."""

from __future__ import annotations

from tunnel_sim.effects.base import Effect
from tunnel_sim.effects.capabilities import BetweenRuns
from tunnel_sim.effects.chain import EffectChain
from tunnel_sim.effects.parameters import ParameterInfo
from tunnel_sim.effects.registry import (
    ALL_EFFECTS,
    effect_class,
    effect_from,
    known_effects,
    register_effect,
    the_effect,
)

__all__ = [
    "ALL_EFFECTS",
    "BetweenRuns",
    "Effect",
    "EffectChain",
    "ParameterInfo",
    "effect_class",
    "effect_from",
    "known_effects",
    "register_effect",
    "the_effect",
]
