"""Conditions and names of runs in the columns and heads of files. Truth: the numbers that were written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from tests.support.import_files import decay, written
from tunnel_sim import Repeatability, TunnelError
from tunnel_sim.files.importing.choices import ImportChoices, parse_setting
from tunnel_sim.files.importing.condition_names import Conditions, condition_of, in_si
from tunnel_sim.files.importing.records import Imported, read_records
from tunnel_sim.files.importing.units import split_unit

TIME, ANGLE = decay()


def table(
    folder: Path, heads: list[str], columns: list[object], head: str = "", name: str = "log.csv"
) -> Path:
    """A file with times, angles and further columns of numbers or texts, each constant or of shape (n,)."""
    full = [np.broadcast_to(np.asarray(column), TIME.shape).tolist() for column in columns]
    rows = (";".join(map(str, row)) for row in zip(TIME.tolist(), ANGLE.tolist(), *full, strict=True))
    return written(
        folder, name, "\n".join([*([head] if head else []), ";".join(["time_s", "yaw_rad", *heads]), *rows])
    )


def imported(folder: Path, heads: list[str], columns: list[object], **options: str) -> Imported:
    return read_records([table(folder, heads, columns, **options)])


@pytest.mark.parametrize(
    ("heading", "key", "factor"),
    [
        ("wind_speed", "wind_speed", 1.0),
        ("V [m/s]", "wind_speed", 1.0),
        ("v (km/h)", "wind_speed", 1.0 / 3.6),
        ("U∞ [m/s]", "wind_speed", 1.0),
        ("U_ms", "wind_speed", 1.0),
        ("Windgeschwindigkeit", "wind_speed", 1.0),
        ("wind_speed_ms", "wind_speed", 1.0),
        ("Wind speed / (m/s)", "wind_speed", 1.0),
        ("Airspeed kn", "wind_speed", 1852.0 / 3600.0),
        ("Luftdichte", "air_density", 1.0),
        ("rho", "air_density", 1.0),
        ("rho [kg/m³]", "air_density", 1.0),
        ("Dichte (g/cm³)", "air_density", 1000.0),
        ("Kr", "spring_stiffness", 1.0),
        ("K_r [N·m/rad]", "spring_stiffness", 1.0),
        ("Federkonstante (Nmm/rad)", "spring_stiffness", 1e-3),
        ("spring_stiffness_N_m_rad", "spring_stiffness", 1.0),
        ("Drehfedersteifigkeit [Nm/°]", "spring_stiffness", 180.0 / np.pi),
        ("release_angle_deg", "release_angle", np.pi / 180.0),
        ("Auslenkwinkel", "release_angle", 1.0),
        ("frontal_area", "frontal_area", 1.0),
    ],
)
def test_the_spellings_of_a_condition(heading: str, key: str, factor: float) -> None:
    name, unit = split_unit(heading)
    assert condition_of(name, unit) == key
    assert in_si(key, unit) == pytest.approx(factor)


@pytest.mark.parametrize(
    "heading",
    [
        "V",
        "V [V]",
        "U [V]",
        "speed",
        "wind",
        "speed [rpm]",
        "Velocity (m/s)",
        "yaw",
        "angle",
        "time_s",
        "width_mm",
        "width [mm]",
    ],
)
def test_other_names_are_not_conditions(heading: str) -> None:
    assert condition_of(*split_unit(heading)) is None


@pytest.mark.parametrize("units", [True, False])
def test_a_column_of_the_wind_speed_is_not_the_clock(units: bool, tmp_path: Path) -> None:
    path = table(tmp_path, ["V [m/s]", "Kr", "Luftdichte"], [54.0, 16.12, 1.2])
    text = path.read_text(encoding="utf-8").replace("V [m/s]", "Windgeschwindigkeit")
    first, rest = text.split("\n", 1)
    path.write_text(
        f"{first}\n{'s;rad;km/h;Nm/rad;kg/m3' if units else '[s];[rad];[km/h];[Nm/rad];[kg/m^3]'}\n{rest}"
    )
    (run,) = read_records([path]).campaign.runs
    assert (run.wind_speed, run.spring_stiffness, run.air_density) == (pytest.approx(15.0), 16.12, 1.2)
    np.testing.assert_array_equal(run.record.time_s, TIME)


def test_a_row_of_units_may_hold_unknown_ones(tmp_path: Path) -> None:
    path = table(tmp_path, ["Kraft"], [3.0])
    first, rest = path.read_text().split("\n", 1)
    path.write_text(f"{first}\ns;rad;daN\n{rest}")
    (run,) = read_records([path]).campaign.runs
    assert run.record.yaw_rad.size == TIME.size


def test_a_measured_wind_speed_is_its_median_and_one_about_zero_is_none(tmp_path: Path) -> None:
    noise = 0.1 * np.random.default_rng(1).standard_normal(TIME.size)
    found = imported(tmp_path, ["V [m/s]", "rho"], [12.0 + noise, 1.2])
    assert found.campaign.runs[0].wind_speed == pytest.approx(12.0, abs=0.02)
    assert any(
        "the column 'V' varies from 11.8" in line and "wind_speed is its median" in line
        for line in found.remarks()
    )
    found = imported(tmp_path, ["V [m/s]"], [noise + 0.02])
    assert found.campaign.runs[0].wind_speed == 0.0
    assert any("wind_speed is zero, about which it lies" in line for line in found.remarks())
    late = np.where(np.arange(TIME.size) < 0.2 * TIME.size, 0.0, 12.0)
    assert imported(tmp_path, ["V [m/s]", "rho"], [late, 1.2]).campaign.runs[0].wind_speed == 12.0


def test_a_condition_that_changes_between_releases_belongs_to_each_run(tmp_path: Path) -> None:
    angle = np.concatenate([ANGLE, np.full(300, 0.35), ANGLE])
    time = np.arange(angle.size) / 200.0
    speed = np.where(np.arange(angle.size) < TIME.size + 100, 0.0, 15.0)
    rows = "".join(f"{t},{a},{v},1.2\n" for t, a, v in zip(time.tolist(), angle.tolist(), speed, strict=True))
    runs = read_records(
        [written(tmp_path, "day.csv", f"time_s,yaw_rad,wind_speed,rho\n{rows}")]
    ).campaign.runs
    assert [run.wind_speed for run in runs] == [0.0, 15.0]


def test_a_unit_that_is_not_known_is_said_and_the_column_left_out(tmp_path: Path) -> None:
    found = imported(tmp_path, ["Kr (N/m)", "Velocity (m/s)"], [16.12, 3.0 * np.cos(TIME)])
    assert found.campaign.runs[0].spring_stiffness is None
    said = "\n".join(found.remarks())
    assert "'Kr (N/m)' is left out: its unit is not one of N m/rad" in said
    assert "'Velocity' in m/s is left out: its name is not a condition's" in said


def test_the_user_and_the_table_come_before_the_columns(tmp_path: Path) -> None:
    path = table(tmp_path, ["Kr", "V [m/s]", "rho", "run"], [16.12, 5.0, 1.2, "day 1"])
    conditions = written(tmp_path, "runs.csv", "run,wind_speed\nday 1,7\n")
    choices = ImportChoices(conditions=Conditions(spring_stiffness=20.0))
    (run,) = read_records([path], choices, conditions=conditions).campaign.runs
    assert (run.id, run.spring_stiffness, run.wind_speed, run.air_density) == ("day 1", 20.0, 7.0, 1.2)


@pytest.mark.parametrize("heading", ["run", "Run No.", "Lauf", "Versuch Nr", "Messung Nr."])
@pytest.mark.parametrize("names", [("a", "b"), ("07", "8"), ("1.5", "nan")])
def test_a_column_that_names_the_runs_keeps_their_names(
    heading: str, names: tuple[str, str], tmp_path: Path
) -> None:
    half = TIME.size // 2
    found = imported(tmp_path, [heading], [np.repeat(names, [half, TIME.size - half])])
    assert [run.id for run in found.campaign.runs] == list(names)
    assert [run.record.time_s.size for run in found.campaign.runs] == [half, TIME.size - half]
    frame = pl.DataFrame(
        {"time_s": TIME, "yaw_rad": ANGLE, heading: np.repeat(names, [half, TIME.size - half])}
    )
    frame.write_parquet(tmp_path / "log.parquet")
    assert [run.id for run in read_records([tmp_path / "log.parquet"]).campaign.runs] == list(names)


def test_a_column_that_changes_all_the_time_names_no_runs(tmp_path: Path) -> None:
    for column in (np.arange(TIME.size), np.arange(TIME.size) // 50 % 2, [f"r{i}" for i in range(TIME.size)]):
        (run,) = imported(tmp_path, ["run"], [column]).campaign.runs
        assert run.record.yaw_rad.size == TIME.size


def test_numbers_above_the_table_have_their_units(tmp_path: Path) -> None:
    head = "Wind speed: 54 km/h, Kr = 16120 N mm/rad, ρ = 1,21"
    (run,) = imported(tmp_path, [], [], head=head).campaign.runs
    assert (run.wind_speed, run.spring_stiffness, run.air_density) == pytest.approx((15.0, 16.12, 1.21))
    with pytest.raises(TunnelError, match="density"):
        imported(tmp_path, [], [], head="Wind speed: 54 km/h, Kr = 16120 N mm/rad")


def test_the_scatter_between_runs_may_be_stated(tmp_path: Path) -> None:
    path = table(tmp_path, ["Kr"], [16.12])
    conditions, _ = parse_setting(
        "repeatability_wind_speed=0.003, repeatability_mechanical_damping=0.01", "--set"
    )
    found = read_records([path], ImportChoices(conditions=conditions)).campaign
    assert found.repeatability == Repeatability(wind_speed=0.003, mechanical_damping=0.01)
    assert read_records([path]).campaign.repeatability is None
    with pytest.raises(TunnelError, match="give repeatability_wind_speed as a relative standard deviation"):
        parse_setting("repeatability_wind_speed=1", "--set")


def test_files_that_state_different_rigs_are_refused(tmp_path: Path) -> None:
    paths = [table(tmp_path, ["frontal_area"], [area], name=f"{area}.csv") for area in (0.036, 0.04)]
    with pytest.raises(
        TunnelError, match=r"frontal_area = 0.04, and 0.036 in another run; give --set frontal_area"
    ):
        read_records(paths)
    sizes = ImportChoices(conditions=Conditions(frontal_area=0.05))
    assert read_records(paths, sizes).campaign.rig.frontal_area == 0.05
    assert imported(tmp_path, ["width"], [800.0]).campaign.rig.width is None  # many things have a width
