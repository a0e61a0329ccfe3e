"""The base class of all effects: its traits, and hooks where an effect acts.

Only the chain of a run's effects (`tunnel_sim.effects.chain`) calls their hooks.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self, TypeAlias

import numpy as np

from tunnel_sim.effects.traits import Traits
from tunnel_sim.physics.run_settings import RunSettings, SettingsTable
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean
from tunnel_sim.vocabulary.record import Array

SPRING_TOLERANCE = 1e-6
"""Relative difference below which two stiffnesses belong to the same spring."""

NEAR_MOTION = 0.3
"""Distance, as a share of the motion's frequency, from it or a multiple within which a line belongs to the
motion."""

HARMONICS = (2.0, 3.0)
"""Multiples of the motion's frequency at which its harmonics lie."""

# share of the motion's frequency: nearer, a nonlinear spring has the same effect; judgement
_NEAREST_MODE = 0.04
_LEAST_BEATS = 0.5  # beats of two modes while both last: they have then been in phase and opposed; judgement

REFERENCE_RELEASE = 0.35
"""Release at which all forms of a second mode have the same amplitude, rad."""


#: Parameters of the moment law by name.
Law: TypeAlias = Mapping[str, float]

#: Random draw of a run for an effect: nothing, a phase in rad, or random numbers, shape (n,).
Drawn: TypeAlias = float | Array | None


@dataclass(frozen=True)
class Effect(Traits):
    """An effect that the nominal model leaves out.

    The first parameter is the severity; at zero severity (the null) the effect does nothing. A hook does nothing
    unless an effect overrides it. ``stated`` is the run as the campaign states it, without any effect; ``drawn`` is
    the value of `draw` for the run.
    """

    @classmethod
    def column(cls, effects: Sequence[Effect], name: str) -> Array:
        """A parameter of several effects of one class, in its unit, shape (effects,)."""
        return np.array([getattr(effect, name) for effect in effects], np.float64)

    def draw(self, stated: RunSettings, rng: np.random.Generator) -> Drawn:
        """Draw the random part of the effect in one run.

        Args:
            rng: the generator of this effect in this run.

        Returns:
            The value passed to the hooks as ``drawn``.
        """
        del stated, rng
        return None

    def drawn_number(self, drawn: Drawn) -> float:
        """The phase or instant that a run drew; without it the effect would silently do nothing.

        Returns:
            A phase in rad, or an instant as a share of the run.

        Raises:
            TunnelError: when no number was drawn.
        """
        if not isinstance(drawn, float):
            raise self._undrawn()
        return drawn

    def drawn_numbers(self, drawn: Drawn) -> Array:
        """The random numbers that a run drew; without them the effect would silently do nothing.

        Returns:
            The numbers, shape (n,).

        Raises:
            TunnelError: when none were drawn.
        """
        if not isinstance(drawn, np.ndarray):
            raise self._undrawn()
        return drawn

    def _undrawn(self) -> TunnelError:
        return TunnelError(
            "the random part of the run is missing",
            where=f"effect {self.name}",
            remedy="draw it with EffectChain.draw, or leave the effect out",
        )

    def law(self) -> Law:
        """The effect's parameters in the moment law, by name, for an effect that is a term of the law."""
        values = (getattr(self, info.name) for info in self.parameters())
        return dict(zip(self.law_terms, values, strict=False))

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Change the physics of runs in place; by default, set the effect's terms of the moment law.

        Args:
            runs: physics of the runs after the earlier effects.
            stated: as the campaign states them, without any effect.
            effects: effect in every run; their parameters may differ from run to run.
            drawn: random draw in every run.
        """
        del stated, drawn
        first = 0
        for _, members in itertools.groupby(effects, key=id):
            last = first + sum(1 for _ in members)
            runs.set(effects[first].law(), slice(first, last))
            first = last

    def moment_oracle(self, stated: RunSettings) -> Callable[[float, float, float], float] | None:
        """The moment that the effect adds, computed independently of its hooks, for ``tunnel effects check``.

        Returns:
            The moment (N m) as a function of time (s), angle (rad) and rate (rad/s); None: not stated.
        """
        del stated
        return None

    def to_json_dict(self) -> dict[str, Any]:
        """Name and parameters as plain JSON values."""
        parameters = {info.name: getattr(self, info.name) for info in self.parameters()}
        return {"name": self.name, "parameters": parameters}


def beats_with(frequency: Array | float, motion: Array | float, lasting: Array | float) -> Array:
    """Whether an oscillation near the motion is another mode: it beats with the motion while it lasts.

    Args:
        frequency: frequency of the oscillation, Hz.
        motion: frequency of the motion, Hz.
        lasting: time for which the oscillation is seen, s.

    Returns:
        True if it is another mode, in the broadcast shape.
    """
    apart = np.abs(np.asarray(frequency) - motion)
    return np.asarray((apart > _NEAREST_MODE * np.asarray(motion)) & (apart * lasting >= _LEAST_BEATS))


def make_effect(kind: type[Effect], parameters: Mapping[str, float]) -> Effect:
    """An effect from parameters by name, in their units."""
    known = [info.name for info in kind.parameters()]
    for name in parameters:
        if name not in known:
            remedy = did_you_mean(name, known)
            raise TunnelError(f"unknown parameter {name!r}", where=f"effect {kind.name}", remedy=remedy)
    return kind(**parameters)
