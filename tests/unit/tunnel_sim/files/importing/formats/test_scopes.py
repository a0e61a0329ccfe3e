"""Files of oscilloscopes: the header beside or above the numbers states units and the sample interval.

Truth: the voltage that each file was made from.
"""

from __future__ import annotations

import gzip
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.import_files import RATE, decay, written
from tunnel_sim import TunnelError
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.formats.text import TEXT
from tunnel_sim.files.importing.records import read_records

TIME, ANGLE = decay()
VOLTS = ANGLE / 0.5
_HEADER = [
    ("Record Length", f"{TIME.size:e}"), ("Sample Interval", f"{1 / RATE:e}"), ("Trigger Point", "1.25e3"),
    ("", ""),
    ("Source", "CH1"), ("Vertical Units", "V"), ("Vertical Scale", "2e-1"), ("Horizontal Units", "s"),
    ("Probe Atten", "1.0"), ("Serial Number", "C012"),
]  # fmt: skip


def beside(quote: str = "", unit: str = "", *, both: bool = False) -> str:
    """The header in the columns before the numbers, as by Tektronix; ``both``: two blocks side by side."""
    lines = []
    for i, (t, v) in enumerate(zip(TIME - 4.0, VOLTS, strict=True)):
        name, value = _HEADER[i] if i < len(_HEADER) else ("", "")
        start = ",".join([f"{quote}{name}{quote}" if name else "", value, unit if name else ""])
        block = f"{start},{t:017.12f},{v:10.6f},"
        lines.append(block + f"{start},{t:017.12f},{v * 0.0 + 0.1 * (i % 2):10.5f}," if both else block)
    return "\n".join(lines)


def without_times() -> str:
    """The header beside one column."""
    rows = [(*(_HEADER[i] if i < len(_HEADER) else ("", "")), f"{v:.6f}") for i, v in enumerate(VOLTS)]
    return "\n".join(f"{name},{value},,{volts}" for name, value, volts in rows)


def above() -> str:
    """The header above the names, as by newer ones."""
    head = "\n".join(f"{name},{value}," for name, value in _HEADER)
    return f"Model,MSO54\n{head}\n\nTIME,CH1\n" + _pairs()


def units_below() -> str:
    """A row of units below the names, as by Keysight."""
    return "x-axis,1\nsecond,Volt\n" + _pairs()


def increment() -> str:
    """A count of samples, and its start and increment in the header, as by Rigol."""
    rows = "\n".join(f"{i},{v:.6f},," for i, v in enumerate(VOLTS))
    return f"X,CH1,Start,Increment,\nSequence,VOLT,-4.0,{1 / RATE:e}\n{rows}"


def _pairs() -> str:
    return "\n".join(f"{t:.6f},{v:.6f}" for t, v in zip(TIME - 4.0, VOLTS, strict=True))


LAYOUTS: dict[str, Callable[[], str]] = {
    "beside": beside,
    "quoted": lambda: beside('"'),
    "with units": lambda: beside(unit="Points"),
    "without times": without_times,
    "above": above,
    "units below": units_below,
    "increment": increment,
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_volts_are_asked_for_and_read_with_the_times_of_the_header(layout: str, tmp_path: Path) -> None:
    path = written(tmp_path, "F0000CH1.CSV", LAYOUTS[layout]() + "\n")
    with pytest.raises(TunnelError, match=r"is in V; give --calibration|'Volt' in the name of 'Volt' may be"):
        read_records([path])
    (run,) = read_records([path], ImportChoices(calibration="0.5*V")).campaign.runs
    np.testing.assert_allclose(run.record.time_s, TIME, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(run.record.yaw_rad, ANGLE, rtol=0.0, atol=1e-6)


def test_a_column_has_the_number_that_it_has_in_the_file(tmp_path: Path) -> None:
    path = written(tmp_path, "F0000CH1.CSV", beside() + "\n")
    for angle in ("5", "column 5"):
        choices = ImportChoices(angle=(angle,), calibration="0.5*V")
        (run,) = read_records([path], choices).campaign.runs
        np.testing.assert_allclose(run.record.yaw_rad, ANGLE, rtol=0.0, atol=1e-6)
    with pytest.raises(TunnelError, match="no column '2'"):
        read_records([path], ImportChoices(angle=("2",)))
    rows = "".join(f"{i},note,{t:.3f},{y:.6f}\n" for i, (t, y) in enumerate(zip(TIME, ANGLE, strict=True)))
    path = written(tmp_path, "log.csv", "n,remark,t,yaw_rad\n" + rows)
    (run,) = read_records([path], ImportChoices(time="3", angle=("4",))).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, ANGLE, rtol=0.0, atol=1e-6)


def test_two_blocks_side_by_side_are_both_read(tmp_path: Path) -> None:
    path = written(tmp_path, "ALL.CSV", beside(both=True) + "\n")
    (run,) = read_records([path], ImportChoices(angle=("5",), calibration="0.5*V")).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, ANGLE, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("name", ["Voltage", "CH1", "Dev1/ai0", "ai3", "Spannung", "Channel 2", "Vout"])
def test_a_voltage_by_its_name_is_not_taken_as_an_angle(name: str, tmp_path: Path) -> None:
    rows = "".join(f"{t:.3f},{v:.6f}\n" for t, v in zip(TIME, VOLTS, strict=True))
    path = written(tmp_path, "log.csv", f"Timed,{name}\n{rows}")
    with pytest.raises(TunnelError, match=r"may be a voltage by its name.*give --calibration"):
        read_records([path])
    (run,) = read_records([path], ImportChoices(unit="rad")).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, VOLTS, rtol=0.0, atol=1e-6)
    (run,) = read_records([path], ImportChoices(calibration="V/2")).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, ANGLE, rtol=0.0, atol=1e-6)


def test_a_compressed_table_is_read_with_the_name_of_its_content(tmp_path: Path) -> None:
    rows = "".join(f"{t:.3f},{y:.6f}\n" for t, y in zip(TIME, ANGLE, strict=True)).encode()
    content = gzip.compress(b"t,yaw_rad\n" + rows[:9000]) + gzip.compress(rows[9000:])  # in two members
    path = written(tmp_path, "K2_V10.csv.gz", content)
    choices = ImportChoices(name="K{spring}_V{wind_speed}", conditions={"air_density": 1.2})
    (run,) = read_records([path], choices).campaign.runs
    assert (run.id, run.wind_speed, run.spring_stiffness) == ("K2_V10", 10.0, 2.0)
    np.testing.assert_allclose(run.record.yaw_rad, ANGLE, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (gzip.compress(b"t,yaw_rad\n0,1\n")[:-9], "it ends too early"),
        (b"\x1f\x8b" + bytes(40), "is not a file compressed by gzip"),
        (gzip.compress(bytes(2**21)), "bytes once unpacked, more than 1,048,576"),
        (b"", "the file is empty"),
        (gzip.compress(b""), "the file is empty"),
        (gzip.compress(b"\x89HDF\r\n\x1a\n"), "it begins like an HDF5 file"),
    ],
    ids=["cut", "not gzip", "huge", "empty", "empty inside", "another format"],
)
def test_a_damaged_or_huge_compressed_file_is_refused_in_one_line(
    content: bytes, what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tunnel_sim.files.importing.source.TEXT", replace(TEXT, limit=2**20))
    path = written(tmp_path, "log.txt.gz", content)
    with pytest.raises(TunnelError, match=rf"^[^\n]*{what}[^\n]*$"):
        read_records([path])
