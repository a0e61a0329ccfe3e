"""Dropped files and what is stated about them. Truth: the files, and the importer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.import_files import decay
from tunnel_lab.bench import column_units, conditions, preview
from tunnel_lab.bench.parts import page_words
from tunnel_lab.bench.records import write
from tunnel_lab.bench.workspace import Session
from tunnel_lab.report.import_table import parts_table
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.importing.choices import ImportChoices, read_recipe
from tunnel_sim.files.importing.import_statements import ImportStatements
from tunnel_sim.files.importing.imported_run import imported_run
from tunnel_sim.files.importing.records import read_records
from tunnel_sim.vocabulary.errors import TunnelError


@pytest.fixture
def session(tmp_path: Path) -> Session:
    """A record that is held for a second, and then released."""
    _, angle = decay()
    angle = np.concatenate([np.full(200, angle[0]), angle])
    rows = [f"{0.005 * i:.3f},{y:.6f}" for i, y in enumerate(angle)]
    found = Session(tmp_path, "rig")
    found.uploads.mkdir()
    (found.uploads / "log.csv").write_text("time_s,yaw_rad\n" + "\n".join(rows))
    return found


def test_a_moved_mark_is_where_the_run_begins_also_for_the_command(session: Session) -> None:
    (record,) = preview.drawn(preview.read(session)[0])
    (mark,) = record.marks
    assert mark.start == pytest.approx(1.0, abs=0.05)
    assert mark.rest == pytest.approx(0.0, abs=0.02)
    preview.move(session, mark, {"start": 2.0021})
    preview.move(session, preview.drawn(preview.read(session)[0])[0].marks[0], {"end": 7.5})
    (moved,) = preview.drawn(preview.read(session)[0])[0].marks
    assert (moved.start, moved.end) == (pytest.approx(2.0), pytest.approx(7.5))
    again = read_records(
        [session.uploads / "log.csv"], read_recipe(session.choices)
    )  # tunnel import --recipe
    time = again.campaign.runs[0].record.time_s
    assert (time.size, time[-1] - time[0]) == (1101, pytest.approx(5.5))
    other = session.folder / "other.csv"
    other.write_bytes((session.uploads / "log.csv").read_bytes())
    elsewhere = read_records([other], read_recipe(session.choices)).parts[0]
    assert elsewhere.piece.first == pytest.approx(200, abs=10)  # the mark is of another file


def test_a_mark_behind_its_end_is_refused_and_nothing_changes(session: Session) -> None:
    mark = preview.drawn(preview.read(session)[0])[0].marks[0]
    with pytest.raises(TunnelError, match=r"run '.*': the end .* is not after the release"):
        preview.move(session, mark, {"start": mark.end + 1.0})
    assert not session.choices.exists()
    preview.move(session, mark, {"start": 100.0, "end": 120.0})
    with pytest.raises(TunnelError, match="no samples from 100 to 120 s"):
        preview.read(session)


def test_a_moved_rest_is_subtracted_also_by_the_command_and_can_be_taken_back(session: Session) -> None:
    before = preview.read(session)[0]
    (mark,) = preview.drawn(before)[0].marks
    assert mark.about.endswith("rad, found")
    preview.move(session, mark, {"rest": 0.012})
    (moved,) = preview.drawn(preview.read(session)[0])[0].marks
    assert (moved.rest, moved.start, moved.end) == (0.012, mark.start, mark.end)
    assert moved.about == "0.01200 rad, stated and subtracted"
    (run,) = read_records([session.uploads / "log.csv"], read_recipe(session.choices)).campaign.runs
    np.testing.assert_array_equal(run.record.yaw_rad, before.campaign.runs[0].record.yaw_rad - 0.012)
    preview.move(session, mark, {"rest": None})
    assert preview.drawn(preview.read(session)[0])[0].marks[0].rest == mark.rest
    preview.move(session, mark, {"rest": 3.0})
    with pytest.raises(TunnelError, match="do not include the stated rest of 3 rad"):
        preview.read(session)


def test_an_added_release_splits_a_run_also_for_the_command_and_can_be_removed(session: Session) -> None:
    (record,) = preview.drawn(preview.read(session)[0])
    (found,) = record.marks
    assert preview.add(session, record, 5.0) == "log-added-1"
    first, added = preview.drawn(preview.read(session)[0])[0].marks
    assert (first.run, first.start, added.start) == ("log", found.start, pytest.approx(5.0))
    assert (first.end, added.end) == (pytest.approx(4.995), found.end)
    assert (first.added, added.added) == (False, True)
    preview.move(session, added, {"start": 6.0})
    again = read_records([session.uploads / "log.csv"], read_recipe(session.choices))
    assert [run.id for run in again.campaign.runs] == ["log", "log-added-1"]
    sizes = [run.record.time_s.size for run in again.campaign.runs]
    assert sum(sizes) == 1800 - again.parts[0].piece.first
    assert sizes[1] == 600
    preview.remove(session, preview.drawn(again)[0].marks[1])
    (left,) = preview.drawn(preview.read(session)[0])[0].marks
    assert (left.run, left.start, left.end) == (found.run, found.start, found.end)


def test_a_found_run_is_left_out_and_used_again(session: Session) -> None:
    (record,) = preview.drawn(preview.read(session)[0])
    preview.add(session, record, 5.0)
    first = preview.drawn(preview.read(session)[0])[0].marks[0]
    preview.remove(session, first)
    left = preview.drawn(preview.read(session)[0])[0].marks[0]
    assert left.is_left_out
    assert left.doubts == ()
    preview.restore(session, left)
    assert not preview.drawn(preview.read(session)[0])[0].marks[0].is_left_out


def test_records_with_a_run_to_judge_come_first_and_keep_their_places(session: Session) -> None:
    time, angle = decay(duration=16.0)
    angle = np.clip(angle, -0.2, 0.2)
    rows = [f"{t:.3f},{y:.6f}" for t, y in zip(time, angle, strict=True)]
    (session.uploads / "odd.csv").write_text("time_s,yaw_rad\n" + "\n".join(rows))
    records = preview.drawn(preview.read(session)[0])
    assert [record.title for record in records] == ["odd", "log"]
    assert "peaks are cut off at 0.2 and -0.2 rad" in records[0].marks[0].doubts[0]
    assert records[1].marks[0].doubts == ()
    preview.move(session, records[0].marks[0], {"start": 8.0})
    imported = preview.read(session)[0]
    assert [one.title for one in preview.drawn(imported)] == ["log", "odd"]
    assert [one.title for one in preview.drawn(imported, [one.key for one in records])] == ["odd", "log"]


def test_a_fault_asks_for_its_own_fields(session: Session) -> None:
    log = session.uploads / "log.csv"
    log.write_text(log.read_text().replace("yaw_rad", "pot_V"))
    with pytest.raises(TunnelError) as caught:
        preview.read(session)
    assert preview.choices_to_show(session, str(caught.value)) == ["calibration"]
    preview.state(session, {"calibration": "1*V"})
    assert preview.choices_to_show(session, "") == ["calibration"]  # what is stated can be corrected
    preview.state(session, preview.settings_from("wind_speed=0.0360000000000001"))
    assert preview.settings_of(preview.choices_of(session)) == "wind_speed=0.0360000000000001"
    assert preview.choices_to_show(session, "") == ["calibration", "conditions"]


def test_choices_are_a_recipe_and_can_be_taken_back(session: Session) -> None:
    preview.state(session, {"unit": "deg", "angle": ["yaw_rad"]})
    assert preview.choices_of(session).unit == "deg"
    with pytest.raises(TunnelError, match="rate"):
        preview.state(session, {"rate": -1.0})
    preview.state(session, {"unit": None, "angle": ()})
    assert preview.choices_of(session).unit is None
    assert column_units.column_names(session) == ["time", "yaw"]


def test_a_campaign_written_again_keeps_its_conditions(session: Session) -> None:
    write(session, preview.read(session)[0])
    cells = conditions.stated(session)
    (run,) = (row for row in cells if row)
    cells[run]["spring_stiffness"] = "16.12"
    conditions.save(session, cells)
    preview.move(session, preview.drawn(preview.read(session)[0])[0].marks[0], {"start": 3.0})
    write(session, preview.read(session)[0])
    found = read_campaign(session.campaign).runs[0]
    assert found.spring_stiffness == 16.12
    assert found.record.time_s.size == 1200


def test_a_bad_file_does_not_block_a_good_one(session: Session) -> None:
    (session.uploads / "notes.csv").write_text("nothing but words\n" * 40)
    imported, faults = preview.read(session)
    assert [part.raw.source.name for part in imported.parts] == ["log.csv"]
    assert len(faults) == 1
    assert "notes.csv" in str(faults[0])
    (session.uploads / "log.csv").unlink()
    with pytest.raises(TunnelError, match=r"notes\.csv"):
        preview.read(session)
    assert column_units.raw_columns(session) == []


def test_the_raw_columns_are_those_of_the_file(session: Session) -> None:
    (name, unit, rows, values), (second, _, _, readings) = column_units.raw_columns(session)
    assert (name, unit, second) == ("time", "s", "yaw")
    assert len(rows) == len(values) == len(readings)
    assert values == sorted(values)


def test_the_rest_follows_a_flat_end(session: Session) -> None:
    time = np.arange(3000) / 100.0
    held = 0.734 + np.where(time < 12.0, 0.3 * np.exp(-0.2 * time) * np.cos(9.0 * time) - 0.02, 0.0)
    rows = "\n".join(f"{t:.2f},{y:.5f}" for t, y in zip(time, held, strict=True))
    (session.uploads / "log.csv").write_text(f"time_s,yaw_rad\n{rows}\n")
    (mark,) = preview.drawn(preview.read(session)[0])[0].marks
    assert mark.rest == pytest.approx(0.734, abs=1e-6)
    assert "found at the end" in mark.about


def test_a_page_speaks_of_fields_and_not_of_options() -> None:
    for line, words in (
        (
            "tunnel: log.csv: two columns; give --angle NAME",
            "log.csv: two columns; give “Column of the angle”",
        ),
        ("'pot' is in V; give --calibration \"a + b*V\"", "'pot' is in V; give “Angle of a voltage” a + b*V"),
        ('--name "*_V{wind_speed}" uses it', "“Conditions in the file names” *_V{wind_speed} uses it"),
        ("give --unit deg if it does", "give “Unit of the angle” deg if it does"),
        ("or keep it whole with --no-cut", "or keep it whole by switching off “Cut records at releases”"),
        ("diagnose again with --effects-file", "diagnose again with --effects-file"),
    ):
        assert page_words(line) == words


def test_a_second_release_in_a_run_that_a_file_names_is_to_be_judged(session: Session) -> None:
    imported = preview.read(session)[0]
    (part,) = imported.parts
    piece = replace(part.piece, again=1000)
    beside = ImportStatements.of([part.raw.source], ImportChoices(), None, several=False, later=True)
    named = imported_run("log", part.raw, piece, beside)
    (said,) = preview.doubts_of(named)
    assert said == "a second release at 5 s, though the file names one run"
    assert f"{said}; --end log=5 ends it there" in named.remarks  # the import's sentence, with its option


def test_the_table_has_the_spring_of_a_run_that_still_needs_an_air_density(session: Session) -> None:
    log = session.uploads / "log.csv"
    log.write_text("wind speed [m/s],10\nspring stiffness [N m/rad],16.25\n\n" + log.read_text())
    (row,) = parts_table(preview.read(session)[0]).rows
    assert row[-2:] == ("10", "16.25")
