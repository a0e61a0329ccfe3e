"""The physics of a run in which one effect acts."""

from __future__ import annotations

from tunnel_sim.effects import Effect, EffectChain
from tunnel_sim.effects.base import Drawn
from tunnel_sim.physics.run_settings import RunSettings


def acting(effect: Effect, run: RunSettings, drawn: Drawn = None) -> RunSettings:
    return EffectChain(run, (effect,), (drawn,)).physics()
