"""Small campaigns for the tests of the reference simulator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tunnel_reference.true_conditions import TrueConditions


def rig(
    stiffness=(21.02, 67.98), speed=(0.0, 25.0), angle=(0.35, 0.3), duration=2.0, **changes
) -> TrueConditions:
    """Two runs by default: one in still air, one in the wind."""
    n = len(stiffness)
    base = TrueConditions(
        spring_stiffness=np.array(stiffness),
        wind_speed=np.array(speed),
        release_angle=np.array(angle),
        start_angle=np.array(angle),
        air_density=1.2,
        duration=duration,
        yaw_inertia=0.1,
        mechanical_damping=0.012,
        cn_beta=0.45,
        cn_r=-0.12,
        noise_std=4e-4,
        stiffness_scale=np.ones(n),
        speed_offset=np.zeros(n),
    )
    return replace(base, **changes)
