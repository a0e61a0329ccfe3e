"""The plugin with what MuJoCo does to models and data: copies, states, batches, rollouts, live changes."""

from __future__ import annotations

import copy
from collections.abc import Mapping

import mujoco
import numpy as np
import pytest
from mujoco import batch as mujoco_batch
from mujoco import rollout as mujoco_rollout

from tests.support.small_model import small_model

pytestmark = pytest.mark.usefixtures("in_a_folder_of_its_own")

LAW = {"aero_lag": "2", "friction_moment": "0.01", "presliding": "0.002", "moment_cubic": "1"}
STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


def _model(numerics: Mapping[str, str] = LAW) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(small_model(numerics, {"joint": "yaw", "twist_joint": "twist"}))


def _moving(model: mujoco.MjModel, steps: int = 100) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.joint("yaw").qpos = 0.3
    mujoco.mj_step(model, data, steps)
    return data


def _state(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    return state


def _same(one: mujoco.MjData, other: mujoco.MjData) -> bool:
    fields = ("qpos", "qvel", "plugin_state", "sensordata", "time")
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in fields)


@pytest.mark.parametrize("how", [copy.copy, copy.deepcopy])
def test_copied_data_continues_to_the_bit(how) -> None:  # type: ignore[no-untyped-def]
    model = _model()
    data = _moving(model)
    twin = how(data)
    del data
    again = _moving(model)
    mujoco.mj_step(model, twin, 500)
    mujoco.mj_step(model, again, 500)
    assert _same(twin, again)


def test_state_continues_to_the_bit_in_other_data() -> None:
    model = _model()
    data = _moving(model)
    assert np.any(data.plugin_state != 0.0)
    saved, other = _state(model, data), mujoco.MjData(model)
    mujoco.mj_step(model, data, 500)
    mujoco.mj_setState(model, other, saved, STATE)
    mujoco.mj_step(model, other, 500)
    assert _same(data, other)


def test_reset_starts_anew() -> None:
    model = _model()
    data = _moving(model)
    mujoco.mj_resetData(model, data)
    assert np.all(data.plugin_state == 0.0)
    data.joint("yaw").qpos = 0.3
    mujoco.mj_step(model, data, 100)
    assert _same(data, _moving(model))


def test_forward_may_be_called_again_without_effect() -> None:
    model = _model()
    data, other = _moving(model), _moving(model)
    for _ in range(3):
        mujoco.mj_forward(model, other)
    mujoco.mj_step(model, data)
    mujoco.mj_step(model, other)
    assert np.array_equal(data.qpos, other.qpos)
    assert np.array_equal(data.plugin_state, other.plugin_state)


def test_coefficient_changed_in_the_model_acts_at_once() -> None:
    model = _model({})
    model.numeric("cn_beta").data[0] = 0.8
    assert _same(_moving(model), _moving(_model({"cn_beta": "0.8"})))


def test_friction_forgets_the_start_of_the_step_where_a_coefficient_changes() -> None:
    model = _model({"friction_moment": "9", "gravity_stiffness": "1"})
    held, fresh = _moving(model), _moving(model)  # friction balances the other moments
    mujoco.mj_forward(model, held)
    model.numeric("gravity_stiffness").data[0] = 2.0
    for data in (held, fresh):
        data.joint("yaw").qpos += 0.01
        mujoco.mj_forwardSkip(model, data, mujoco.mjtStage.mjSTAGE_NONE, 1)
    assert np.array_equal(held.qfrc_passive, fresh.qfrc_passive)


def test_expanded_numerics_give_every_simulation_its_own_coefficients() -> None:
    model = _model()
    values = [0.2, 0.5, 0.8]
    batch = mujoco_batch.Batch(model, nsim=len(values), nthread=2)
    address = int(model.numeric_adr[model.numeric("cn_beta").id])
    batch.expand("numeric_data")[:, address] = values
    batch.bind("qpos")[:, 1] = 0.3
    batch.step(nstep=400)
    alone = [_moving(_model({**LAW, "cn_beta": repr(value)}), 400).qpos for value in values]
    assert np.array_equal(batch.bind("qpos"), alone)


def test_rollout_gives_each_model_its_own_coefficients() -> None:
    models = [_model({**LAW, "cn_beta": value}) for value in ("0.2", "0.5", "0.8")]
    start = []
    for model in models:
        data = mujoco.MjData(model)
        data.joint("yaw").qpos = 0.3
        start.append(_state(model, data))
    # one mjData for three models: what the plugin keeps from the first must not reach the others
    states, _ = mujoco_rollout.rollout(models, mujoco.MjData(models[0]), np.array(start), nstep=400)
    for model, found in zip(models, states[:, -1], strict=True):
        assert np.array_equal(found, _state(model, _moving(model, 400)))
    assert len({row.tobytes() for row in states[:, -1]}) == 3


def test_models_with_other_numerics_share_data() -> None:
    # equal in size, so MuJoCo sees no difference: every model must find its own coefficients all the same
    models = [_model({"moment_cubic": "1"}), _model({"gravity_stiffness": "0.5"})] * 2
    start = []
    for model in models:
        data = mujoco.MjData(model)
        data.joint("yaw").qpos = 0.3
        start.append(_state(model, data))
    alone = [_state(model, _moving(model)) for model in models]
    states, _ = mujoco_rollout.rollout(models, mujoco.MjData(models[0]), np.array(start), nstep=100)
    assert np.array_equal(states[:, -1], alone)
    batch = mujoco_batch.Batch(models[0], nsim=4, nthread=1)
    batch.set_models(models)
    batch.bind("qpos")[:, 1] = 0.3
    batch.step(nstep=100)
    assert np.array_equal(batch.bind("qpos"), [_moving(model).qpos for model in models])


def test_data_of_other_numerics_takes_a_copy() -> None:
    model, other = _model({"moment_cubic": "1"}), _model({"user_some_longer_name": "1"})
    data = mujoco.MjData(other)
    mujoco.mj_copyData(data, model, _moving(model))
    mujoco.mj_step(model, data, 10)
    again = _moving(model)
    mujoco.mj_step(model, again, 10)
    assert np.array_equal(data.qpos, again.qpos)


def test_two_sensors_show_the_same_moment() -> None:
    text = small_model(LAW)
    second = '<plugin name="again" plugin="vwt.yaw_moment" instance="air"/></sensor>'
    model = mujoco.MjModel.from_xml_string(text.replace("</sensor>", second))
    data = _moving(model)
    assert data.sensor("moment").data[0] == data.sensor("again").data[0] != 0.0


def test_body_feels_the_air_and_the_rods_end_the_mechanism() -> None:
    model = _model({"gravity_stiffness": "0.5"})
    data = mujoco.MjData(model)
    yaw, twist = 0.2, 0.01
    data.joint("yaw").qpos, data.joint("twist").qpos = yaw, twist
    mujoco.mj_forward(model, data)
    air = data.sensor("moment").data[0]
    assert air == pytest.approx(0.5 * 1.204 * 400 * 0.036 * 0.625 * 0.35 * (yaw + twist), rel=1e-13)
    springs = np.array([16.0 * yaw, 500.0 * twist])
    found = data.qfrc_passive[1:] + springs
    assert found == pytest.approx([air - 0.5 * np.sin(yaw), air], rel=1e-12)
