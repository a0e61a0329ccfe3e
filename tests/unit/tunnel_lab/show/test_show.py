"""``tunnel view`` and ``tunnel render``: what they refuse, what they write, and what moves."""

from __future__ import annotations

import gc
import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.skips import PLATFORM
from tests.support.command import Tunnel
from tunnel_lab.show.film import backends, draw_trace, shown_run
from tunnel_lab.show.live import missing_display, view_in_window
from tunnel_lab.show.request import Request
from tunnel_sim.engine.model import build_model
from tunnel_sim.engine.simulate import simulate_motion
from tunnel_sim.files.writing import as_json

PLAN = Path(__file__).parents[3] / "data" / "tiny-plan.toml"
SMALL = ("--size", "240x160", "--duration", "0.6")


def test_a_machine_that_cannot_draw_is_told_what_to_install(
    tunnel: Tunnel, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "nonsense")
    assert backends() == ("nonsense",)
    status, out, error = tunnel("render", "--out", tmp_path / "film.mp4", *SMALL)
    assert (status, out) == (2, "")
    assert "libosmesa6" in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_film_and_picture_are_whole_where_the_machine_can_draw(tunnel: Tunnel, tmp_path: Path) -> None:
    film, still = tmp_path / "film.mp4", tmp_path / "still.png"
    status, out, error = tunnel(
        "render", PLAN, "--out", film, "--out", still, "--at", "0.3", "--fps", "10", *SMALL
    )
    # a fault of the program is not one of the machine
    assert not any(fault in error for fault in ("NameError", "TypeError")), error
    if "off-screen rendering does not work here" in error:
        pytest.skip(error)
    assert status == 0, error
    assert out.count("Written: ") == 2
    assert {path.name for path in tmp_path.iterdir()} == {"film.mp4", "still.png"}
    import imageio.v2 as imageio

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # the reader leaves its pipes to the collector
        with imageio.get_reader(film) as reader:
            frames = [np.asarray(frame) for frame in reader]
        del reader
        gc.collect()
    assert len(frames) == 6
    assert frames[0].shape == (160, 240, 3)
    assert np.asarray(imageio.imread(still)).shape[:2] == (160, 240)
    body, trace = slice(0, 120), slice(130, 240)  # left the body, right the trace: both move
    for part in (body, trace):
        assert np.abs(frames[0][:, part].astype(int) - frames[3][:, part]).max() > 60


def test_the_trace_grows_to_where_the_run_is() -> None:
    run = shown_run(Request(duration=2.0))
    record = run.record()
    trace = draw_trace(record, 400, 300, run.title)
    blue = lambda picture: (picture[..., 2].astype(int) - picture[..., 0] > 80).sum()  # noqa: E731
    grown = [blue(trace.at(time)) for time in (0.0, 1.0, 2.0)]
    assert grown[0] < grown[1] < grown[2]
    orange = np.argwhere((trace.at(1.0) == (213, 94, 0)).all(axis=-1)).mean(axis=0)
    assert orange[1] == pytest.approx(np.interp(1.0, trace.time, trace.columns), abs=1.0)
    assert orange[0] == pytest.approx(np.interp(1.0, trace.time, trace.rows), abs=1.0)
    assert trace.rows[np.argmax(record.yaw_rad)] == trace.rows.min()  # nose-right is up


def test_what_is_shown_is_the_plans_run() -> None:
    run = shown_run(Request(plan=PLAN))
    assert run.record().yaw_rad.tobytes() == run.record().yaw_rad.tobytes()
    changed = shown_run(Request(plan=PLAN, wind_speed=20.0, spring=8, release_angle_deg=-5.0))
    assert (changed.settings.wind_speed, changed.settings.spring_stiffness) == (20.0, 44.84)
    assert changed.settings.release_angle == pytest.approx(np.radians(-5.0))
    with_effect = shown_run(Request(effects=("coulomb_friction:friction_moment=0.01",)))
    assert with_effect.settings.parameters["friction_moment"] == 0.01
    assert "coulomb friction" in with_effect.title
    request = Request(plan=Path("p"), effects=("a:b=1",), seed=3)
    assert Request.from_json_dict(as_json(request)) == request


def test_the_viewer_gets_the_run_from_its_release(monkeypatch) -> None:
    import glfw
    from mujoco import viewer

    launched = {}
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(glfw, "init", lambda: True)
    monkeypatch.setattr(viewer, "launch", lambda **given: launched.update(given))
    run = shown_run(Request(duration=1.0, effects=("unsteady_aero_lag:lag=0.1",)))
    view_in_window(run, camera="side", speed=0.5)
    motion = simulate_motion(build_model(run.rig, run.settings), 1000.0)
    for _ in range(2):  # loading again releases again
        model, data = launched["loader"]()
        assert model.camera(model.vis.global_.cameraid).name == "side"
        assert model.vis.global_.realtime == pytest.approx(0.5)
        mujoco.mj_step(model, data, round(0.5 / model.opt.timestep))
        assert data.joint("yaw").qpos[0] == pytest.approx(motion.angle[500], abs=1e-12)


def test_no_display_is_one_clear_line(tunnel: Tunnel, monkeypatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    if not missing_display():
        pytest.skip(f"{PLATFORM}: there is always one")
    status, out, error = tunnel("view")
    assert (status, out) == (2, "")
    assert "there is no display" in error
    assert "tunnel render" in error
    assert error.count("\n") == 1
