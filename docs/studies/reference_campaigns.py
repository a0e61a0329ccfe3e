"""Campaigns of the reference simulator for the tutorial on the paper's networks."""

from __future__ import annotations

import numpy as np

from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.plan import Truth


def reference_campaigns(count: int, seed: int, *, softening: bool) -> list[tuple[Campaign, Truth]]:
    """Campaigns of the reference simulator, whose integrator and laws are not those of the virtual rig.

    Args:
        count: number of campaigns, of conditions and truth of their own.
        softening: with a spring that softens and a damping that grows with the amplitude, as in `SOFTENING`.
    """
    from tunnel_reference.draw import CampaignDraw, EffectDraw, draw_conditions
    from tunnel_reference.forms import forms_of
    from tunnel_reference.make import as_campaign
    from tunnel_reference.severity import read_and_fit, simulate_motions

    rng = np.random.default_rng(seed)
    sized = (("cubic_stiffness", -1, 0.39), ("quadratic_damping", 1, 0.0038)) if softening else ()
    effects = tuple(EffectDraw(forms_of(family)[0], {}, sign, 0.0, value) for family, sign, value in sized)
    kind = "pair" if softening else "none"
    draws = [
        CampaignDraw(kind, draw_conditions(rng), effects, int(rng.integers(2**31))) for _ in range(count)
    ]
    found = []
    for number, (draw, motion) in enumerate(zip(draws, simulate_motions(draws, fine=False), strict=True)):
        c = draw.conditions
        truth = Truth(c.cn_beta, c.cn_r, c.yaw_inertia, c.mechanical_damping)
        found.append((as_campaign(read_and_fit(draw, motion), f"reference-{number + 1}"), truth))
    return found
