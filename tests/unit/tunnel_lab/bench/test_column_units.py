"""The columns of dropped files and their units. Truth: the files, written here, and the importer."""

from __future__ import annotations

from math import degrees
from pathlib import Path

import numpy as np
import pytest

from tests.support.import_files import decay
from tunnel_lab.bench import preview
from tunnel_lab.bench.column_units import Column, columns_of
from tunnel_lab.bench.workspace import Session
from tunnel_sim.files.importing.column_numbers import guessed_angle_unit, guessed_time_unit


def session(folder: Path, heads: str, *columns: np.ndarray) -> Session:
    found = Session(folder, "rig")
    found.uploads.mkdir()
    rows = "\n".join(",".join(f"{value:.6f}" for value in row) for row in zip(*columns, strict=True))
    (found.uploads / "log.csv").write_text(f"{heads}\n{rows}\n")
    return found


def by_name(given: Session) -> dict[str, Column]:
    return {column.name: column for column in columns_of(given)}


def test_units_are_stated_or_guessed_as_the_importer_does(tmp_path: Path) -> None:
    time, angle = decay()
    given = session(
        tmp_path, "clock,yaw,wind speed [m/s]", 1e3 * time, angle * 30.0, np.full(time.size, 12.0)
    )
    found = by_name(given)
    assert (found["clock"].unit, found["clock"].role, found["clock"].used) == ("ms", "time", True)
    assert (found["yaw"].unit, found["yaw"].role, found["yaw"].used) == ("deg", "angle", True)
    assert "guessed from a swing of ±" in found["yaw"].source
    wind = found["wind speed"]
    assert (wind.unit, wind.role, wind.units) == ("m/s", "condition", [])
    said = " ".join(part for raw in preview.read(given)[0].parts for part in raw.raw.remarks)
    assert "are taken as ms" in said
    assert "is taken as deg" in said


def test_a_unit_that_is_corrected_is_the_one_that_is_read(tmp_path: Path) -> None:
    time, angle = decay()
    given = session(tmp_path, "t [s],yaw", time, angle)
    before = preview.read(given)[0].campaign.runs[0].record.yaw_rad
    column = by_name(given)["yaw"]
    assert (column.unit, by_name(given)["t"].source) == ("rad", "stated in the file")
    preview.state(given, column.stating("mrad"))
    after = preview.read(given)[0].campaign.runs[0].record.yaw_rad
    assert after == pytest.approx(before / 1000.0)
    assert (by_name(given)["yaw"].unit, by_name(given)["yaw"].source) == ("mrad", "stated here")
    preview.state(given, by_name(given)["yaw"].stating(None))
    assert by_name(given)["yaw"] == column


def test_a_unit_for_one_of_several_columns_takes_that_one(tmp_path: Path) -> None:
    time, angle = decay()
    other = np.random.default_rng(1).normal(size=time.size)
    given = session(tmp_path, "t,yaw a,yaw b", time, angle * degrees(1.0), other)
    found = by_name(given)
    assert [column.used for column in found.values()] == [True, False, False]
    preview.state(given, found["yaw a"].stating("deg"))
    (run,) = preview.read(given)[0].campaign.runs
    assert run.record.yaw_rad == pytest.approx(angle[: run.record.yaw_rad.size], abs=1e-6)
    assert [column.used for column in columns_of(given)] == [True, True, False]


@pytest.mark.parametrize(
    ("step", "unit"),
    [(0.001, "s"), (0.5, "s"), (1.0, "ms"), (500.0, "ms"), (1000.0, "us"), (5e5, "us"), (1e7, "ns")],
)
def test_times_without_a_unit(step: float, unit: str) -> None:
    assert guessed_time_unit(step * np.arange(20.0)) == (unit, pytest.approx(step))


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)])
@pytest.mark.parametrize("rate", [100.0, 5000.0])
def test_times_since_1970_show_their_unit(unit: str, factor: float, rate: float) -> None:
    stamps = (1716300000.0 + np.arange(200.0) / rate) / factor
    assert guessed_time_unit(stamps)[0] == unit


@pytest.mark.parametrize(("swing", "unit"), [(3.1, "rad"), (3.2, "deg")])
def test_angles_without_a_unit(swing: float, unit: str) -> None:
    assert guessed_angle_unit(np.array([-swing, np.nan, swing])) == (unit, pytest.approx(swing))


def test_a_displacement_is_named_by_its_unit(tmp_path: Path) -> None:
    time, angle = decay()
    found = by_name(session(tmp_path, "time_s,pos_mm", time, 40.0 * angle))
    assert (found["pos_mm"].unit, found["pos_mm"].source) == ("mm", "stated in the file")
    assert {"deg", "mm", "m/s2", "g"} <= set(found["pos_mm"].units)
