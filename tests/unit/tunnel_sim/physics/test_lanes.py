"""Runs that are integrated side by side have the bits of those that are integrated alone."""

import numpy as np
import pytest

from tests.unit.tunnel_sim.physics.test_slopes import runs
from tunnel_sim.physics.forward import integrate

FORMS = {
    "linear": {},
    "friction": {"friction_moment": 0.01},
    "friction with a peak": {"friction_moment": 0.01, "friction_peak": 0.6, "friction_peak_rate": 0.5},
    "friction with a load": {"friction_load": 0.05, "gravity_stiffness": 0.4, "gravity_angle": 0.1},
    "other powers": {"moment_cubic": -2.0, "moment_cubic_exponent": 2.5, "damping_quadratic": 3.0},
    "gravity": {"gravity_stiffness": 0.4, "gravity_angle": 0.1},
}


@pytest.mark.parametrize("name", FORMS)
@pytest.mark.parametrize(("steps", "stride"), [(2, 1), (1, 3)])
def test_a_sampled_wind_has_the_same_bits_side_by_side(name, steps, stride):
    """A forcing of zero keeps a run from the others, and changes nothing else."""
    law, run = runs(FORMS[name], steps, stride, count=11)
    wind = 15.0 + np.random.default_rng(1).normal(size=(11, 20)).cumsum(axis=1)
    wind[4] = 0.0
    run["wind"] = wind.ctypes.data + wind.strides[0] * np.arange(11)
    run["wind_count"], run["wind_interval"] = 20, 0.1
    run["angle"] += 0.01 * np.arange(11)
    together = integrate(law, run, 400)
    nothing = np.zeros(1)
    run["forcing"], run["forcing_count"], run["forcing_interval"] = nothing.ctypes.data, 1, 1.0
    alone = integrate(law, run, 400)
    assert np.array_equal(together[0], alone[0])
    assert np.array_equal(together[1], alone[1])


def test_a_sampled_wind_of_one_value_is_a_constant_one():
    law, run = runs({}, count=3)
    constant, _, _ = integrate(law, run, 400)
    wind = np.full(4, 15.0)
    run["wind"], run["wind_count"], run["wind_interval"] = wind.ctypes.data, 4, 0.5
    assert np.array_equal(integrate(law, run, 400)[0], constant)
