"""Slips in records of a displacement: millimetres against metres, and units of springs and masses."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from identification import identify
from tests.support.linear import FORBIDDEN, linear_campaign
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Record


@pytest.fixture(scope="module")
def cart() -> Campaign:
    """A mass on two springs, with the noise of one sensor."""
    campaign, rng = (
        linear_campaign(2.0, (3.0, 5.0), (0.02, 0.01), noise=0.0, cycles=25),
        np.random.default_rng(5),
    )
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


def test_a_pushed_cart_without_a_spring_whose_runs_differ() -> None:
    """Dry friction, which the model lacks, differs from run to run as damping; there is no zero to be fitted."""
    time, rng, runs = np.arange(4000) / 100.0, np.random.default_rng(5), []
    for peak, phase in ((3.0, 1.0), (1.5, 2.0)):
        push = peak * (np.sin(2.0 * np.pi * (0.1 + 0.01 * time) * time) + 0.3 * np.sin(5.1 * time + phase))

        def slope(t: float, state: np.ndarray, push: np.ndarray = push) -> list[float]:
            v = state[1]
            return [v, (float(np.interp(t, time, push)) - 1.5 * v - 0.05 * np.tanh(v / 1e-3)) / 2.0]

        ends = (0.0, float(time[-1]))
        moved = solve_ivp(slope, ends, [0.0, 0.0], t_eval=time, rtol=1e-8, atol=1e-10, max_step=0.02).y[0]
        record = Record(time, moved + 5e-5 * rng.standard_normal(time.size))
        drive = Input("moment_nm", push, "linear")
        runs.append(Run(f"r{len(runs)}", record, 0.0, spring_stiffness=0.0, drive=drive))
    sensor = SensorProperties(motion="displacement")
    for given in (sensor, SensorProperties()):
        found = identify(Campaign("cart", RigProperties(yaw_inertia=2.0), given, tuple(runs)), throw=False)
        assert found.yaw_inertia is not None
        assert found.yaw_inertia.value == pytest.approx(2.0, rel=0.05)
        assert found.sensor_zero is None
        assert found.repeatability is not None
