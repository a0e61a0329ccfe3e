"""The balance at the release: moments of spring and rod on the spring's end cancel, and both ways agree."""

import pytest

from tunnel_sim.physics.run_settings import RodTwist, RunSettings, released_by_spring_end, spring_end_angle
from tunnel_sim.vocabulary.plan import AeroDerivatives

SPRING, COMPLIANCE = 44.84, 3e-3


def run(twist=None):
    return RunSettings(SPRING, AeroDerivatives(0.4, -0.1), 0.1, 0.01, release_angle=0.35, rod_twist=twist)


def test_spring_and_rod_are_in_balance():
    end = spring_end_angle(run(RodTwist(COMPLIANCE, 0.1)))
    assert SPRING * end == pytest.approx((0.35 - end) / COMPLIANCE, rel=1e-12)


def test_a_release_by_the_end_is_undone():
    soft = released_by_spring_end(run(RodTwist(COMPLIANCE, 0.1)))
    assert soft.release_angle > 0.35
    assert spring_end_angle(soft) == pytest.approx(0.35, rel=1e-15)


def test_a_rigid_rod_changes_nothing():
    assert spring_end_angle(run()) == 0.35
    assert released_by_spring_end(run()) == run()
