"""Rigs so heavily damped that the motion is over in three cycles of a record."""

import pytest

from diagnosis import diagnose, vocabulary
from tests.marks import slow
from tests.support.gap_campaigns import CN_BETA, campaign
from tunnel_sim.effects import ALL_EFFECTS, effect_from

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

FEW = vocabulary(["coulomb_friction", "quadratic_damping", "cubic_stiffness", "structural_damping"])


@pytest.mark.parametrize(
    ("name", "parameters", "kinds"),
    [
        slow(None, {}, ALL_EFFECTS),
        slow("cubic_stiffness", {"coefficient": -1.0}, ALL_EFFECTS),
        slow("quadratic_damping", {"coefficient": 0.02}, ALL_EFFECTS),
        slow("coulomb_friction", {"friction_moment": 0.02}, ALL_EFFECTS),
        ("coulomb_friction", {"friction_moment": 0.02}, FEW),
    ],
)
def test_a_heavily_damped_rig_is_diagnosed_like_any_other(name, parameters, kinds):
    """Of damping ratios 0.18 and 0.11, by spring."""
    effects = () if name is None else (effect_from(name, parameters),)
    found = diagnose(campaign(*effects, damping=0.48), kinds=kinds, rivals=())
    assert found.causes == (() if name is None else (name,))
    assert found.coefficients.after["cn_beta"].value == pytest.approx(CN_BETA, rel=2e-3)
