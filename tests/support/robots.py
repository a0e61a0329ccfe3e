"""Joints of small robots and what is diagnosed of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from diagnosis import read_model
from diagnosis.result import Diagnosis
from tunnel_sim.engine.joint_model import JointModel
from tunnel_sim.vocabulary.campaign import Campaign

TRUE = 'armature="0.05" damping="0.4"'
RUBS = f'{TRUE} frictionloss="0.6" solreffriction="0.002 1"'
KINDS = ("coulomb_friction", "quadratic_damping", "gravity_stiffness", "input_delay")


def own_model(
    folder: Path, data: Campaign, xml: str, free: Sequence[str] | None = None, **rest: Any
) -> JointModel:
    path = folder / "robot.xml"
    path.write_text(xml)
    return read_model(path, "elbow", data, free, **rest)


def inertia(xml: str) -> float:
    """Of the only joint, by MuJoCo's own mass matrix."""
    model = mujoco.MjModel.from_xml_string(xml)
    data, full = mujoco.MjData(model), np.zeros((1, 1))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, full)
    return float(full[0, 0])


def near(answer: Diagnosis, name: str, truth: float, extra: float = 0.0) -> bool:
    """Whether a coefficient or parameter is within three of its standard deviations; extra: of its value."""
    given = {**answer.coefficients.after, **answer.candidates[0].parameters}[name]
    assert given.std is not None
    return abs(given.value - truth) < 3.0 * given.std + extra * truth
