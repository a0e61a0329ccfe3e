"""Gymnasium's conventions: registration, checkers, spaces, ends, wrappers, drawing."""

from __future__ import annotations

import copy
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RecordEpisodeStatistics, RecordVideo, TimeLimit

import tunnel_sim.envs.rendering as rendering
from tests.skips import PLATFORM
from tests.support.env_episodes import NAME, episode, make
from tunnel_sim.envs import EnvError, register_environments
from tunnel_sim.envs.episodes import campaign_of
from tunnel_sim.envs.rendering import RigView
from tunnel_sim.files.rig_file import load_rig

PRESETS = ("plain", "operator")
ROOT = Path(__file__).parents[4]


class Window:
    """In place of MuJoCo's viewer, which needs a display."""

    def __init__(self, data: Any) -> None:
        self.data, self.poses, self.closed = data, [], False

    def sync(self) -> None:
        self.poses.append(self.data.qpos.copy())

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> list[Window]:
    opened: list[Window] = []

    def open_window(_model: Any, data: Any, **sides: bool) -> Window:
        assert sides == {"show_left_ui": False, "show_right_ui": False}
        opened.append(Window(data))
        return opened[-1]

    monkeypatch.setattr(rendering, "_has_display", lambda: True)
    monkeypatch.setattr("mujoco.viewer.launch_passive", open_window)
    return opened


def test_registering_twice_does_nothing() -> None:
    before = dict(gymnasium.registry)
    register_environments()
    assert dict(gymnasium.registry) == before
    assert NAME in before


def test_a_name_with_its_module_needs_no_import_of_ours() -> None:
    script = f"""
import sys
import gymnasium
env = gymnasium.make("tunnel_sim.envs:{NAME}", duration=0.1)
env.reset(seed=1)
print(env.spec.id)
print(gymnasium.make_vec("tunnel_sim.envs:{NAME}", num_envs=2).num_envs)
"""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", script], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [NAME, "2"]


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.usefixtures("drawing")
def test_gymnasiums_checker_passes_without_a_warning(
    preset: str, windows: list[Window], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    env = make(preset=preset, duration=1.0, render_mode="rgb_array", width=64, height=48)
    check_env(env.unwrapped)
    assert [window.closed for window in windows] == [True]  # the human mode was tried, and closed
    env.close()


@pytest.mark.usefixtures("drawing")
def test_the_checker_passes_without_a_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    env = gymnasium.make(NAME, duration=1.0, render_mode="rgb_array", width=64, height=48).unwrapped
    assert env.metadata["render_modes"] == ["rgb_array"]
    check_env(env)
    env.close()


def test_the_default_has_something_to_control() -> None:
    env = gymnasium.make(NAME, duration=1.0)
    assert env.action_space.shape == (2,)
    still, moved = (
        episode(env, np.array(action, np.float32), seed=1)[1] for action in ([-1.0, 0.0], [1.0, 0.0])
    )
    assert sum(still) != sum(moved)


@pytest.mark.slow
@pytest.mark.parametrize("preset", PRESETS)
def test_stable_baselines_checker_passes_without_a_warning(preset: str) -> None:
    from stable_baselines3.common.env_checker import check_env as check_for_stable_baselines

    check_for_stable_baselines(make(preset=preset, duration=1.0).unwrapped, warn=True)


@pytest.mark.parametrize("period", [0.01, 0.02, 0.005])
def test_pictures_per_second_are_one_over_the_step(period: float) -> None:
    env = make(control_period=period).unwrapped
    assert env.metadata["render_fps"] == pytest.approx(1.0 / env.dt)
    assert env.observation_space.shape == (round(period * 1000) + 2,)
    assert type(env).metadata["render_fps"] == 100


def test_a_run_is_truncated_at_its_end_with_its_record() -> None:
    observations, rewards, info = episode(make(duration=0.5), seed=1)
    assert len(rewards) == 50
    record = info["record"]
    assert record.time_s.shape == (500,)
    assert record.sample_rate == pytest.approx(1000.0)
    assert info["run"].record is record
    readings = np.concatenate([observation[:-2] for observation in observations[1:]])
    assert np.array_equal(readings, record.yaw_rad)
    assert [observation[-2] for observation in observations] == pytest.approx(np.linspace(0.0, 0.5, 51))


def test_a_step_after_the_end_or_before_the_start_is_refused() -> None:
    env = make(duration=0.1).unwrapped
    with pytest.raises(EnvError, match="call reset"):
        env.step(0)
    episode(env, seed=1)
    with pytest.raises(EnvError, match="call reset"):
        env.step(0)


@pytest.mark.parametrize("penalty", [5.0, 0.0])
def test_a_run_that_reaches_the_stop_is_lost(penalty: float) -> None:
    """Constant wind beyond divergence without a moment: the sum of its rewards is the penalty."""
    options = {"spring": 3, "wind_speed": 20.0, "release_angle": 0.3, "truth": {"cn_beta": 0.6}}
    arguments = {} if penalty == 5.0 else {"stop_penalty": penalty}
    env = make(preset="operator", sample_rate=100.0, control_period=0.05, **arguments)
    action = env.unwrapped.operator_action(wind_speed=40.0)
    env.reset(seed=1, options=options)
    rewards, terminated, truncated = [], False, False
    while not (terminated or truncated):
        _, reward, terminated, truncated, _ = env.step(action)
        rewards.append(reward)
    assert terminated
    assert min(rewards[:-1]) >= 0.0
    assert sum(rewards[:-1]) > 10.0
    assert sum(rewards) == pytest.approx(-penalty)


def test_a_run_informs_while_the_wind_decays_and_not_once_it_is_at_rest() -> None:
    env = make(preset="operator", sample_rate=100.0, control_period=0.05, wind_time_constant=0.1)
    action = env.unwrapped.operator_action(wind_speed=0.0)
    env.reset(seed=1, options={"spring": 5, "wind_speed": 15.0, "release_angle": 0.3})
    rewards = [env.step(action)[1] for _ in range(200)]
    assert sum(rewards[:40]) > 1.0
    env.reset(seed=1, options={"spring": 5, "wind_speed": 0.0, "release_angle": 0.3})
    assert max(env.step(action)[1] for _ in range(50)) == pytest.approx(0.0, abs=1e-9)


def test_a_run_that_leaves_the_sensors_range_is_terminated() -> None:
    env = make(duration=20.0)
    options = {"spring_stiffness": 0.5, "wind_speed": 20.0, "truth": {"cn_beta": 0.5}}  # Kr below Ka
    env.reset(seed=1, options=options)
    terminated = truncated = False
    while not (terminated or truncated):
        observation, _, terminated, truncated, info = env.step(0)
    assert terminated
    assert not truncated
    assert observation in env.observation_space
    reading = np.abs(info["record"].yaw_rad)
    assert reading[-20] < np.pi / 3 < reading[-1] + 0.05
    assert info["record"].duration < 19.0


def test_the_truth_is_in_info_on_request_only() -> None:
    for exposed in (False, True):
        env = make(duration=0.1, expose_truth=exposed)
        _, begin = env.reset(seed=1)
        *_, end = episode(env, seed=1)
        assert ("truth" in begin, "truth" in end) == (exposed, exposed)
        shown = repr({name: value for name, value in (begin | end).items() if name not in ("truth",)})
        assert "cn_" not in shown
    assert begin["truth"].truth.cn_beta == end["truth"].truth.cn_beta


def test_time_limit_cuts_and_the_record_so_far_remains() -> None:
    env = make(duration=1.0, max_episode_steps=20)
    assert isinstance(env, TimeLimit)
    _, rewards, info = episode(env, seed=1)
    assert len(rewards) == 20
    assert "record" not in info
    assert env.unwrapped.record().time_s.size == 200
    native = gymnasium.make_vec(NAME, num_envs=2, preset="plain", duration=1.0, max_episode_steps=20)
    native.reset(seed=1)
    for _ in range(20):
        *_, truncated, infos = native.step(np.zeros(2, dtype=np.int64))
    assert truncated.all()
    assert np.array_equal(infos["record"][0].yaw_rad, env.unwrapped.record().yaw_rad)


def test_episode_statistics_sum_the_information() -> None:
    env = RecordEpisodeStatistics(make(duration=0.3))
    _, rewards, info = episode(env, seed=1)
    assert info["episode"]["r"] == pytest.approx(sum(rewards))
    assert info["episode"]["l"] == 30
    envs = gymnasium.wrappers.vector.RecordEpisodeStatistics(
        gymnasium.make_vec(NAME, num_envs=2, preset="plain", duration=0.3)
    )
    envs.reset(seed=1)
    for _ in range(30):
        *_, infos = envs.step(np.zeros(2, dtype=np.int64))
    assert infos["episode"]["r"][0] == pytest.approx(sum(rewards))
    assert infos["episode"]["l"].tolist() == [30, 30]


@pytest.mark.usefixtures("drawing")
def test_a_video_is_recorded(tmp_path: Path) -> None:
    env = RecordVideo(
        make(duration=0.05, render_mode="rgb_array", width=64, height=48), str(tmp_path / "film")
    )
    episode(env, seed=1)
    env.close()
    (film,) = (tmp_path / "film").glob("*.mp4")
    assert film.stat().st_size > 500


@pytest.mark.usefixtures("drawing")
def test_a_picture_shows_the_pose() -> None:
    view = RigView(load_rig(), "rgb_array", 96, 64, "above", 0.01)
    pictures = [view.draw(angle, 0.0) for angle in (0.0, 0.3, 0.0)]
    view.close()
    view.close()
    assert pictures[0].shape == (64, 96, 3)
    assert pictures[0].dtype == np.uint8
    assert np.array_equal(pictures[0], pictures[2])
    assert np.abs(pictures[0].astype(int) - pictures[1]).mean() > 0.3
    envs = gymnasium.make_vec(
        NAME, num_envs=2, preset="plain", render_mode="rgb_array", width=96, height=64, camera="above"
    )
    still = {"wind_speed": 0.0, "spring": 5}
    envs.reset(seed=1, options={"runs": [still | {"release_angle": angle} for angle in (0.0, 0.3)]})
    for drawn, expected in zip(envs.render(), pictures, strict=False):
        assert np.array_equal(drawn, expected)
    envs.close()


def test_a_window_follows_the_run_and_outlives_episodes(windows: list[Window]) -> None:
    env = make(duration=0.02, render_mode="human", control_period=0.001)
    options = {"release_angle": 0.2, "wind_speed": 0.0}
    episode(env, seed=1, options=options)
    episode(env, seed=1, options=options)
    env.close()
    (window,) = windows
    assert len(window.poses) == 42  # both resets, and 20 steps each
    assert window.poses[0].sum() == pytest.approx(0.2)
    assert window.poses[20].sum() < 0.2
    assert window.closed


def test_without_a_display_the_window_is_refused_with_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    if not sys.platform.startswith("linux"):
        pytest.skip(f"{PLATFORM}: windows open without a DISPLAY there")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(EnvError, match="rgb_array"):
        make(render_mode="human").reset(seed=1)


def test_without_a_back_end_the_picture_is_refused_with_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setitem(sys.modules, "mujoco.egl", None)
    env = make(render_mode="rgb_array")
    env.reset(seed=1)
    with pytest.raises(EnvError, match="libegl1"):
        env.render()


def test_environments_can_be_copied_and_made_from_their_spec() -> None:
    env = make(duration=0.2, preset="operator", prior={"cn_beta": 0.2})
    again = gymnasium.make(copy.deepcopy(env.spec))
    assert again.unwrapped.config == env.unwrapped.config
    assert gymnasium.envs.registration.EnvSpec.from_json(env.spec.to_json()) == env.spec


def test_finished_runs_become_a_campaign_with_ids_of_their_own() -> None:
    env = make(duration=0.1, noise_std=0.001)
    options = {"spring": 5, "wind_speed": 0.0, "release_angle": 0.2}
    runs = [episode(env, seed=seed, options=options)[2]["run"] for seed in (1, 2)]
    runs.append(episode(env, seed=3, options=options | {"wind_speed": 12.0})[2]["run"])
    campaign = campaign_of(runs, env.unwrapped, name="three")
    assert [run.id for run in campaign.runs] == ["k16.12-v0-a11.5-1", "k16.12-v0-a11.5-2", "k16.12-v12-a11.5"]
    assert [run.air_density for run in campaign.runs] == [None, None, 1.204]
    assert campaign.sensor.noise_std == 0.001
    assert campaign.rig.yaw_inertia == env.unwrapped.rig.dynamics.yaw_inertia
    with pytest.raises(EnvError, match="no run is given"):
        campaign_of([], env.unwrapped)
