"""Rigs so heavily damped that the motion is over in three cycles of a record."""

import pytest

from diagnosis import diagnose
from tests.support.gap_campaigns import CN_BETA, campaign
from tunnel_sim.effects import effect_from

pytestmark = pytest.mark.usefixtures("causes_alone")


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        pytest.param(None, {}, marks=pytest.mark.slow),
        pytest.param("cubic_stiffness", {"coefficient": -1.0}, marks=pytest.mark.slow),
        pytest.param("quadratic_damping", {"coefficient": 0.02}, marks=pytest.mark.slow),
        ("coulomb_friction", {"friction_moment": 0.02}),
    ],
)
def test_a_heavily_damped_rig_is_diagnosed_like_any_other(name, parameters):
    """Of damping ratios 0.18 and 0.11, by spring."""
    effects = () if name is None else (effect_from(name, parameters),)
    found = diagnose(campaign(*effects, damping=0.48))
    assert found.causes == (() if name is None else (name,))
    assert found.coefficients.after["cn_beta"].value == pytest.approx(CN_BETA, rel=2e-3)
