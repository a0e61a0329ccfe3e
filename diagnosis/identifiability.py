"""Whether a campaign of good design could show an effect, and distinguish it from every other."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import ClassVar

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.prepare import prepare
from diagnosis.likelihood.starting_points import unabsorbed
from diagnosis.search.investigate import fit_nominal
from tunnel_sim.effects import Effect, known_effects
from tunnel_sim.effects.registry import answering_with
from tunnel_sim.vocabulary.plan import CampaignPlan, Condition, SensorModel, Truth

ABSORBED = 0.01
"""Share of an effect's change below which the nominal model hides it."""

ALIKE = 0.99
"""Cosine from which two effects need a signal of 22 detection sigmas to be distinguished (3/√(1 − cos²))."""


@dataclass(frozen=True)
class Identifiability:
    """How an effect shows beside the nominal model and the other effects.

    Args:
        share: of the effect's change of the readings that the nominal model cannot absorb, a ratio of norms.
        cosines: absolute cosine between that and the same of another effect, by name, greatest first.
    """

    LAW: ClassVar[str] = "The nominal model does not hide it, and no other effect moves the rig as it does"

    share: float
    cosines: Mapping[str, float]

    @property
    def fault(self) -> str:
        """Why the effect cannot be identified; empty where it can."""
        if self.share < ABSORBED:
            return f"the nominal model absorbs all but {100.0 * self.share:.2g} % of it"
        alike = [name for name, cosine in self.cosines.items() if cosine > ALIKE]
        return f"it moves the rig as {' and '.join(alike)} does" if alike else ""

    def lines(self) -> list[str]:
        """The figures in words."""
        nearest = [f"{name} {cosine:.3f}" for name, cosine in list(self.cosines.items())[:5]]
        return [
            "On 12 simulated runs (3 springs, wind off and on, 2 releases) the nominal model cannot absorb "
            f"{100.0 * self.share:.1f} % of its change of the readings.",
            f"Cosine of that with the nearest effects: {', '.join(nearest)}.",
        ]


def identifiability(kind: type[Effect]) -> Identifiability:
    """Compare what an effect leaves beside the nominal model with what every known effect leaves.

    Args:
        kind: the effect, registered or not.

    Returns:
        The comparison by linear theory at typical sizes. Effects that are not fitted as a motion (random moments,
        periodic effects, missing samples, coarse steps) are left out.
    """
    base = _nominal()
    own = unabsorbed(base, kind)
    if own is None:
        return Identifiability(0.0, {})
    found = {}
    with answering_with([kind]):
        others = [other for other in known_effects() if other.name != kind.name]
    for other in others:
        if other.fitted and not (other.line or other.skips):
            left = unabsorbed(base, other)
            if left is not None:
                found[other.name] = _cosine(own[0], left[0])
    return Identifiability(own[1], dict(sorted(found.items(), key=lambda pair: -pair[1])))


def _cosine(one: np.ndarray, other: np.ndarray) -> float:
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return abs(float(one @ other)) / size if size > 0.0 else 0.0


@cache
def _nominal() -> Fit:
    """The nominal fit of a campaign without any effect."""
    from tunnel_sim.engine.virtual_campaign import simulate_campaign  # only here: loads MuJoCo

    conditions = tuple(
        Condition(f"s{spring:g}-v{speed:g}-a{degrees:g}", spring, speed, 1.204, math.radians(degrees), 8.0)
        for spring in (16.12, 21.02, 44.84)
        for speed in (0.0, 20.0)
        for degrees in (8.0, 20.0)
    )
    truth, sensor = Truth(0.47, -0.12, 0.1014, 0.018), SensorModel(sample_rate=200.0)
    campaign = simulate_campaign(CampaignPlan("laws", 1, truth, conditions, sensor))
    variance = {run.id: sensor.noise_std**2 for run in campaign.runs}
    return fit_nominal(prepare(campaign, variance))
