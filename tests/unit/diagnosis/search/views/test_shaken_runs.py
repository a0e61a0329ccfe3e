"""A strong cause beside a random moment: the nominal model loses the phase, and stretches hide the moment.

Truth: the engine's integrator, which draws the moment itself.
"""

from __future__ import annotations

import pytest

from diagnosis.answer.sizes_by_run import in_its_noise, sizes
from diagnosis.likelihood.starting_points import loses_phase
from diagnosis.search.investigate import investigate
from tests.marks import slow
from tests.support.gap_campaigns import CN_BETA, CN_R, CONDITIONS, DAMPING, INERTIA, nominal
from tunnel_sim.effects import effect_class
from tunnel_sim.engine.virtual_campaign import simulate_campaign
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.plan import CampaignPlan, Condition, EffectSetting, SensorModel, Truth

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

SPRING, FRICTION = "cubic_stiffness", "coulomb_friction"
STREAM, SURROUNDINGS = "buffeting", "ambient_vibration"
KINDS = tuple(map(effect_class, (SPRING, FRICTION, STREAM, SURROUNDINGS)))


def shaken(*names: str) -> Campaign:
    """Runs with effects of the size of their examples, which differ from the model by many degrees.

    Six runs, or three with a stream.
    """
    effects = []
    for kind in map(effect_class, names):
        parameters = (one.name for one in kind.parameters())
        effects.append(EffectSetting(kind.name, dict(zip(parameters, kind.example, strict=False))))
    some = CONDITIONS[::2] if STREAM in names else CONDITIONS
    conditions = (Condition(f"r{i}", k, v, 1.2, 0.35, 10.0) for i, (k, v) in enumerate(some, 1))
    truth = Truth(CN_BETA, CN_R, INERTIA, DAMPING)
    sensor = SensorModel(250.0, zero=0.002)
    return simulate_campaign(
        CampaignPlan("shaken", 7, truth, tuple(conditions), sensor, tuple(effects)), nthread=1
    )


@pytest.mark.parametrize(
    ("names", "others"),
    [
        ((STREAM, SPRING), (SURROUNDINGS,)),
        slow((STREAM, SPRING), (SURROUNDINGS, FRICTION)),
        slow((SPRING,), (FRICTION, STREAM, SURROUNDINGS)),
        slow((SURROUNDINGS, FRICTION), (SPRING, STREAM)),
        slow((FRICTION,), (SPRING, STREAM, SURROUNDINGS)),
    ],
)
def test_a_moment_is_named_after_stretches_where_there_is_one(
    names: tuple[str, ...], others: tuple[str, ...]
) -> None:
    data = shaken(*names)
    assert loses_phase(nominal(data))
    study = investigate(data, tuple(map(effect_class, (*names, *others))))
    assert study.causes == tuple(sorted(names))
    fit = in_its_noise(study)
    assert fit is not None
    sizes_by_run = list(sizes(fit, KINDS))
    assert all(cause.agrees for cause in sizes_by_run)
    assert len(sizes_by_run) == len({SPRING, FRICTION} & set(names))
    if study.moment is not None:  # the random motion is no error of the sensor
        assert not any(cause.agrees for cause in sizes(study.chosen, KINDS))
