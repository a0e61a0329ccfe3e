"""Small campaigns for the tests of the reference simulator."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from tunnel_reference import draw, severity
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


@contextmanager
def short_campaigns(*, runs: int = 4, sample_rate: float = 250.0) -> Iterator[None]:
    """Draw every campaign with these few runs of 2 s, so that a set is made quickly; the motions are not exact."""
    conditions = ((21.02, 67.98, 21.02, 67.98), (0.0, 0.0, 25.0, 15.0), (0.35,) * 4)
    drawn = rig(*(values[:runs] for values in conditions), sample_rate=sample_rate)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(draw, "draw_conditions", lambda _rng: drawn)
        patch.setattr(severity, "_SUBSTEPS", 2)
        yield
