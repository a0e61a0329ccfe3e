"""Disturbances of one run: a blow, a push, and a bump of the reading. They are not a family of effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tunnel_reference.catalogue import Bind, Bound, Extra, Form, Group
from tunnel_reference.draw import CampaignDraw, EffectDraw
from tunnel_reference.integrator import BoundLaw, Params, Phase, Rows, RungeKuttaStage
from tunnel_reference.readings import Order, ReadingTerm, SensorSignal
from tunnel_reference.severity import size_effects
from tunnel_reference.true_conditions import Array, TrueConditions

DISTURBANCE = "disturbance"
"""Family of the forms below."""
_BLOW, _PUSH = 0.02, 0.2  # s
_BETWEEN = (0.15, 0.85)  # range of the disturbance, in shares of the run
_EXCESS = (0.3, 10.0)  # of the campaign, in noise variances


def _half_sine(time: float | Array, at: Array, length: Array) -> Array:
    """A half sine of height 1 that begins at an instant, and 0 outside it."""
    since = (time - at) / length
    return np.where((since > 0.0) & (since < 1.0), np.sin(np.pi * np.clip(since, 0.0, 1.0)), 0.0)


def pushed(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """M sin(π (t − t0)/d) for t0 < t < t0 + d, in one run."""
    s.top[rows] += p["size"] * _half_sine(s.time, p["at"], p["length"])


def bumped(r: SensorSignal, p: Params) -> Array:
    """The reading with a half sine added in one run."""
    return r.value + p["size"] * _half_sine(r.conditions.time[: len(r.value), None], p["at"], p["length"])


def _in_one_run(size: float, extra: Extra, c: TrueConditions) -> dict[str, Array]:
    hit = np.arange(c.runs) == int(extra["run"])
    return {
        "size": np.where(hit, size, 0.0),
        "at": np.full(c.runs, extra["at"]),
        "length": np.full(c.runs, extra["length"]),
    }


def _moment(size: float, extra: Extra, c: TrueConditions) -> tuple[TrueConditions, Bound | None]:
    return c, BoundLaw(pushed, Phase.MOMENT, _in_one_run(size, extra, c))


def _reading(size: float, extra: Extra, c: TrueConditions) -> tuple[TrueConditions, Bound | None]:
    return c, ReadingTerm(bumped, Order.ADDED, _in_one_run(size, extra, c))


def _form(name: str, symbol: str, start: float, bind: Bind) -> Form:
    return Form(DISTURBANCE, name, Group.RARE, symbol, start, bind, signs=(-1, 1))


FORMS = {
    "blow": (_form("a blow", "M N m", 0.3, _moment), _BLOW),
    "push": (_form("a push", "M N m", 0.03, _moment), _PUSH),
    "bump": (_form("a bump of the reading", "size rad", 0.01, _reading), _PUSH),
}
"""Forms with their lengths, s, by name."""


def with_disturbances(draws: Sequence[CampaignDraw], rng: np.random.Generator) -> list[CampaignDraw]:
    """Campaigns with a disturbance in one run each.

    Args:
        draws: campaigns after their effects have been scaled.
        rng: source of the random run, instant, form, sign and size.
    """
    added = [_draw(rng, draw.conditions) for draw in draws]
    alone = [replace(draw, effects=(one,)) for draw, one in zip(draws, added, strict=True)]
    return [
        replace(draw, effects=(*draw.effects, *sized.effects))
        for draw, sized in zip(draws, size_effects(alone), strict=True)
    ]


def _draw(rng: np.random.Generator, c: TrueConditions) -> EffectDraw:
    form, length = FORMS[str(rng.choice(np.array(list(FORMS))))]
    target = float(np.exp(rng.uniform(*np.log(_EXCESS))))
    run = int(rng.integers(c.runs))
    span = c.duration * float(np.broadcast_to(c.kept, (c.runs,))[run])
    extra = {"run": float(run), "at": float(rng.uniform(*_BETWEEN)) * span, "length": length}
    return EffectDraw(form, extra, int(rng.choice([-1, 1])), target, form.start, small=True)
