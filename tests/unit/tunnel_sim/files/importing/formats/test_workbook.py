"""Sheets of conditions and cover sheets of a workbook. Truth: the cells that were written."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xlsxwriter

from tests.support.import_files import decay
from tunnel_sim.files.importing.conditions import Unstated
from tunnel_sim.files.importing.records import Imported, read_records
from tunnel_sim.vocabulary.errors import TunnelError

TIME, ANGLE = decay()
Rows = Sequence[Sequence[Any]]


def book(folder: Path, sheets: dict[str, Rows | None]) -> Path:
    """A workbook whose sheets hold the given rows; None: a record."""
    path = folder / "rig.xlsx"
    record = [("t [s]", "yaw [rad]"), *zip(TIME, ANGLE, strict=True)]
    with xlsxwriter.Workbook(path) as made:
        for name, rows in sheets.items():
            sheet = made.add_worksheet(name)
            for i, row in enumerate(record if rows is None else rows):
                sheet.write_row(i, 0, row)
    return path


def conditions(found: Imported) -> list[tuple[str, float, float | None, float | None]]:
    return [(r.id, r.wind_speed, r.spring_stiffness, r.air_density) for r in found.campaign.runs]


EXPECTED = [
    ("Lauf A", 0.0, 16.12, None),
    ("Lauf B", pytest.approx(15.0), 44.84, 1.196),
]


@pytest.mark.parametrize("naming", ["Blatt", "Sheet", "Run", "Lauf", "Was auch immer"])
@pytest.mark.parametrize("first", [True, False])
def test_a_sheet_states_the_conditions_of_others(tmp_path: Path, naming: str, first: bool) -> None:
    table = [
        (naming, "V [km/h]", "Federsteifigkeit", "Luftdichte [kg/m3]", "Bemerkung"),
        ("Lauf A", 0, 16.12, "", "ruhig"),
        ("lauf b", 54, 44.84, 1.196, ""),
    ]
    sheets: dict[str, Rows | None] = {"Lauf A": None, "Lauf B": None}
    sheets = {"Bedingungen": table, **sheets} if first else {**sheets, "Bedingungen": table}
    assert conditions(read_records([book(tmp_path, sheets)])) == EXPECTED


def test_a_title_above_and_texts_with_commas_and_units(tmp_path: Path) -> None:
    table = [
        ("Bedingungen der Messung", "", "", ""),
        ("", "", "", ""),
        ("Bemerkung", "Wind speed", "Kr", "rho", "Blatt"),
        ("a", "0", "16,12", "", "Lauf A"),
        ("b", "54 km/h", "44,84", "1,196", "Lauf B"),
    ]
    path = book(tmp_path, {"Bedingungen": table, "Lauf A": None, "Lauf B": None})
    assert conditions(read_records([path])) == EXPECTED


def test_a_sheet_states_the_conditions_of_runs_within_another(tmp_path: Path) -> None:
    rows: list[Sequence[Any]] = [("run", "t [s]", "yaw [rad]")]
    for name in ("a", "b"):
        rows += [(name, t, y) for t, y in zip(TIME, ANGLE, strict=True)]
    table = [("Run", "V [m/s]", "rho"), ("a", 0, ""), ("b", 15, 1.2)]
    found = read_records([book(tmp_path, {"Daten": rows, "Bedingungen": table})])
    assert [(r.wind_speed, r.air_density) for r in found.campaign.runs] == [(0.0, None), (15.0, 1.2)]


@pytest.mark.parametrize(
    "cover",
    [
        [
            ("Prüfstand 7",),
            ("Luftdichte [kg/m3]", 1.196),
            ("Windgeschwindigkeit", 54, "km/h"),
            ("Kr:", 44.84),
        ],
        [("Luftdichte [kg/m3]", "V [km/h]", "Kr"), (1.196, 54, 44.84)],
        [("rho = 1,196 kg/m3",), ("Wind speed: 15 m/s",), ("Kr = 44.84",)],
        [
            ("Modell", "Davis", ""),
            ("Luftdichte", 1.196, "kg/m3"),
            ("V", 54, "km/h"),
            ("Kr", 44.84, "N m/rad"),
            *((f"Nr. {i}", i, "x") for i in range(8)),
        ],
    ],
)
def test_a_cover_sheet_speaks_of_all_runs(tmp_path: Path, cover: Rows) -> None:
    found = read_records([book(tmp_path, {"Deckblatt": cover, "A": None, "B": None})])
    assert conditions(found) == [(name, pytest.approx(15.0), 44.84, 1.196) for name in ("A", "B")]
    np.testing.assert_allclose(found.campaign.runs[0].record.yaw_rad, ANGLE, atol=1e-12)
    assert not any("holds text" in remark for remark in found.remarks())


def test_a_run_that_a_plan_names_begins_where_the_body_is_released(tmp_path: Path) -> None:
    held = np.concatenate([np.linspace(0.0, ANGLE[0], 100), np.full(200, ANGLE[0]), ANGLE])
    rows = [("t [s]", "yaw [rad]"), *zip(np.arange(held.size) / 200.0, held, strict=True)]
    plan = [("Run", "Sheet", "Kr"), (7, "A", 16.12), (8, "B", 44.84)]
    found = read_records([book(tmp_path, {"Plan": plan, "A": rows, "B": None})])
    assert [run.id for run in found.campaign.runs] == ["7", "8"]
    (first, second) = (part.piece.first for part in found.parts)
    assert abs(first - 300) <= 3
    assert second == 0
    np.testing.assert_allclose(found.campaign.runs[1].record.yaw_rad, ANGLE, atol=1e-12)


def test_a_second_release_in_a_run_that_a_plan_names_is_said(tmp_path: Path) -> None:
    twice = np.concatenate([ANGLE, np.linspace(ANGLE[-1], ANGLE[0], 100), np.full(100, ANGLE[0]), ANGLE])
    rows = [("t [s]", "yaw [rad]"), *zip(np.arange(twice.size) / 200.0, twice, strict=True)]
    plan = [("Run", "Sheet", "Kr"), (7, "A", 16.12), (8, "B", 44.84)]
    found = read_records([book(tmp_path, {"Plan": plan, "A": rows, "B": None})])
    assert [run.id for run in found.campaign.runs] == ["7", "8"]
    (said,) = (line for line in found.summary()[1] if "second release" in line)
    time = float(said.partition("--end 7=")[2].split()[0])
    assert said.startswith("7: ")
    assert abs(time - (ANGLE.size + 200) / 200.0) < 0.05


def test_sheets_of_one_layout_are_one_remark(tmp_path: Path) -> None:
    found = read_records([book(tmp_path, dict.fromkeys("ABCDE"))])
    (line,) = (line for line in found.remarks() if "workbook" in line)
    assert "workbook: sheets 'A', 'B', 'C' and 2 more, 2 columns, numbers from row 2" in line


def test_a_row_comes_before_the_cover(tmp_path: Path) -> None:
    cover = [("Luftdichte", 1.25), ("Kr", 16.12), ("V [m/s]", 8)]
    table = [("Blatt", "V [m/s]"), ("A", 12)]
    found = read_records([book(tmp_path, {"Deckblatt": cover, "Runs": table, "A": None, "B": None})])
    assert conditions(found) == [("A", 12.0, 16.12, 1.25), ("B", 8.0, 16.12, 1.25)]


def test_a_sheet_of_conditions_that_names_no_sheet_is_said(tmp_path: Path) -> None:
    table = [("Datei", "V [m/s]", "Kr"), ("x1", 0, 16.12), ("x2", 12, 16.12)]
    with pytest.raises(Unstated, match=r"'V' of 2 values in 'Bedingungen'.*--conditions RUNS.csv"):
        read_records([book(tmp_path, {"A": None, "B": None, "Bedingungen": table})])


def test_a_sheet_that_no_row_names_is_not_taken_for_wind_off(tmp_path: Path) -> None:
    table = [("Blatt", "V [m/s]", "rho"), ("A", 12, 1.2)]
    with pytest.raises(Unstated, match="run 'B': 'V' of 1 value in 'Bedingungen'"):
        read_records([book(tmp_path, {"A": None, "B": None, "Bedingungen": table})])


def test_what_the_sheets_leave_open_is_asked_for_at_once(tmp_path: Path) -> None:
    counts = [("t [s]", "enc [counts]"), *zip(TIME, np.round(1e4 * ANGLE), strict=True)]
    two = [("t [s]", "yaw [rad]", "pitch [rad]"), *zip(TIME, ANGLE, 0.9 * ANGLE, strict=True)]
    with pytest.raises(TunnelError) as caught:
        read_records([book(tmp_path, {"A": counts, "B": two, "C": counts, "D": None})])
    assert caught.value.options == ("--counts-per-turn N", '--angle "yaw"')
    said = str(caught.value)
    assert f"{tmp_path / 'rig.xlsx'}, A, {tmp_path / 'rig.xlsx'}, C: 'enc' is in counts; give" in said
    assert "rig.xlsx, B: 2 columns may be the angle: 'yaw', 'pitch'; give" in said


@pytest.mark.parametrize(
    ("below", "match"),
    [
        ([("t [s]", "yaw [deg]"), *zip(TIME, ANGLE, strict=True)], "'yaw' has another heading below"),
        (
            [("V = 10 m/s",), *zip(TIME, ANGLE, strict=True)],
            "'V' is left out: the file states several numbers",
        ),
    ],
)
def test_texts_below_a_record_belong_to_the_next_one(below: Rows, match: str, tmp_path: Path) -> None:
    above = [("V = 0 m/s",), ("t [s]", "yaw [rad]"), *zip(TIME, ANGLE, strict=True), ()]
    with pytest.raises(TunnelError, match=match):
        read_records([book(tmp_path, {"A": [*above, *below]})])


def test_a_table_of_peaks_below_a_record_is_no_part_of_it(tmp_path: Path) -> None:
    peaks = [(k, 0.35 * 0.9**k) for k in range(1, 13)]
    rows = [("t [s]", "yaw [rad]"), *zip(TIME, ANGLE, strict=True), (), ("Peak", "Amplitude"), *peaks]
    (run,) = read_records([book(tmp_path, {"A": rows})]).campaign.runs
    np.testing.assert_allclose(run.record.time_s, TIME, atol=1e-9)
    np.testing.assert_allclose(run.record.yaw_rad, ANGLE, atol=1e-9)
