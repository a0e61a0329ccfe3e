"""What multiplies the coefficients in a run. Truth: the product by hand, and the range that squares leave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.campaign.derivatives import loads
from tunnel_sim.vocabulary.campaign import RigProperties, Run
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record

RIG = RigProperties(None, 0.04, 0.5, None)
RUN = Run("r1", Record(np.arange(2.0), np.zeros(2)), 10.0, 16.0, 1.2, 0.35)


def test_the_loads_are_the_products() -> None:
    assert loads(RUN, RIG) == pytest.approx((0.5 * 1.2 * 100.0 * 0.04 * 0.5, 0.5 * 1.2 * 10.0 * 0.04 * 0.25))
    assert loads(RUN, replace(RIG, frontal_area=None)) == pytest.approx((60.0, 6.0))
    assert loads(replace(RUN, wind_speed=0.0, air_density=None), RIG) == (0.0, 0.0)


def test_a_density_is_needed_where_a_stiffness_or_a_size_is_stated() -> None:
    bare = replace(RUN, air_density=None, spring_stiffness=None)
    assert loads(bare, RigProperties()) == pytest.approx((50.0, 5.0))
    for run, rig in (
        (bare, RIG),
        (bare, RigProperties(reference_length=0.5)),
        (replace(RUN, air_density=None), RigProperties()),
    ):
        with pytest.raises(TunnelError, match="run r1: wind-on run without air_density"):
            loads(run, rig)


@pytest.mark.parametrize(
    "changes",
    [
        {"spring_stiffness": 1e-200},
        {"spring_stiffness": 1e200},
        {"air_density": 1e-200},
        {"wind_speed": 1e120},
    ],
)
def test_a_number_whose_square_is_none_is_refused_in_one_line(changes: dict[str, float]) -> None:
    with pytest.raises(TunnelError, match=r"run r1: .* is out of range; correct its unit") as caught:
        loads(replace(RUN, **changes), RIG)  # type: ignore[arg-type]
    assert str(caught.value).isprintable()
