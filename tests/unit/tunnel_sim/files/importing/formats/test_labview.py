"""LabVIEW measurement files of every layout become the numbers that were written.

Truth: the numbers that each file was made from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path

import numpy as np
import pytest

from tests.support.import_files import RATE, decay, written
from tunnel_sim import TunnelError
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.records import read_records
from tunnel_sim.vocabulary.record import Array

TIME, ANGLE = decay()


@dataclass(frozen=True)
class Column:
    """A channel: its values, its unit, its step and start in s."""

    name: str
    values: Array
    unit: str
    step: float = 1.0 / RATE
    x0: float = 0.0


@dataclass(frozen=True)
class Lvm:
    """The layout of a file; ``segments`` of channels, each with its time of day."""

    x_columns: str
    segments: Sequence[tuple[Sequence[Column], str]]
    sign: str = "Tab"
    decimal: str = "."
    note: str = ""
    every: dict[str, int] = field(default_factory=dict)

    def content(self) -> str:
        """The text."""
        sign = {"Tab": "\t", "Comma": ",", "Semicolon": ";"}[self.sign]
        head = {
            "Writer_Version": "2", "Reader_Version": "2", "Separator": self.sign, "Decimal_Separator": self.decimal,
            "Multi_Headings": "Yes" if len(self.segments) > 1 else "No", "X_Columns": self.x_columns,
            "Time_Pref": "Relative", "Operator": "bench", "Date": "2024/03/05", "Time": "10:11:12,25",
        }  # fmt: skip
        lines = ["LabVIEW Measurement" + sign, *(f"{key}{sign}{value}" for key, value in head.items())]
        lines += [f"Description{sign}{self.note}"] if self.note else []
        lines += [f"***End_of_Header***{sign}", sign]
        for channels, clock in self.segments:
            lines += self._segment(channels, clock, sign)
        return "\n".join(lines) + "\n"

    def _segment(self, channels: Sequence[Column], clock: str, sign: str) -> list[str]:
        multi = self.x_columns == "Multi"
        stated = {
            "Samples": [str(c.values.size) for c in channels], "Date": ["2024/03/05"] * len(channels),
            "Time": [clock] * len(channels), "Y_Unit_Label": [c.unit for c in channels],
            "X_Dimension": ["Time"] * len(channels), "X0": [self._number(c.x0) for c in channels],
            "Delta_X": [self._number(c.step) for c in channels],
        }  # fmt: skip
        between = sign + sign if multi else sign
        lines = [f"Channels{sign}{len(channels)}{sign}"]
        lines += [f"{key}{sign}{between.join(cells)}{sign}" for key, cells in stated.items()]
        times = [[self._number(c.x0 + i * c.step) for i in range(c.values.size)] for c in channels]
        values = [[self._number(float(v)) for v in c.values] for c in channels]
        pairs = zip(times, values, strict=True)
        if multi:
            names = [name for c in channels for name in ("X_Value", c.name)]
            columns = [column for pair in pairs for column in pair]
        else:
            names = ["X_Value", *(c.name for c in channels)]
            columns = [[] if self.x_columns == "No" else times[0], *values]
        rows = zip_longest(*columns, fillvalue="")
        lines += [f"***End_of_Header***{sign}", sign.join([*names, "Comment"])]
        return [*lines, *(sign.join([*row, ""]) for row in rows), ""]

    def _number(self, value: float) -> str:
        return f"{value:.8f}".replace(".", self.decimal)


def degrees(first: int = 0, last: int | None = None, unit: str = "Degrees") -> Column:
    """A part of the angle, in degrees."""
    return Column("Pitch", np.rad2deg(ANGLE[first:last]), unit, x0=first / RATE)


@pytest.mark.parametrize("x_columns", ["One", "No", "Multi"])
@pytest.mark.parametrize(
    ("sign", "decimal"), [("Tab", "."), ("Tab", ","), ("Comma", "."), ("Semicolon", ",")]
)
def test_a_layout_is_read_with_the_units_and_times_of_its_header(
    x_columns: str, sign: str, decimal: str, tmp_path: Path
) -> None:
    small = Column("Pitch", np.rad2deg(0.1 * ANGLE), "deg")
    volts = Column("Reference", 1.2 + 0.01 * np.sin(TIME), "Volts")
    file = Lvm(x_columns, [((small, volts), "10:11:12.25")], sign, decimal)
    found = read_records([written(tmp_path, "log.lvm", file.content())])
    (run,) = found.campaign.runs
    np.testing.assert_allclose(run.record.time_s, TIME, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(run.record.yaw_rad, 0.1 * ANGLE, rtol=0.0, atol=1e-9)
    assert run.drive is None


@pytest.mark.parametrize("x_columns", ["One", "No", "Multi"])
def test_segments_are_runs_and_parts_of_one_record_are_joined(x_columns: str, tmp_path: Path) -> None:
    both = Lvm(x_columns, [((degrees(),), "10:11:12.25"), ((degrees(),), "10:13:00.00")])
    first, second = read_records([written(tmp_path, "two.lvm", both.content())]).campaign.runs
    assert (first.id, second.id) == ("segment 1", "segment 2")
    for run in (first, second):
        np.testing.assert_allclose(run.record.yaw_rad, ANGLE, rtol=0.0, atol=1e-9)
    parts = [((degrees(a, a + 400),), "10:11:12.25") for a in range(0, 1600, 400)]
    (whole,) = read_records([written(tmp_path, "parts.lvm", Lvm(x_columns, parts).content())]).campaign.runs
    np.testing.assert_allclose(whole.record.yaw_rad, ANGLE, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(whole.record.time_s, TIME, rtol=0.0, atol=1e-7)


@pytest.mark.parametrize("x_columns", ["One", "No", "Multi"])
def test_channels_that_start_at_other_times_are_aligned(x_columns: str, tmp_path: Path) -> None:
    torque = np.sin(5.0 * TIME + 0.5 * TIME**2)
    late = Column(
        "angle", np.convolve(torque, 0.01 * np.exp(-0.05 * np.arange(100.0)))[70 : TIME.size], "rad", x0=0.35
    )
    channels = (Column("torque", torque, "N m"), late)
    found = read_records(
        [written(tmp_path, "log.lvm", Lvm(x_columns, [(channels, "10:11:12.25")]).content())]
    )
    (run,) = found.campaign.runs
    assert run.drive is not None
    np.testing.assert_allclose(run.record.yaw_rad, late.values, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(run.drive.values, torque[70:], rtol=0.0, atol=1e-7)


def test_volts_need_a_calibration_and_unknown_units_are_asked_for(tmp_path: Path) -> None:
    volts = Lvm("One", [((Column("Pitch", 3.0 * ANGLE, "Volts"),), "10:11:12.25")])
    path = written(tmp_path, "log.lvm", volts.content())
    with pytest.raises(TunnelError, match="'Pitch' is in V; give --calibration"):
        read_records([path])
    (run,) = read_records([path], ImportChoices(calibration="V/3")).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, ANGLE, rtol=0.0, atol=1e-8)
    odd = Lvm("One", [((Column("Pitch", ANGLE, "furlong"),), "10:11:12.25")])
    with pytest.raises(TunnelError, match="is in 'furlong', which is not a known unit of an angle"):
        read_records([written(tmp_path, "odd.lvm", odd.content())])


@pytest.mark.parametrize("cut", [200, 300, 400, 3000])
def test_part_of_a_file_is_read_or_refused_in_one_line(cut: int, tmp_path: Path) -> None:
    content = Lvm("One", [((degrees(),), "10:11:12.25")]).content()[:cut]
    with pytest.raises(TunnelError, match=r"^[^\n]+$"):
        read_records([written(tmp_path, "half.lvm", content)])
