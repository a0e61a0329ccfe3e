"""Campaigns of the reference simulator, and the closer method, for the tutorial on the paper's networks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tunnel_lab.paper.networks import CONVENTIONAL, METHODS, NETWORK, Closeness
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.plan import Truth


def reference_campaigns(count: int, seed: int, *, softening: bool) -> list[tuple[Campaign, Truth]]:
    """Campaigns of the reference simulator; its integrator and laws are independent of the virtual rig.

    Args:
        count: number of campaigns, each with different conditions and truth.
        softening: whether the spring softens and the damping grows with the amplitude, as in `SOFTENING`.
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


@dataclass(frozen=True)
class Verdict:
    """Comparison of the network with the conventional method over many campaigns.

    Args:
        rms: root mean square of each method's quantity, % of the truth or of the release angle.
        closer: number of campaigns in which the network's error is smaller than the conventional method's.
    """

    rms: Mapping[str, float]
    closer: int
    total: int


def verdict(rows: Sequence[Mapping[str, Closeness]], quantity: str) -> Verdict:
    """Count and average over campaigns that every method answered.

    Args:
        quantity: ``cn_beta``, ``cn_r`` or ``response``.
    """
    whole = [row for row in rows if all(method in row for method in METHODS)]
    values = {m: np.array([getattr(row[m], quantity) for row in whole]) for m in METHODS}
    return Verdict(
        {m: float(np.sqrt(np.mean(v**2))) for m, v in values.items()},
        int(np.sum(np.abs(values[NETWORK]) < np.abs(values[CONVENTIONAL]))),
        len(whole),
    )
