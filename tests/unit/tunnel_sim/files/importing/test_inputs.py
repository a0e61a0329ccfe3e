"""The command of a servo beside its angle is the input of a driven run, and columns that are not used are named.

Truth: the response of a servo to its command, by an integration of its own.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from scipy.signal import lfilter

from tests.support.import_files import decay, written
from tunnel_sim import TunnelError
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.records import Imported, read_records
from tunnel_sim.vocabulary.input_kinds import INPUTS, without_command
from tunnel_sim.vocabulary.record import Array

TIME = np.arange(2000) / 100.0
COMMAND = 0.3 * np.sin(2.0 * TIME + 0.15 * TIME**2)
RNG = np.random.default_rng(20260601)


def servo(command: Array, delay: int = 3) -> Array:
    """The angle of a servo of 9 rad/s and a damping ratio of 0.3 after its command, rad."""
    w, z, step = 9.0, 0.3, 0.01
    poles = np.exp(
        step * np.array([-z * w + 1j * w * np.sqrt(1 - z * z), -z * w - 1j * w * np.sqrt(1 - z * z)])
    )
    a = np.real(np.poly(poles))
    return np.asarray(lfilter([a.sum()], a, np.concatenate([np.zeros(delay), command])[: command.size]))


ANGLE = servo(COMMAND) + 1e-4 * RNG.standard_normal(TIME.size)


def log(folder: Path, choices: ImportChoices = ImportChoices(), **columns: Array) -> Imported:  # noqa: B008
    """The import of a table of columns by name."""
    rows = np.stack([TIME, *columns.values()], axis=1)
    lines = "\n".join(",".join(f"{v:.7f}" for v in row) for row in rows)
    return read_records([written(folder, "log.csv", ",".join(["t", *columns]) + "\n" + lines)], choices)


@pytest.mark.parametrize(
    ("command", "angle"),
    [
        ("goal_position", "position"), ("target_position", "present_position"), ("setpoint", "angle"),
        ("desired_position", "position"), ("q_ref", "q"), ("q_des", "q"), ("theta_cmd", "theta"),
        ("pos_goal", "pos"), ("yaw_target", "yaw"), ("reference", "yaw"), ("targetAngle", "actualAngle"),
        ("sollwinkel", "winkel"),
    ],
)  # fmt: skip
def test_a_command_beside_the_angle_drives_it(command: str, angle: str, tmp_path: Path) -> None:
    (run,) = log(tmp_path, **{command: COMMAND, angle: ANGLE}).campaign.runs
    assert run.drive is not None
    assert run.drive.column == "command_rad"
    np.testing.assert_allclose(run.drive.values, COMMAND, atol=1e-7)
    np.testing.assert_allclose(run.record.yaw_rad, ANGLE, atol=1e-7)


def test_a_command_without_a_unit_has_that_of_the_angle(tmp_path: Path) -> None:
    degrees = {"goal_position": np.rad2deg(COMMAND), "position": np.rad2deg(ANGLE)}
    (run,) = log(tmp_path, ImportChoices(unit="deg"), **degrees).campaign.runs
    assert run.drive is not None
    np.testing.assert_allclose(run.drive.values, COMMAND, atol=1e-7)
    counts = {"goal_position": COMMAND * 4096 / (2 * np.pi), "position": ANGLE * 4096 / (2 * np.pi)}
    (run,) = log(tmp_path, ImportChoices(counts_per_turn=4096), **counts).campaign.runs
    assert run.drive is not None
    np.testing.assert_allclose(run.drive.values, COMMAND, atol=1e-7)
    stated = {"goal_position_deg": np.rad2deg(COMMAND), "position_rad": ANGLE}
    (run,) = log(tmp_path, **stated).campaign.runs
    assert run.drive is not None
    np.testing.assert_allclose(run.drive.values, COMMAND, atol=1e-7)
    volts = {"goal_position": COMMAND, "position (V)": ANGLE / 2.0}
    with pytest.raises(TunnelError, match="'goal_position' has no unit of an angle"):
        log(tmp_path, ImportChoices(calibration="2*V"), **volts)


def test_a_command_goes_before_the_torque_that_follows_it(tmp_path: Path) -> None:
    torque = np.concatenate([[0.0], 5.0 * (COMMAND - ANGLE)[:-1]]) + 0.1 * RNG.standard_normal(TIME.size)
    found = log(tmp_path, goal_position=COMMAND, position=ANGLE, torque=torque)
    (run,) = found.campaign.runs
    assert run.drive is not None
    assert run.drive.column == "command_rad"
    assert "'torque'" in " ".join(found.remarks())


def test_a_command_that_stands_still_leaves_a_free_decay(tmp_path: Path) -> None:
    free = 0.3 * np.exp(-0.2 * TIME) * np.cos(6.0 * TIME)
    (run,) = log(tmp_path, goal_position=0.0 * TIME, position=free).campaign.runs
    assert run.drive is None


def test_a_command_alone_is_not_silently_the_angle(tmp_path: Path) -> None:
    with pytest.raises(TunnelError, match=r"'goal_position' is a command by its name.*give --angle"):
        log(tmp_path, goal_position=COMMAND, joint=ANGLE)


def test_a_column_that_moves_before_the_angle_is_named(tmp_path: Path) -> None:
    found = log(tmp_path, yaw_rad=ANGLE, knob=COMMAND, level=RNG.standard_normal(TIME.size))
    (run,) = found.campaign.runs
    assert run.drive is None
    said = " ".join(found.remarks())
    assert "'knob' moves before or with the angle and is not used; --input" in said
    assert "columns that are not used: 'level'" in said


def test_no_column_of_noise_is_said_to_move_the_angle(tmp_path: Path) -> None:
    _, angle = decay(duration=20.0)
    noise = {f"channel {i}": RNG.standard_normal(TIME.size) for i in range(8)}
    drift = {f"drift {i}": np.cumsum(RNG.standard_normal(TIME.size)) for i in range(8)}
    for columns in (noise, drift):
        assert "moves before" not in " ".join(log(tmp_path, yaw_rad=angle[:2000], **columns).remarks())


@pytest.mark.parametrize(
    "name",
    [
        "goal_velocity", "target_speed", "torque_cmd", "current_ref", "desired_torque", "position", "wind_target",
        "temperature_setpoint", "description", "preference", "setting", "offset", "reset", "u", "command",
    ],
)  # fmt: skip
def test_other_names_are_not_commands_of_an_angle(name: str) -> None:
    assert not INPUTS["command_rad"].holds(name, "")


def test_the_name_that_a_command_belongs_to() -> None:
    names = ("q_ref", "qdes", "goal_position", "positionTarget", "reference", "theta_cmd", "GoalPosition")
    assert [without_command(name) for name in names] == [
        "q",
        "q",
        "position",
        "position",
        "",
        "theta",
        "position",
    ]


def test_a_hold_beside_the_arrays_of_a_mat_file_is_that_of_the_input(tmp_path: Path) -> None:
    path = tmp_path / "log.mat"
    columns = {"time_s": TIME, "yaw_rad": ANGLE, "command_rad": COMMAND}
    savemat(path, columns | {"drive_hold": "zero"})
    imported = read_records([path])
    (run,) = imported.campaign.runs
    assert run.drive is not None
    assert run.drive.hold == "zero"
    assert any("drive_hold = zero from the file" in line for line in imported.remarks())
