"""Conditions of the reference campaigns; truth: the paper's table of springs."""

from __future__ import annotations

import numpy as np
import pytest

from tunnel_reference.draw import draw_conditions
from tunnel_sim.files.rig_file import load_rig


@pytest.mark.parametrize("seed", [s for s in range(15) if np.random.default_rng(s).random() < 0.8])
def test_the_twelve_runs_use_springs_of_the_rig(seed: int) -> None:
    drawn = draw_conditions(np.random.default_rng(seed))
    stiffness, speed, release = drawn.spring_stiffness, drawn.wind_speed, drawn.release_angle
    real = list(load_rig().springs.values())
    assert stiffness.size == speed.size == release.size == 12
    assert all(np.isclose(value, real).any() for value in stiffness)
    assert len(set(stiffness.tolist())) == 3
