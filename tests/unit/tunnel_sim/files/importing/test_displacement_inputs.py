"""Driven records of a displacement, integrated by SciPy: input columns, their units, and the words of an import."""

from __future__ import annotations

import re
from functools import cache
from math import tanh
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from scipy.integrate import solve_ivp

from tests.support.linear import FORBIDDEN
from tests.support.robot_logs import JOINT_STATE, START_NS, joint_state, write_mcap
from tunnel_lab.bench.preview import settings_from, settings_of
from tunnel_lab.plotting.runs import import_picture
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.importing.choices import ImportChoices, parse_setting, read_recipe
from tunnel_sim.files.importing.condition_names import Conditions
from tunnel_sim.files.importing.records import Imported, read_records
from tunnel_sim.files.importing.writing import import_records
from tunnel_sim.vocabulary.errors import TunnelError

MASS, STIFFNESS, DAMPING, FRICTION = 2.0, 50.0, 0.3, 0.05
TIME = np.arange(2000) / 100.0
PUSH = 1.5 * np.sin(2.0 * np.pi * (0.2 + 0.05 * TIME) * TIME)
"""A force, N, of rising frequency."""


def driven(force: np.ndarray) -> np.ndarray:
    """The displacement of a cart of 2 kg on a spring of 50 N/m with dry friction, m, under a force in N."""

    values = [*force.tolist(), float(force[-1])]

    def slope(t: float, state: np.ndarray) -> list[float]:
        x, v = state.tolist()
        place, between = divmod(100.0 * t, 1.0)
        pushed = values[int(place)] * (1.0 - between) + values[int(place) + 1] * between
        return [v, (pushed - DAMPING * v - STIFFNESS * x - FRICTION * tanh(v / 1e-3)) / MASS]

    found = solve_ivp(slope, (0.0, TIME[-1]), [0.0, 0.0], t_eval=TIME, rtol=1e-8, atol=1e-10, max_step=0.02)
    return np.asarray(found.y[0])


@cache
def reading() -> np.ndarray:
    """Of the cart under the push, m."""
    return driven(PUSH) + 3e-5 * np.random.default_rng(4).standard_normal(TIME.size)


def file_of(folder: Path, heading: str, *columns: np.ndarray) -> Path:
    """A file of a logger."""
    path = folder / "log.csv"
    np.savetxt(path, np.stack([TIME, *columns], axis=1), "%.9g", ",", header=heading, comments="")
    return path


def said(imported: Imported) -> str:
    """All remarks, long and short, without the names of columns."""
    notes, judged = imported.summary()
    return re.sub(r"'[^']*'", "", "\n".join([*imported.remarks(), *notes, *judged]))


@pytest.mark.parametrize(
    ("heading", "input_factor", "column", "si"),
    [
        ("time (s),x (mm),force (N)", 1.0, "moment_nm", 1.0),
        ("time (s),x (mm),load (kN)", 1e-3, "moment_nm", 1.0),
        ("time (s),x (mm),u (kN)", 1e-3, "moment_nm", 1.0),
        ("time (s),x (mm),push (mN)", 1e3, "moment_nm", 1.0),
        ("t_s,pos_mm,force_N", 1.0, "moment_nm", 1.0),
        ("t/s,x/mm,F/N", 1.0, "moment_nm", 1.0),
        ("Zeit in s,Weg in mm,Kraft in N", 1.0, "moment_nm", 1.0),
        ("time_s,x_mm,force_n", 1.0, "moment_nm", 1.0),
        ("time (s),x (mm),motor (V)", 0.5, "drive", 0.5),
        ("time (s),x (mm),base (mm)", 20.0, "base_rad", 0.02),
        ("time (s),x (mm),setpoint (mm)", 20.0, "command_rad", 0.02),
        ("time (s),x (mm),base_m", 0.02, "base_rad", 0.02),
        ("time (s),x (mm),base acc (m/s2)", -1.0 / MASS, "base_acceleration_rad_s2", -1.0 / MASS),
        ("time (s),x (mm),table acc [m/s^2]", -1.0 / MASS, "base_acceleration_rad_s2", -1.0 / MASS),
        ("time (s),x (mm),shaker acceleration (g)", -0.5 / 9.80665, "base_acceleration_rad_s2", -0.5),
        ("time (s),x (mm),base_acceleration_m_s2", -0.5, "base_acceleration_rad_s2", -0.5),
    ],
)
def test_an_input_is_read_in_si(
    tmp_path: Path, heading: str, input_factor: float, column: str, si: float
) -> None:
    """By name and unit: a force, the spring's root, a servo's command, the acceleration of the base."""
    found = read_records([file_of(tmp_path, heading, 1e3 * reading(), input_factor * PUSH)])
    (run,) = found.campaign.runs
    assert found.campaign.sensor.motion == "displacement"
    np.testing.assert_allclose(run.record.yaw_rad, reading(), rtol=1e-6, atol=1e-11)
    assert run.drive is not None
    assert run.drive.column == column
    np.testing.assert_allclose(run.drive.values, si * PUSH, rtol=1e-6, atol=1e-11)
    assert not re.search(FORBIDDEN, said(found)), said(found)


def test_it_is_written_under_its_own_name_and_read_again(tmp_path: Path) -> None:
    choices = ImportChoices(input_hold="zero")
    import_records(
        [file_of(tmp_path, "time (s),x (mm),force (N)", 1e3 * reading(), PUSH)], tmp_path / "c", choices
    )
    assert (tmp_path / "c/runs/log.csv").read_text().startswith("time_s,x_m,force_n\n")
    (run,) = read_campaign(tmp_path / "c").runs
    assert run.drive is not None
    np.testing.assert_allclose(run.drive.values, PUSH, rtol=1e-6, atol=1e-11)
    recipe = (tmp_path / "c/import.toml").read_text().partition("sha256")[2]
    assert not re.search(FORBIDDEN, re.sub(r"'[^']*'", "", recipe))


def test_a_velocity_is_no_wind(tmp_path: Path) -> None:
    """In a log beside displacement and force."""
    speed = np.gradient(reading(), TIME)
    path = file_of(tmp_path, "time (s),x (mm),v (m/s),force (N)", 1e3 * reading(), speed, PUSH)
    found = read_records([path])
    assert found.campaign.runs[0].drive is not None
    assert "wind" not in said(found)


def test_conditions_in_columns_have_own_names_and_units(tmp_path: Path) -> None:
    one = np.ones_like(TIME)
    path = file_of(
        tmp_path, "time (s),x (mm),force (N),k (N/mm),mass (kg)", 1e3 * reading(), PUSH, 0.05 * one, 2.0 * one
    )
    found = read_records([path]).campaign
    assert found.rig.yaw_inertia == pytest.approx(2.0)
    assert found.runs[0].spring_stiffness == pytest.approx(50.0)


def test_an_input_is_stated_under_its_own_name(tmp_path: Path) -> None:
    path = file_of(tmp_path, "time,signal,f", 1e3 * reading(), PUSH)
    choices = {"angle": ("signal",), "unit": "mm", "input": "f"}
    drive = read_records([path], ImportChoices(**choices, input_as="force_n")).campaign.runs[0].drive
    assert drive is not None
    assert drive.column == "moment_nm"
    with pytest.raises(
        TunnelError, match="'moment_nm' is not an input of a motion = 'displacement'; give force_n"
    ):
        read_records([path], ImportChoices(**choices, input_as="moment_nm"))
    with pytest.raises(TunnelError, match="'force_n' is not an input of a motion = 'angle'; give moment_nm"):
        read_records([path], ImportChoices(**(choices | {"unit": "deg"}), input_as="force_n"))


def test_two_displacements_are_asked_for_in_own_words(tmp_path: Path) -> None:
    path = file_of(tmp_path, "time (s),x1 (mm),x2 (mm)", 1e3 * reading(), 1e3 * reading() + np.sin(TIME))
    with pytest.raises(TunnelError, match=r'2 columns may be the displacement: .*; give --angle "x1'):
        read_records([path])


def test_a_force_beside_an_angle_stays_out(tmp_path: Path) -> None:
    """Of an angle the unit N shows no input, and a moment does."""
    (run,) = read_records([file_of(tmp_path, "time (s),yaw (rad),force (N)", reading(), PUSH)]).campaign.runs
    assert run.drive is None
    (run,) = read_records(
        [file_of(tmp_path, "time (s),yaw (rad),torque (Nm)", reading(), PUSH)]
    ).campaign.runs
    assert run.drive is not None
    assert run.drive.column == "moment_nm"


def test_a_table_of_conditions_has_own_names_and_units(tmp_path: Path) -> None:
    table = tmp_path / "runs.csv"
    table.write_text("file,k (N/mm),release_displacement (mm)\nlog.csv,0.05,20\n")
    path = file_of(tmp_path, "time (s),x (mm),force (N)", 1e3 * reading(), PUSH)
    (run,) = read_records([path], conditions=table).campaign.runs
    assert run.spring_stiffness == pytest.approx(50.0)
    assert run.release_angle == pytest.approx(0.02)
    path = file_of(tmp_path, "time (s),yaw (rad),torque (Nm)", reading(), PUSH)
    with pytest.raises(
        TunnelError, match=r"'k \(N/mm\)' is of a displacement, and the readings are of an angle"
    ):
        read_records([path], conditions=table)


def test_a_prismatic_joint_of_a_robot_log(tmp_path: Path) -> None:
    """Its message names no unit; ``--unit m`` makes it a displacement, whose effort is in N."""
    stamps = START_NS + np.round(1e9 * TIME).astype(np.int64)
    messages = [
        ("/joint_states", JOINT_STATE, stamp, joint_state(stamp, ["slide"], [x], (), [force]))
        for stamp, x, force in zip(stamps.tolist(), reading().tolist(), PUSH.tolist(), strict=True)
    ]
    write_mcap(tmp_path / "slide.mcap", messages)
    choices = ImportChoices(unit="m", input_as="force_n")
    (run,) = read_records([tmp_path / "slide.mcap"], choices).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, reading(), rtol=1e-9, atol=1e-12)
    assert run.drive is not None
    assert run.drive.column == "moment_nm"
    np.testing.assert_allclose(run.drive.values, PUSH)


@pytest.mark.parametrize(
    ("setting", "si"),
    [("50 N/m", 50.0), ("0,05 N/mm", 50.0), ("0.05 kN/m", 50.0), ("50", 50.0)],
)
def test_a_stiffness_is_stated_in_a_unit_of_the_motion(tmp_path: Path, setting: str, si: float) -> None:
    stated, _ = parse_setting(f"spring_stiffness={setting}", "--set")
    choices = ImportChoices(conditions=stated)
    path = file_of(tmp_path, "time (s),x (mm),force (N)", 1e3 * reading(), PUSH)
    assert read_records([path], choices).campaign.runs[0].spring_stiffness == pytest.approx(si)
    import_records([path], tmp_path / "c", choices)
    assert read_recipe(tmp_path / "c").conditions == stated
    assert settings_from(settings_of(choices))["conditions"]["spring_stiffness"] == pytest.approx(si)


@pytest.mark.parametrize(
    ("unit", "heading", "motions"),
    [
        ("N m/rad", "time (s),x (mm),force (N)", ("angle", "displacement")),
        ("N/m", "time (s),yaw (mrad),torque (Nm)", ("displacement", "angle")),
    ],
)
def test_a_stiffness_in_a_unit_of_the_other_motion_is_refused(
    tmp_path: Path, unit: str, heading: str, motions: tuple[str, str]
) -> None:
    stated, _ = parse_setting(f"spring_stiffness=50 {unit}", "--set")
    path = file_of(tmp_path, heading, 1e3 * reading(), PUSH)
    with pytest.raises(TunnelError, match=f"motion = '{motions[0]}', and the readings are of '{motions[1]}'"):
        read_records([path], ImportChoices(conditions=stated))


def test_units_of_both_motions_are_named_for_a_unit_of_neither() -> None:
    with pytest.raises(TunnelError, match=r"use one of N m/rad, .*; of a displacement N/m, N/mm, kN/m"):
        parse_setting("spring_stiffness=50 N", "--set")
    with pytest.raises(TunnelError, match=r"use one of m/s,[^;]*$"):
        parse_setting("wind_speed=5 N", "--set")


def test_a_mass_of_an_angle_is_asked_about(tmp_path: Path) -> None:
    path = file_of(tmp_path, "time (s),signal", reading())
    with pytest.raises(TunnelError, match=r"'mass' is stated, .*; give yaw_inertia, or state --unit m$"):
        read_records([path], ImportChoices(conditions=Conditions(mass=2.0)))


def test_the_picture_names_the_input_as_the_campaign_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    labels: list[str] = []
    monkeypatch.setattr(Axes, "set_ylabel", lambda _, text, **__: labels.append(text))
    import_picture(read_records([file_of(tmp_path, "time (s),x (mm),force (N)", 1e3 * reading(), PUSH)]))
    assert set(labels) == {"reading [m]", "input force_n"}
