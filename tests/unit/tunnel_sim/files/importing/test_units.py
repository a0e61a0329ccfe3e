"""Where a heading states a unit, and that a written unit is taken or asked for. Truth: headings by hand."""

from __future__ import annotations

from pathlib import Path

import h5py
import nptdms
import numpy as np
import polars as pl
import pytest

from tests.support.import_files import decay, written
from tunnel_sim import TunnelError
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.records import read_records
from tunnel_sim.files.importing.units import UNITS, known_unit, split_unit

HEADINGS = {
    "Zeit/s": ("Zeit", "s"),
    "Winkel/Grad": ("Winkel", "deg"),
    "WINKEL/GRAD": ("WINKEL", "deg"),
    "Winkel/°": ("Winkel", "deg"),
    "Winkel°": ("Winkel", "deg"),
    "φ / rad": ("φ", "rad"),
    "φ in (°)": ("φ", "deg"),
    "t in ms": ("t", "ms"),
    "t (in s)": ("t", "s"),
    "Zeit in min": ("Zeit", "min"),
    "time in min": ("time", "min"),
    "elapsed time s": ("elapsed time", "s"),
    "tijd min": ("tijd", "min"),
    "Zeit in Sekunden seit Start": ("Zeit", "s"),
    "Drehwinkel (Grad)": ("Drehwinkel", "deg"),
    "Winkel [grad]": ("Winkel", "deg"),
    "Winkel/gon": ("Winkel", "gon"),
    "timeMs": ("time", "ms"),
    "angleDeg": ("angle", "deg"),
    "yawRad": ("yaw", "rad"),
    "ZGyro": ("ZGyro", ""),
    "Angle (degrés)": ("Angle", "deg"),
    "Ángulo (grados)": ("Ángulo", "deg"),
    "角度 (度)": ("角度", "deg"),
    "時間 (秒)": ("時間", "s"),
    "Angle - deg": ("Angle", "deg"),
    "Angle:deg": ("Angle", "deg"),
    "U/V": ("U", "V"),
    "V/km/h": ("V", "km/h"),
    "v / (km/h)": ("v", "km/h"),
    "ω / rad/s": ("ω", "rad/s"),
    "ω in rad s⁻¹": ("ω", "rad/s"),
    "n / U/min": ("n", "rpm"),
    "Winkelgeschwindigkeit / (Grad/s)": ("Winkelgeschwindigkeit", "deg/s"),
    "Kr / (Nm/Grad)": ("Kr", "N m/deg"),
    "rad/s": ("rad/s", "rad/s"),
    "m/s": ("m/s", "m/s"),
    "s": ("s", "s"),
    "°": ("°", "deg"),
    "time_min": ("time", "min"),
    "yaw_deg": ("yaw", "deg"),
    "yaw_rate_rad_s": ("yaw_rate", "rad/s"),
    "omega_n_rad_per_s": ("omega_n", "rad/s"),
    "gyro_z [°/s]": ("gyro_z", "deg/s"),
    "wind speed m/s": ("wind speed", "m/s"),
    "F N/s": ("F", "N/s"),
    "Winkel [Inkr.]": ("Winkel", "counts"),
    "Angle, Ch 1+2 (rad) Run #1": ("Angle, Ch 1+2 Run #1", "rad"),
    "Winkel/Grad Run 1": ("Winkel Run 1", "deg"),
    # Units that are not known are kept as they are written.
    "angle [grad]": ("angle [grad]", "grad"),
    "angle/grad": ("angle", "grad"),
    "angle in arcmin": ("angle", "arcmin"),
    "Weg mm/s": ("Weg", "mm/s"),
    "Temperatur in Grad": ("Temperatur", "°C"),
    "Output Current (A)": ("Output Current (A)", "A"),
    "Kraft [daN/s]": ("Kraft [daN/s]", "daN/s"),
    # Words that are not units.
    "min": ("min", ""),
    "V": ("V", ""),
    "h": ("h", ""),
    "yaw_min": ("yaw_min", ""),
    "temp_h": ("temp_h", ""),
    "yaw_grad": ("yaw_grad", ""),
    "Zeit/Run": ("Zeit/Run", ""),
    "Zeit/Run 1": ("Zeit/Run 1", ""),
    "Dev1/ai0": ("Dev1/ai0", ""),
    "data[1]": ("data[1]", ""),
    "Position in tunnel axis": ("Position in tunnel axis", ""),
    "flow_kg_s": ("flow_kg_s", ""),
}


@pytest.mark.parametrize("heading", HEADINGS)
def test_a_heading_states_its_unit(heading: str) -> None:
    assert split_unit(heading) == HEADINGS[heading]


def test_the_german_degree_is_a_degree_and_the_gon_is_not() -> None:
    known = {"Grad": "deg", "[Grad]": "deg", "Grad/s": "deg/s", "grad": None, "gon": "gon", "Neugrad": "gon"}
    known |= {"[°]": "deg", "µs": "us", "Degrees": "deg", "N m": None, "rad/s²": "rad/s2"}
    assert {text: known_unit(text) for text in known} == known
    assert UNITS["angle"]["gon"] == pytest.approx(2.0 * np.pi / 400.0)


IMPORTS = {
    "Zeit/s;Winkel/Grad": (1.0, np.pi / 180.0),
    "Zeit/min;Winkel/°": (60.0, np.pi / 180.0),
    "time in min;angle in deg": (60.0, np.pi / 180.0),
    "t in ms;φ / mrad": (1e-3, 1e-3),
    "s;°": (1.0, np.pi / 180.0),
    "Zeit;Winkel\ns;Grad": (1.0, np.pi / 180.0),
    "Zeit;Winkel\n[s];[grad]": (1.0, np.pi / 180.0),
    "t in h;Winkel in gon": (3600.0, np.pi / 200.0),
}


def log(folder: Path, heading: str, time: np.ndarray, angle: np.ndarray) -> Path:
    rows = "\n".join(f"{t:.9g};{y:.12g}" for t, y in zip(time, angle, strict=True))
    return written(folder, "log.csv", f"{heading}\n{rows}\n")


@pytest.mark.parametrize("heading", IMPORTS)
def test_the_unit_of_a_heading_is_the_one_that_is_read(heading: str, tmp_path: Path) -> None:
    second, radian = IMPORTS[heading]
    time, angle = decay(1)
    imported = read_records([log(tmp_path, heading, time / second, angle / radian)])
    (run,) = imported.campaign.runs
    np.testing.assert_allclose(run.record.time_s, time, atol=1e-4 * second)
    np.testing.assert_allclose(run.record.yaw_rad, angle, atol=1e-9)
    assert not any("no unit" in line for line in imported.remarks())


@pytest.mark.parametrize(
    ("heading", "option"),
    [
        ("time in s;angle in arcmin", "--unit"),
        ("t/s;angle [grad]", "--unit"),
        ("t/s;yaw_grad", "--unit"),
        ("t/s;yaw_deg_filtered", "--unit"),
        ("t/Foo;yaw/rad", "--time-unit"),
        ("time in fortnights;yaw/rad", "--time"),
        ("time_ms_raw;yaw/rad", "--time-unit"),
    ],
)
def test_a_unit_that_is_written_but_not_known_is_asked_for(heading: str, option: str, tmp_path: Path) -> None:
    time, angle = decay(1)
    with pytest.raises(TunnelError, match=option):
        read_records([log(tmp_path, heading, time, angle)])


def test_a_temperature_in_degrees_is_not_an_angle(tmp_path: Path) -> None:
    time, angle = decay(1)
    rows = "\n".join(f"{t:.3f};{20.0 + t};{np.rad2deg(y):.9f}" for t, y in zip(time, angle, strict=True))
    path = written(tmp_path, "log.csv", f"Zeit/s;Temperatur/Grad;Winkel/Grad\n{rows}\n")
    np.testing.assert_allclose(read_records([path]).campaign.runs[0].record.yaw_rad, angle, atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        *((kind, "run") for kind in ("h5", "mat", "mat 7.3", "tdms", "csv", "parquet", "xlsx")),
        ("csv", "Lauf"),
        ("csv", "drive_hold"),
    ],
)
def test_a_table_of_nothing_but_names_of_runs_is_refused_in_one_line(
    kind: str, name: str, tmp_path: Path
) -> None:
    numbers = np.repeat([1.0, 2.0], 50)
    path = tmp_path / f"log.{kind.partition(' ')[0]}"
    if kind in ("h5", "mat 7.3"):
        with h5py.File(path, "w") as file:
            file[name] = numbers
    elif kind == "mat":
        from scipy.io import savemat

        savemat(path, {name: numbers})
    elif kind == "tdms":
        with nptdms.TdmsWriter(path) as writer:
            writer.write_segment([nptdms.ChannelObject("g", name, numbers)])
    elif kind == "csv":
        pl.DataFrame({name: numbers}).write_csv(path)
    elif kind == "parquet":
        pl.DataFrame({name: numbers}).write_parquet(path)
    else:
        pl.DataFrame({name: numbers}).write_excel(path)
    with pytest.raises(TunnelError, match="no column") as caught:
        read_records([path])
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("heading", ["gyro_rads", "omega [rad]", "speed (deg)"])
def test_a_rate_in_a_unit_of_an_angle_is_asked_about(heading: str, tmp_path: Path) -> None:
    time, angle = decay()
    rows = "".join(f"{t:.3f},{y:.8f}\n" for t, y in zip(time, angle, strict=True))
    path = written(tmp_path, "log.csv", f"time_s,{heading}\n{rows}")
    with pytest.raises(TunnelError, match=r"is a rate by its name, and in (rad|deg), a unit of an angle"):
        read_records([path])
    assert read_records([path], ImportChoices(unit="rad/s")).campaign.sensor.quantity == "rate"


@pytest.mark.parametrize("head", ["Units: deg", "angle_unit: deg", "Einheit;Grad"])
def test_a_unit_above_the_table_is_not_passed_over(head: str, tmp_path: Path) -> None:
    """A swing of 0.35 degrees would be taken as one of 0.35 rad."""
    time, angle = decay()
    rows = "".join(f"{t:.3f};{y:.8f}\n" for t, y in zip(time, angle, strict=True))
    path = written(tmp_path, "log.csv", f"{head}\nt [s];yaw\n{rows}")
    with pytest.raises(TunnelError, match="may state the unit of 'yaw'; give --unit deg, or --unit rad"):
        read_records([path])
    (run,) = read_records([path], ImportChoices(unit="deg")).campaign.runs
    assert run.record.yaw_rad == pytest.approx(np.radians(angle), abs=1e-8)


def test_a_calibration_converts_millivolts_whatever_the_unit_of_the_angle(tmp_path: Path) -> None:
    time, angle = decay()
    volts = np.degrees(angle) / 20.0
    rows = "".join(f"{t:.3f},{1e3 * v:.6f}\n" for t, v in zip(time, volts, strict=True))
    path = written(tmp_path, "log.csv", f"t [s],sensor [mV]\n{rows}")
    (run,) = read_records([path], ImportChoices(calibration="20*V", unit="deg")).campaign.runs
    assert run.record.yaw_rad == pytest.approx(angle, abs=1e-6)
