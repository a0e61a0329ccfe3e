"""A strong cause beside a random moment: the nominal model loses the phase, and stretches hide the moment.

Truth: the engine's integrator, which draws the moment itself.
"""

from __future__ import annotations

import pytest

from diagnosis.likelihood.starting_points import loses_phase
from diagnosis.search.investigate import investigate
from tests.marks import slow
from tests.support.gap_campaigns import CN_BETA, CN_R, CONDITIONS, DAMPING, INERTIA, nominal
from tunnel_sim.effects import effect_class
from tunnel_sim.engine.virtual_campaign import simulate_campaign
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.plan import CampaignPlan, Condition, EffectSetting, SensorModel, Truth

SPRING, FRICTION = "cubic_stiffness", "coulomb_friction"
STREAM, SURROUNDINGS = "buffeting", "ambient_vibration"
KINDS = tuple(map(effect_class, (SPRING, FRICTION, STREAM, SURROUNDINGS)))


def shaken(*names: str) -> Campaign:
    """Six runs with effects of the size of their examples, which differ from the model by many degrees."""
    effects = []
    for kind in map(effect_class, names):
        parameters = (one.name for one in kind.parameters())
        effects.append(EffectSetting(kind.name, dict(zip(parameters, kind.example, strict=False))))
    conditions = (Condition(f"r{i}", k, v, 1.2, 0.35, 10.0) for i, (k, v) in enumerate(CONDITIONS[::2], 1))
    truth = Truth(CN_BETA, CN_R, INERTIA, DAMPING)
    sensor = SensorModel(250.0, zero=0.002)
    return simulate_campaign(
        CampaignPlan("shaken", 7, truth, tuple(conditions), sensor, tuple(effects)), nthread=1
    )


@pytest.mark.parametrize(
    "names", [(STREAM, SPRING), slow((SPRING,)), slow((SURROUNDINGS, FRICTION)), slow((FRICTION,))]
)
def test_a_moment_is_named_after_stretches_where_there_is_one(names: tuple[str, ...]) -> None:
    data = shaken(*names)
    assert loses_phase(nominal(data))
    assert investigate(data, KINDS).causes == tuple(sorted(names))
