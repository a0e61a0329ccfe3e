"""The truth of scores with a lag: the derivatives in phase, against those of the reference simulator."""

import numpy as np
import pytest

from tests.reference.test_in_phase import drawn
from tunnel_lab.experiments.bounds import in_phase
from tunnel_reference.in_phase import in_phase as reference
from tunnel_sim.effects import effect_from
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.plan import Truth


@pytest.mark.parametrize(("form", "sign"), [("lag", 1.0), ("lead", -1.0)])
def test_both_simulators_have_one_truth(form, sign):
    draw = drawn(form, 0.4, {}, np.random.default_rng(4))
    c = draw.conditions
    truth = Truth(c.cn_beta, c.cn_r, c.yaw_inertia, c.mechanical_damping)
    conditions = [(float(c.spring_stiffness[0]), float(c.wind_speed[0]), float(c.air_density))]
    found = in_phase(truth, [effect_from("unsteady_aero_lag", {"lag": 0.4 * sign})], conditions, load_rig())
    wanted = reference(draw)
    assert (found.cn_beta, found.cn_r) == pytest.approx((wanted["cn_beta"], wanted["cn_r"]), rel=1e-3)
    assert abs(found.cn_r / c.cn_r - 1.0) > 0.2


def test_other_effects_leave_the_truth():
    truth = Truth(0.5, -0.1, 0.1, 0.01)
    friction = effect_from("coulomb_friction", {"friction_moment": 0.01})
    assert in_phase(truth, [friction], [(20.0, 15.0, 1.2)], load_rig()) == truth
