"""What the runs of a campaign cannot show."""

import pytest

from diagnosis.model.rig import SpringModel
from tests.support.gap_campaigns import campaign, nominal

SPRING = 16.12


@pytest.mark.parametrize(
    ("conditions", "tested"),
    [
        (((SPRING, 0.0), (SPRING, 15.0)), False),
        (((SPRING, 0.0), (SPRING, 15.0), (SPRING, 15.0)), True),
    ],
)
def test_as_many_numbers_as_coefficients_show_no_scatter(conditions, tested):
    """Two runs give two frequencies and two dampings, which Izz, Cr, Cnβ and Cnr fit exactly."""
    data = nominal(campaign(conditions=conditions, duration=2.0)).problem.data
    said = SpringModel().among(data.runs).blind_spots(data)
    assert any(spot.startswith("how well runs repeat") for spot in said) != tested
