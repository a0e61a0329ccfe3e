"""A run as a row of a table: what is read, changed and refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.reference.effect_cases import settings
from tests.reference.effect_oracle import Setting
from tunnel_sim.physics.run_settings import RodTwist, Series, SettingsTable
from tunnel_sim.vocabulary.errors import TunnelError

RUN = replace(
    settings(Setting(duration=1.0)), parameters={"friction_moment": 0.02}, rod_twist=RodTwist(1e-3, 0.3)
)


def test_a_row_is_the_run_as_it_was() -> None:
    table = SettingsTable.of([RUN, replace(RUN, wind_speed=0.0)])
    row = table.row(0)
    table["wind_speed"][:] = 3.0
    table["friction_moment"][:] = 0.0
    table.rod_twist[0] = None
    assert row == RUN
    now = replace(RUN, wind_speed=3.0, parameters={}, rod_twist=None)
    assert table.row(0) == now
    assert table.row(1) == replace(now, rod_twist=RUN.rod_twist)


def test_a_changed_copy_leaves_its_run() -> None:
    before = RUN.table.numbers.copy()
    slower = replace(RUN, wind_speed=0.5 * RUN.wind_speed, derivatives=replace(RUN.derivatives, cn_r=-1.0))
    assert np.array_equal(RUN.table.numbers, before)
    assert (slower.wind_speed, slower.derivatives.cn_r) == (0.5 * RUN.wind_speed, -1.0)
    assert slower.parameters == RUN.parameters


def test_a_deviating_wind_deviates_in_its_samples_too_and_is_never_negative() -> None:
    drifting = replace(RUN, series={"wind_speed": Series((10.0, 20.0), 1.0), "forcing": Series((1.0,), 1.0)})
    table = SettingsTable.of([drifting, RUN])
    table.deviate("wind_speed", np.array([0.1, -2.0]))
    assert table.series[0]["wind_speed"].values == pytest.approx((11.0, 22.0))
    assert table.series[0]["forcing"] == drifting.series["forcing"]
    assert table["wind_speed"] == pytest.approx([1.1 * RUN.wind_speed, 0.0])
    assert table.row(1) == replace(RUN, wind_speed=0.0)


@pytest.mark.parametrize("name", ["friction_momentum", "spring_stiffness"])
def test_a_name_without_a_column_of_its_own_is_refused(name: str) -> None:
    """A number with a field of its own would be stated twice."""
    table = SettingsTable.of([RUN])
    with pytest.raises(TunnelError, match=f"unknown parameter '{name}' of the moment law"):
        table.set({name: 1.0})
    with pytest.raises(TunnelError, match=f"unknown parameter '{name}' of the moment law"):
        replace(RUN, parameters={name: 1.0})
