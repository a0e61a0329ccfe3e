"""What the engine makes of a patched joint."""

import mujoco
import pytest

from tunnel_sim.engine.joint_patch import creep_rate

HUNG = """<mujoco><worldbody><body><joint name="elbow" axis="0 1 0" frictionloss="{}"/>
<geom type="sphere" size="0.01" mass="0.2" pos="0 0 -0.25"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize(("friction", "creeps"), [(0.01, True), (1e-6, False)])
def test_friction_below_the_moment_at_the_rest_has_no_rate_of_creep(friction: float, creeps: bool) -> None:
    """At 0.001 rad the weight's moment is 0.5 mN m."""
    assert (creep_rate(mujoco.MjModel.from_xml_string(HUNG.format(friction)), 1e-3) > 0.0) == creeps
