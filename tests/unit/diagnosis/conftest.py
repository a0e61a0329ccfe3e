"""A campaign with damping that grows with the rate, which the nominal model lacks."""

import pytest

from tests.support.gap_campaigns import campaign, nominal
from tunnel_sim.effects import effect_from


@pytest.fixture(scope="package")
def data():
    return campaign(effect_from("quadratic_damping", {"coefficient": 0.003}), duration=10.0)


@pytest.fixture(scope="package")
def base(data):
    return nominal(data)
