"""Draws campaigns for training: the reference simulator's plans and common forms of effects, in wider ranges.

Rare forms and effects outside the vocabulary are never drawn; they are for tests. Sizes are not searched for in
every campaign, as in a blind set: each form is scaled once, and its sizes scatter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from tunnel_lab.training.motions import motions_of
from tunnel_reference.catalogue import Form, Group
from tunnel_reference.conditions import Conditions
from tunnel_reference.draw import CampaignDraw, EffectDraw, Mixture, draw_campaign
from tunnel_reference.forms import FORMS
from tunnel_reference.linear_families import LOST_SAMPLES, ROD
from tunnel_reference.severity import read_and_fit
from tunnel_reference.terms import Motion

SAMPLE_RATE = 250.0
"""Hz; the noise is reduced in proportion to the root of the rate, so that as much is known as at 1000 Hz."""
DURATION = 10.0
KINDS: Mapping[str, float] = {"none": 0.25, "single": 0.4, "pair": 0.15, "three": 0.12, "four": 0.08}
_MIXTURE = Mixture(textbook=0.4, rare=0.0)
_UNIT = 3.0  # excess at which the forms are scaled
_ROUNDS = 3


def draw_for_training(rng: np.random.Generator, sizes: Mapping[str, float]) -> CampaignDraw:
    """Draw one campaign.

    Args:
        sizes: magnitude of every form's parameter at the unit excess, by `label`.
    """
    kind = str(rng.choice(np.array(list(KINDS)), p=list(KINDS.values())))
    draw = draw_campaign(rng, kind=kind, mixture=_MIXTURE)
    while any(e.form.family == ROD for e in draw.effects) and len(draw.effects) > 1:
        draw = draw_campaign(rng, kind=kind, mixture=_MIXTURE)
    effects = tuple(
        replace(
            effect,
            extra={k: DURATION if k == "duration" else v for k, v in effect.extra.items()},
            value=_clipped(
                effect.form,
                sizes[label(effect.form)]
                * np.sqrt(effect.target / _UNIT)
                * float(np.exp(0.4 * rng.standard_normal())),
            ),
        )
        for effect in draw.effects
    )
    return replace(draw, conditions=_widened(rng, draw.conditions), effects=effects)


def label(form: Form) -> str:
    """Family and name of a form."""
    return f"{form.family}/{form.name}"


def at_low_rate(c: Conditions) -> Conditions:
    """The campaign at the sample rate of training: white noise carries as much information as before."""
    share = SAMPLE_RATE / c.sample_rate
    white = (1.0 - c.coloured_share) * c.noise_std**2 * share
    coloured = c.coloured_share * c.noise_std**2
    return replace(
        c,
        sample_rate=SAMPLE_RATE,
        duration=DURATION,
        noise_std=float(np.sqrt(white + coloured)),
        coloured_share=coloured / (white + coloured),
        noise_corner=min(c.noise_corner, 0.3 * SAMPLE_RATE),
        resolution=c.resolution * float(np.sqrt(share)),
        air_density=round(c.air_density, 4),  # as the campaign will state it
        stamp_step=0.0,
        time_scale=1.0,
        moment_scale=1.0,
    )


def _widened(rng: np.random.Generator, c: Conditions) -> Conditions:
    """The rig at the low rate; in half of the campaigns with coefficients from wider ranges."""
    c = at_low_rate(c)
    if rng.random() < 0.5:
        return c
    return replace(
        c,
        mechanical_damping=float(np.exp(rng.uniform(np.log(0.003), np.log(0.15)))),
        cn_beta=float(rng.uniform(-0.2, 0.8)),
        cn_r=float(-rng.uniform(0.0, 0.4)),
    )


def sizes_at_unit_excess(seed: int) -> dict[str, float]:
    """The magnitude at which each common form has about the unit excess, in one campaign."""
    forms = [form for form in FORMS if form.group is not Group.RARE]
    root = np.random.SeedSequence(seed)
    draws = []
    for form, child in zip(forms, root.spawn(len(forms)), strict=True):
        rng = np.random.default_rng(child)
        plain = draw_campaign(rng, kind="none", mixture=Mixture(variety=0.0))
        conditions = _first_runs(at_low_rate(plain.conditions), 9)
        extra = {k: float(v) for k, v in form.draw(rng, conditions).items()}
        effect = EffectDraw(form, extra, form.signs[-1], _UNIT, form.start)
        draws.append(replace(plain, conditions=conditions, effects=(effect,)))
    for _ in range(_ROUNDS):
        draws = [_nearer(draw, excess) for draw, excess in zip(draws, _excesses(draws), strict=True)]
    return {label(form): draw.effects[0].value for form, draw in zip(forms, draws, strict=True)}


def _first_runs(c: Conditions, number: int) -> Conditions:
    by_run = {name: value[:number] for name, value in vars(c).items() if np.shape(value) == (c.runs,)}
    return replace(c, **by_run)


def _excesses(draws: Sequence[CampaignDraw]) -> list[float]:
    return [_excess(draw, motion) for draw, motion in zip(draws, motions_of(draws, 1), strict=True)]


def _excess(draw: CampaignDraw, motion: Motion) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        try:
            return read_and_fit(draw, motion).excess
        except ValueError:  # the motion grows without bound
            return np.inf


def _nearer(draw: CampaignDraw, excess: float) -> CampaignDraw:
    effect = draw.effects[0]
    if np.isfinite(excess):
        factor = float(np.sqrt(_UNIT / max(excess, 0.03)))
    else:  # too much of an effect, or so small a lag that the steps do not resolve it
        factor = 3.0 if effect.value < effect.form.start else 0.1
    value = _clipped(effect.form, effect.value * float(np.clip(factor, 0.2, 10.0)))
    return replace(draw, effects=(replace(effect, value=value),))


def _clipped(form: Form, value: float) -> float:
    # At the low rate a sample is the least time that can be lost.
    lost = LOST_SAMPLES.get(label(form))
    least = form.limits[0] if lost is None else lost / SAMPLE_RATE
    return float(np.clip(value, least, form.limits[1]))
