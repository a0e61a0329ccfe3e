"""``tunnel diagnose --model``: what is refused in one line, and the patched model that is written.

Truth: a linear decay in closed form, where no test says otherwise.
"""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.findings.cautions import UNPATCHED
from diagnosis.model.fact import Fact
from tests.reference import robot_joints
from tests.reference.free_decays import Setting, campaign
from tests.reference.robot_joints import LEVEL, MOTOR, robot, robot_campaign
from tests.support.command import Tunnel
from tunnel_lab.commands import diagnose as commands
from tunnel_sim.files.campaign_folder import write_campaign
from tunnel_sim.vocabulary.errors import TunnelError

pytestmark = pytest.mark.usefixtures("models_in_this_process")

SPRING = 16.12
MODEL = f"""<mujoco><option gravity="0 0 0" timestep="0.001" integrator="RK4"/><worldbody><body>
<joint name="yaw" axis="0 0 1" stiffness="{SPRING}"/><geom type="box" size="0.3 0.1 0.1" mass="4"/>
</body></worldbody></mujoco>"""


def not_yet(*_: object) -> None:
    raise AssertionError("the diagnosis has begun")


@pytest.fixture
def spring(tmp_path: Path) -> Path:
    """Two decays of one spring, and a model of the rig whose inertia is too large."""
    settings = [Setting(SPRING, 0.0), Setting(SPRING, 0.0)]
    data = campaign(settings, duration=5.0, rate=500.0, noise=5e-4, rng=np.random.default_rng(8))
    (tmp_path / "rig.xml").write_text(MODEL)
    return write_campaign(data, tmp_path / "rig")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--model", "rig.xml"], "--model and --joint belong together"),
        (["--patch", "out.xml"], "--model and --joint belong together"),
        (["--model", "none.xml", "--joint", "yaw"], "none.xml: no such file"),
        (["--asset-dir", "."], "--model and --joint belong together"),
        (
            ["--model", "slow.xml", "--joint", "yaw", "--patch", "out.xml"],
            " steps, more than 20,000,000; lengthen the model's timestep",
        ),
        (["--model", "rig.xml", "--joint", "jaw"], "there is no such joint; did you mean 'yaw'?"),
        (["--model", "rig.xml", "--joint", "yaw", "--free", "mass"], "unknown parameter 'mass'"),
        (["--model", "rig.xml", "--joint", "yaw", "--patch", "no/out.xml"], "its folder does not exist"),
        (["--model", "rig.xml", "--joint", "yaw", "--patch", "rig"], "is a folder, not a file"),
        (["--model", "stiff.xml", "--joint", "yaw", "--patch", "out.xml"], "motion grows without bound"),
    ],
)
def test_bad_options_are_one_line_and_nothing_is_written(
    tunnel: Tunnel, spring: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], said: str
) -> None:
    monkeypatch.chdir(spring.parent)
    monkeypatch.setattr(commands, "diagnose_with_progress", not_yet)
    Path("slow.xml").write_text(MODEL.replace("0.001", "1e-12"))
    Path("stiff.xml").write_text(MODEL.replace("0.001", "0.5"))
    status, _, err = tunnel("diagnose", spring, *options)
    assert status == 2
    assert said in err
    assert len(err.strip().splitlines()) == 1
    assert not (spring.parent / "out.xml").exists()


def test_a_patch_needs_a_run_with_the_wind_off(
    tunnel: Tunnel, spring: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    windy = campaign([Setting(SPRING, 12.0)] * 2, duration=5.0, noise=5e-4, rng=np.random.default_rng(8))
    folder = write_campaign(windy, tmp_path / "windy")
    monkeypatch.setattr(commands, "diagnose_with_progress", not_yet)
    given = ("--model", spring.parent / "rig.xml", "--joint", "yaw", "--patch", tmp_path / "out.xml")
    status, _, err = tunnel("diagnose", folder, *given)
    assert (status, err.count("\n")) == (2, 1)
    assert "there are none; add runs with the wind off, or leave out --patch" in err


def test_a_patch_that_fails_after_all_says_why(tmp_path: Path) -> None:
    caution = f"{UNPATCHED}: MuJoCo refuses the patched model (too heavy)."
    found = SimpleNamespace(cautions=(Fact("few runs"), Fact("unpatched")))
    answer = SimpleNamespace(model=None, cautions=("Few runs.", caution), found=found)
    with pytest.raises(
        TunnelError, match=r"MuJoCo refuses the patched model \(too heavy\); leave out --patch"
    ):
        commands.write_patch(answer, tmp_path / "out.xml")  # type: ignore[arg-type]


def test_the_free_parameters_are_written_where_there_is_no_gap(
    tunnel: Tunnel, spring: Path, tmp_path: Path
) -> None:
    model, out, answer = tmp_path / "rig.xml", tmp_path / "out.xml", tmp_path / "answer.json"
    options = ("--model", model, "--joint", "yaw", "--patch", out, "--json", answer)
    status, shown, _ = tunnel("diagnose", spring, "--effects", "coulomb_friction", *options)
    assert status == 0
    document = json.loads(answer.read_text())
    assert document["causes"] == []
    assert {w["name"] for w in document["model"]["written"]} >= {"joint damping"}
    assert "Changes to rig.xml" in shown
    again = tunnel(
        "diagnose", spring, "--effects", "coulomb_friction", "--model", out, "--joint", "yaw", "--json", "-"
    )
    inertias = [d["coefficients"]["after"]["yaw_inertia"]["value"] for d in (document, json.loads(again[1]))]
    assert inertias[1] == pytest.approx(inertias[0], rel=1e-6)


def test_a_slide_is_diagnosed_as_a_displacement(tunnel: Tunnel, spring: Path, tmp_path: Path) -> None:
    model = tmp_path / "rig.xml"
    model.write_text(model.read_text().replace('name="yaw"', 'name="yaw" type="slide"'))
    given = ("--model", model, "--joint", "yaw", "--json", "-")
    status, shown, _ = tunnel("diagnose", spring, "--effects", "coulomb_friction", *given)
    assert status == 0
    document = json.loads(shown)
    assert document["causes"] == []
    assert document["motion"] == "displacement"
    assert document["coefficients"]["after"]["yaw_inertia"]["unit"] == "kg"
    assert not any("rad" in w["unit"] or "N m" in w["unit"] for w in document["model"]["written"])
    (mass,) = next(w["after"] for w in document["model"]["written"] if w["name"].endswith("mass"))
    assert mass == pytest.approx(document["coefficients"]["after"]["yaw_inertia"]["value"])


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_the_control_of_a_robots_joint_from_its_folder(
    tunnel: Tunnel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The truth is that of MuJoCo's own steps: friction and a rotor that the model lacks."""
    monkeypatch.setattr(robot_joints, "TIME", robot_joints.TIME[:750])
    truth = 'armature="0.05" damping="0.4" frictionloss="0.6" solreffriction="0.002 1"'
    folder = write_campaign(robot_campaign(robot(truth, axis=LEVEL), start=1.57), tmp_path / "arm")
    two = f'{MOTOR}<motor name="other" joint="elbow"/>'
    (tmp_path / "arm.xml").write_text(robot(axis=LEVEL, actuators=two))
    given = ("diagnose", folder, "--effects", "coulomb_friction", "--model", tmp_path / "arm.xml")
    status, _, err = tunnel(*given, "--joint", "elbow")
    assert (status, err.count("\n")) == (2, 1)
    assert "name the actuator whose control is in the column drive with --actuator" in err
    answer, report, out = (tmp_path / name for name in ("answer.json", "report.html", "out.xml"))
    options = (
        "--joint",
        "elbow",
        "--actuator",
        "motor",
        "--json",
        answer,
        "--report",
        report,
        "--patch",
        out,
    )
    status, shown, _ = tunnel(*given, *options)
    assert status == 0
    assert "By the model, actuator 'motor' gives 20 N m per unit of control." in " ".join(shown.split())
    document = json.loads(answer.read_text())
    assert document["causes"] == ["coulomb_friction"]
    assert document["model"]["closed"] > 0.99
    assert "joint frictionloss" in report.read_text()
    assert 'armature="0.05' in out.read_text()
