"""Conditions of the reference campaigns; truth: the paper's table of springs."""

from __future__ import annotations

import numpy as np
import pytest

from tunnel_reference.draw import _twelve_runs
from tunnel_sim.files.rig_file import load_rig


@pytest.mark.parametrize("seed", range(12))
def test_the_twelve_runs_use_springs_of_the_rig(seed: int) -> None:
    stiffness, speed, release = _twelve_runs(np.random.default_rng(seed))[:3]
    real = list(load_rig().springs.values())
    assert stiffness.size == speed.size == release.size == 12
    assert all(np.isclose(value, real).any() for value in stiffness)
    assert len(set(stiffness.tolist())) == 3
