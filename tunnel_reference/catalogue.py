"""The definition of a form of an effect: family, law, and how its parameters are drawn and bound to runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from tunnel_reference.integrator import BoundLaw, Law, Phase
from tunnel_reference.readings import Order, ReadingLaw, ReadingTerm
from tunnel_reference.true_conditions import REFERENCE_LENGTH, Array, TrueConditions, TwistingRod

Extra = Mapping[str, float]
Draw = Callable[[np.random.Generator, TrueConditions], dict[str, float]]
Bound = BoundLaw | ReadingTerm
Bind = Callable[[float, Extra, TrueConditions], tuple[TrueConditions, Bound | None]]


class Group(StrEnum):
    """The distance of a form from the textbook."""

    TEXTBOOK = "textbook"
    COMMON = "common"
    RARE = "rare"  # not in tuning sets


def nothing(_rng: np.random.Generator, _conditions: TrueConditions) -> dict[str, float]:
    """No secondary parameters."""
    return {}


@dataclass(frozen=True, eq=False)
class Form:
    """One form of one family of effects.

    Args:
        family: public name of the effect, or ``unknown``.
        symbol: symbol and unit of the severity parameter.
        start: a typical magnitude of the severity parameter.
        bind: (severity parameter, secondary parameters, conditions) → changed conditions and term.
        signs: possible signs of the severity parameter.
        draw: draws secondary parameters, including random seeds.
        limits: least and greatest magnitude of the severity parameter.
        driven: whether the form acts on driven runs only.
        edition: first edition of the catalogue with this form; a published set is drawn from the edition of its
            time.
        until: last edition of the catalogue with this form; None if the latest edition has it.
    """

    family: str
    name: str
    group: Group
    symbol: str
    start: float
    bind: Bind
    signs: tuple[int, ...] = (1,)
    draw: Draw = nothing
    limits: tuple[float, float] = (1e-9, 1e9)
    driven: bool = False
    edition: int = 1
    until: int | None = None


def spread(value: float | Array, conditions: TrueConditions) -> Array:
    """A parameter as one value per run."""
    return np.broadcast_to(np.asarray(value, dtype=np.float64), (conditions.runs,)).copy()


ParamMaker = Callable[[float, Extra, TrueConditions], dict[str, float | Array]]


def _spread_all(values: dict[str, float | Array], c: TrueConditions) -> dict[str, Array]:
    """All parameters, with the runs as first axis."""
    return {k: v if isinstance(v, np.ndarray) and v.ndim == 2 else spread(v, c) for k, v in values.items()}


def moving(law: Law, phase: Phase, make: ParamMaker, *, states: int = 0, at_release: bool = True) -> Bind:
    """Bind a law of the motion.

    Args:
        make: a function that gives the parameters by run from severity parameter, secondary parameters and
            conditions.
        states: number of states per run.
        at_release: whether the states start at the release angle; otherwise at zero.
    """

    def bind(p: float, extra: Extra, c: TrueConditions) -> tuple[TrueConditions, Bound | None]:
        memory = None
        if states:
            memory = np.tile(c.start_angle, (states, 1)) if at_release else np.zeros((states, c.runs))
        return c, BoundLaw(law, phase, _spread_all(make(p, extra, c), c), memory)

    return bind


def reading(law: ReadingLaw, order: Order, make: ParamMaker) -> Bind:
    """Bind a law of the sensor."""

    def bind(p: float, extra: Extra, c: TrueConditions) -> tuple[TrueConditions, Bound | None]:
        return c, ReadingTerm(law, order, _spread_all(make(p, extra, c), c))

    return bind


def calibration(change: Callable[[float, Extra, TrueConditions], TrueConditions]) -> Bind:
    """Bind an effect that only changes the conditions."""

    def bind(p: float, extra: Extra, c: TrueConditions) -> tuple[TrueConditions, Bound | None]:
        return change(p, extra, c), None

    return bind


def one_spring(p: float, extra: Extra, c: TrueConditions) -> TrueConditions:
    """One spring (1 + x) times as stiff as stated."""
    springs = np.unique(c.spring_stiffness)
    chosen = springs[int(extra["spring"]) % springs.size]
    return replace(c, stiffness_scale=np.where(c.spring_stiffness == chosen, 1.0 + p, 1.0))


def speed_offset(p: float, extra: Extra, c: TrueConditions) -> TrueConditions:
    """True speed V + ΔV (20/V)^n where the wind is on."""
    ratio = 20.0 / np.where(c.wind_on, c.wind_speed, 20.0)
    return replace(c, speed_offset=p * ratio ** extra["exponent"])


def flexible_rod(p: float, extra: Extra, c: TrueConditions) -> TrueConditions:
    """A rod of compliance p."""
    rod = TwistingRod(p, extra["share"], extra["damping_ratio"], extra["hardening"], extra["held_body"] > 0.5)
    return replace(c, rod=rod)


def lag_time(p: float, c: TrueConditions) -> Array:
    """τ = p l/V at the true speed; 1 s where the wind is off (Ka is zero there)."""
    return np.where(c.wind_on, p * REFERENCE_LENGTH / np.where(c.wind_on, c.true_speed, 1.0), 1.0)


ROD = "rod_flexibility"
"""Simulated in closed form, alone: its own oscillation is too fast for the steps."""

LINEAR_IN_A_RECORD = frozenset(
    {
        "structural_damping",
        "gravity_stiffness",
        ROD,
        "unsteady_aero_lag",
        "spring_miscalibration",
        "wind_speed_offset",
        "wind_speed_drift",
    }
)
"""One record of these is another damped oscillation: it shows its own decay, not the stated rig's."""

LOST_SAMPLES: Mapping[str, int] = {"dropped_samples/one_instant": 1, "dropped_samples/three_instants": 3}
"""Least number of samples lost by a form, by family and name."""
