"""One mjData and two models, each case in a process of its own: a crash fails the test and no more."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.marks import slow

ROOT = Path(__file__).parents[4]
START = """
import mujoco, numpy as np
from tests.support.small_model import small_model

def model(numerics=None, config=None, edit=lambda text: text):
    text = edit(small_model(numerics, config or {"joint": "yaw"}))
    return mujoco.MjModel.from_xml_string(text)

def moments(model, data):
    mujoco.mj_resetData(model, data)
    data.joint("yaw").qpos = 0.3
    mujoco.mj_forward(model, data)
    first = [*data.qfrc_passive, *data.sensordata]
    mujoco.mj_step(model, data, 50)
    return [*first, *data.qpos, *data.qvel, *data.plugin_state, *data.sensordata]

def refused(action, model, data):
    data.joint("yaw").qpos = 0.3
    try:
        action(model, data)
    except mujoco.FatalError as error:
        assert "mjData was made for a model of other sizes" in str(error), error
    else:
        raise AssertionError("no error")
"""
FEW = "model()"
MANY = 'model({"gravity_stiffness": "0.5", "aero_lag": "2", "moment_cubic": "1", "user_" + 300 * "x": "1"})'
OTHER = 'model({"user_a": "9", "gravity_stiffness": "0.5"})'
SERIES = 'model({"wind_speed": " ".join(["18"] * 400), "wind_speed_interval": "0.01"})'
ELSEWHERE = 'model(config={"joint": "twist"}, edit=lambda text: text.replace(\'joint="yaw"\', ""))'
TWISTING = 'model({"aero_lag": "2"}, {"joint": "yaw", "twist_joint": "twist"})'
LONGER = """model(edit=lambda text: text.replace(
    '<body name="body">', '<body name="body"><joint name="more" type="slide"/>'))"""
TWO_SENSORS = """model(edit=lambda text: text.replace(
    "</sensor>", '<plugin name="again" plugin="vwt.yaw_moment" instance="air"/></sensor>'))"""
TWO_INSTANCES = """model(edit=lambda text: text.replace(
    "</plugin></extension>",
    '<instance name="more"><config key="joint" value="twist"/></instance></plugin></extension>'))"""


def _run(script: str, folder: Path) -> None:
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{START}\n{script}"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, f"status {done.returncode}\n{done.stderr[-2000:]}"


def test_models_that_list_their_parts_otherwise_find_their_own(tmp_path: Path) -> None:
    _run(
        f"""
models = [{FEW}, {MANY}, {OTHER}, {SERIES}, {ELSEWHERE}, {TWISTING}]
alone = [moments(model, mujoco.MjData(model)) for model in models]
assert len({{tuple(values) for values in alone}}) == len(models)
for first in models:
    data = mujoco.MjData(first)
    for model, expected in zip(models * 2, alone * 2, strict=True):
        assert moments(model, data) == expected
""",
        tmp_path,
    )


def test_a_new_model_at_the_address_of_an_old_one(tmp_path: Path) -> None:
    # names of equal length in another order: every size and, with luck, the address is the same
    _run(
        """
data = mujoco.MjData(model({"user_aaaa": "1", "free_play": "0.1"}))
for turn in range(50):
    numerics = [("user_aaaa", "1"), ("free_play", "0.1")]
    other = model(dict(numerics if turn % 2 else numerics[::-1]))
    assert moments(other, data) == moments(other, mujoco.MjData(other)), turn
""",
        tmp_path,
    )


@pytest.mark.parametrize(
    ("other", "action"),
    [
        (TWO_SENSORS, "mj_step"),
        (LONGER, "mj_forward"),
        (LONGER, "mj_resetData"),
        slow(TWO_SENSORS, "mj_forward"),
        slow(TWO_SENSORS, "mj_resetData"),
        slow(LONGER, "mj_step"),
    ],
)
def test_a_model_whose_data_has_other_sizes_is_refused(action: str, other: str, tmp_path: Path) -> None:
    # the data of the larger for the smaller: MuJoCo's own part would write beyond the smaller one's
    _run(f"large, small = {other}, {FEW}\nrefused(mujoco.{action}, small, mujoco.MjData(large))", tmp_path)


@pytest.mark.parametrize("action", ["mj_forward", "mj_step"])
def test_an_instance_that_the_data_does_not_have_is_refused(action: str, tmp_path: Path) -> None:
    _run(f"data = mujoco.MjData({FEW})\nrefused(mujoco.{action}, {TWO_INSTANCES}, data)", tmp_path)


def test_copies_follow_the_model_they_are_made_for(tmp_path: Path) -> None:
    _run(
        f"""
few, other = {FEW}, {OTHER}
source = mujoco.MjData(few)
source.joint("yaw").qpos = 0.3
mujoco.mj_step(few, source, 20)
copied = mujoco.MjData(other)
mujoco.mj_copyData(copied, few, source)
for _ in range(2):
    mujoco.mj_step(few, copied, 10)
    mujoco.mj_step(few, source, 10)
    assert (copied.qpos == source.qpos).all() and (copied.plugin_state == source.plugin_state).all()
assert moments(other, copied) == moments(other, mujoco.MjData(other))
""",
        tmp_path,
    )
