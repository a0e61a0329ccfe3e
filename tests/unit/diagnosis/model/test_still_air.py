"""Runs with the wind off and stated springs state inertia and damping. Truth: the numbers of the runs."""

from dataclasses import replace

import pytest

from diagnosis import diagnose, vocabulary
from diagnosis.model.choose import nominal_model
from diagnosis.model.rig import SpringModel
from diagnosis.model.still_air import StillAir
from tests.support.gap_campaigns import DAMPING, INERTIA, campaign
from tunnel_sim.effects import effect_from

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

CONDITIONS = [(16.12, 0.0), (16.12, 0.0), (44.84, 0.0), (44.84, 0.0), (16.12, 20.0)]
FRICTION = effect_from("coulomb_friction", {"friction_moment": 0.004})
FEW = vocabulary(["coulomb_friction", "cubic_stiffness"])


def still(*effects):
    """Four runs with the wind off."""
    given = campaign(*effects, conditions=CONDITIONS)
    return replace(given, runs=tuple(run for run in given.runs if not run.wind_speed))


@pytest.mark.parametrize("effects", [(), (FRICTION,)])
def test_inertia_and_damping_are_stated_with_their_intervals(effects):
    found = diagnose(still(*effects), kinds=FEW)
    assert found.causes == tuple(effect.name for effect in effects)
    after = found.coefficients.after
    assert list(after) == ["yaw_inertia", "mechanical_damping"]
    for name, truth in (("yaw_inertia", INERTIA), ("mechanical_damping", DAMPING)):
        assert after[name].value == pytest.approx(truth, abs=4.0 * after[name].std)
        assert after[name].value == pytest.approx(truth, rel=0.01)
        assert after[name].std < 0.01 * truth
    assert "give no coefficients" not in str(found)


def test_a_run_with_the_wind_on_is_of_another_kind():
    assert type(nominal_model(still())) is StillAir
    assert type(nominal_model(campaign(conditions=CONDITIONS))) is SpringModel
