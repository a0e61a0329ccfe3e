"""Whether a well-designed campaign could show an effect, and distinguish it from every other effect."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import ClassVar

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.starting_points import unabsorbed
from diagnosis.model.blocks import prepare
from diagnosis.search.prepared import fit_nominal
from tunnel_sim.effects import Effect, known_effects
from tunnel_sim.effects.capabilities import OwnNumbers
from tunnel_sim.effects.registry import answering_with
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, SensorProperties
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.plan import CampaignPlan, Condition, SensorModel, Truth

ABSORBED = 0.01
"""Share of an effect's change below which the nominal model hides it."""

ALIKE = 0.99
"""Cosine from which two effects need a signal of 22 detection sigmas to be distinguished (3/√(1 − cos²))."""


@dataclass(frozen=True)
class Identifiability:
    """Visibility of an effect beside the nominal model and the other effects.

    Args:
        share: share of the effect's change of the readings that the nominal model cannot absorb, a ratio of
            norms.
        cosines: absolute cosine between this change and the change by another effect, by name, greatest first.
        driven: whether the runs were driven, because the effect acts on the input.
    """

    LAW: ClassVar[str] = (
        "The nominal model does not absorb it, and no other effect has the same influence on the motion"
    )

    share: float
    cosines: Mapping[str, float]
    driven: bool = False

    @property
    def fault(self) -> str:
        """The reason why the effect cannot be identified; empty where it can."""
        if self.share < ABSORBED:
            return f"the nominal model absorbs all but {100.0 * self.share:.2g} % of it"
        alike = [name for name, cosine in self.cosines.items() if cosine > ALIKE]
        return f"it has the same influence on the motion as {' and '.join(alike)}" if alike else ""

    def lines(self) -> list[str]:
        """The figures in words."""
        nearest = [f"{name} {cosine:.3f}" for name, cosine in list(self.cosines.items())[:5]]
        return [
            f"On 24 simulated {'driven ' if self.driven else ''}runs (3 springs, wind off and at 3 speeds, 2 "
            "releases) the nominal model cannot absorb "
            f"{100.0 * self.share:.1f} % of its change of the readings.",
            f"Cosine of this part with the nearest effects: {', '.join(nearest)}.",
        ]


def identifiability(kind: type[Effect]) -> Identifiability:
    """Compare the unabsorbed change by an effect with the changes by all known effects.

    By linear theory at typical sizes. Effects that are not fitted as a motion (random moments, periodic effects,
    missing samples, coarse steps) are left out.
    """
    base = _nominal(driven=kind.driven)
    own = unabsorbed(base, kind)
    if own is None:
        return Identifiability(0.0, {}, kind.driven)
    found = {}
    with answering_with([kind]):
        others = [other for other in known_effects() if other.name != kind.name]
    for other in others:
        if other.fitted and not issubclass(other, OwnNumbers):
            left = unabsorbed(base, other)
            if left is not None:
                size = float(np.linalg.norm(own[0]) * np.linalg.norm(left[0]))
                found[other.name] = abs(float(own[0] @ left[0])) / size if size > 0.0 else 0.0
    return Identifiability(own[1], dict(sorted(found.items(), key=lambda pair: -pair[1])), kind.driven)


@cache
def _nominal(*, driven: bool) -> Fit:
    """The nominal fit of a campaign without any effect.

    A driven campaign has a moment beside the release: a chirp from 1 to 5 Hz, over all resonances.
    """
    from tunnel_sim.engine.effect_laws import record  # imported here because it loads MuJoCo
    from tunnel_sim.engine.virtual_campaign import run_settings, simulate_campaign, stated_run

    conditions = tuple(
        Condition(f"s{spring:g}-v{speed:g}-a{degrees:g}", spring, speed, 1.204, math.radians(degrees), 8.0)
        for spring in (16.12, 21.02, 44.84)
        for speed in (0.0, 10.0, 16.0, 24.0)
        for degrees in (8.0, 20.0)
    )
    truth, sensor = Truth(0.47, -0.12, 0.1014, 0.018), SensorModel(sample_rate=200.0)
    plan = CampaignPlan("laws", 1, truth, conditions, sensor)
    if driven:
        runs = []
        for number, condition in enumerate(conditions):
            time = np.arange(round(condition.duration * sensor.sample_rate)) / sensor.sample_rate
            values = 0.5 * np.sin(2.0 * np.pi * (1.0 + 2.0 * time / condition.duration) * time)
            settings = replace(run_settings(truth, condition), drive=InputMoment(time, values))
            seen = record((), settings, np.random.default_rng([plan.seed, number]), sensor)
            runs.append(replace(stated_run(condition, seen), drive=Input("moment_nm", values)))
        stated = RigProperties.of(load_rig()), SensorProperties.of(sensor)
        campaign = Campaign(plan.name, *stated, tuple(runs))
    else:
        campaign = simulate_campaign(plan)
    return fit_nominal(prepare(campaign, {run.id: sensor.noise_std**2 for run in campaign.runs}))
