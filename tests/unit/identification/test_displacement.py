"""Slips in records of a displacement: millimetres against metres, and units of springs and masses."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from identification import identify
from tests.support.linear import FORBIDDEN, linear_campaign
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record


@pytest.fixture(scope="module")
def cart() -> Campaign:
    """A mass on two springs, with the noise of one sensor."""
    campaign, rng = linear_campaign(2.0, (3.0, 5.0), (0.02, 0.01), noise=0.0), np.random.default_rng(5)
    runs = []
    for run in campaign.runs:
        reading = run.record.yaw_rad + 3e-5 * rng.standard_normal(run.record.yaw_rad.size)
        runs.append(replace(run, record=Record(run.record.time_s, reading)))
    return replace(campaign, runs=tuple(runs))


def test_the_mass_is_in_its_interval(cart: Campaign) -> None:
    found = identify(cart)
    assert found.yaw_inertia is not None
    assert found.yaw_inertia.unit == "kg"
    assert abs(found.yaw_inertia.value - 2.0) < 4.0 * found.yaw_inertia.known_std
    assert found.motion == "displacement"
    assert found.from_json_dict(found.to_json_dict()) == found
    assert not any("wind" in status.value for status in found.statuses)


def test_millimetres_in_a_column_of_metres(cart: Campaign) -> None:
    runs = list(cart.runs)
    runs[1] = replace(runs[1], record=Record(runs[1].record.time_s, 1e3 * runs[1].record.yaw_rad))
    with pytest.raises(
        TunnelError, match=r"run r02: amplitude and noise exceed .*: millimetres; name the column x_mm"
    ):
        identify(replace(cart, runs=tuple(runs)))


def test_a_spring_of_another_unit(cart: Campaign) -> None:
    runs = [replace(run, spring_stiffness=1e-3 * (run.spring_stiffness or 0.0)) for run in cart.runs]
    notes = " ".join(map(str, identify(replace(cart, runs=tuple(runs))).remarks))
    assert "it looks like mass in g, or spring_stiffness in N/mm" in notes
    assert not re.search(FORBIDDEN, notes)


def test_a_displacement_does_not_wrap(cart: Campaign) -> None:
    """A step of 2π m is not a turn."""
    run = cart.runs[0]
    reading = run.record.yaw_rad + np.where(run.record.time_s > 3.0, 2.0 * np.pi, 0.0)
    turned = replace(cart, runs=(replace(run, record=Record(run.record.time_s, reading)), *cart.runs[1:]))
    said = [str(remark) for remark in identify(turned.as_angle, throw=False).remarks]
    assert any("whole turns" in one for one in said)
    said = [str(remark) for remark in identify(turned, throw=False).remarks]
    assert not any("turn" in one for one in said)
