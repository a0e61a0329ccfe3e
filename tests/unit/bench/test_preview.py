"""Dropped files and what is stated about them. Truth: the files, and the importer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.unit.importing.import_files import decay
from tunnel_lab.bench import conditions, preview
from tunnel_lab.bench.records import write
from tunnel_lab.bench.workspace import Session
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.importing.conditions import read_recipe
from tunnel_sim.files.importing.records import read_records
from tunnel_sim.vocabulary.errors import TunnelError

pytest.importorskip("nicegui")


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
    (record,) = preview.drawn(preview.read(session))
    (mark,) = record.marks
    assert mark.start == pytest.approx(1.0, abs=0.05)
    assert mark.rest == pytest.approx(0.0, abs=0.02)
    preview.move(session, mark, {"start": 2.0021})
    preview.move(session, preview.drawn(preview.read(session))[0].marks[0], {"end": 7.5})
    (moved,) = preview.drawn(preview.read(session))[0].marks
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
    mark = preview.drawn(preview.read(session))[0].marks[0]
    with pytest.raises(TunnelError, match=r"run '.*': the end .* is not after the release"):
        preview.move(session, mark, {"start": mark.end + 1.0})
    assert not session.choices.exists()
    preview.move(session, mark, {"start": 100.0, "end": 120.0})
    with pytest.raises(TunnelError, match="no samples from 100 to 120 s"):
        preview.read(session)


def test_a_moved_rest_is_subtracted_also_by_the_command_and_can_be_taken_back(session: Session) -> None:
    before = preview.read(session)
    (mark,) = preview.drawn(before)[0].marks
    assert mark.about.endswith("rad, found")
    preview.move(session, mark, {"rest": 0.012})
    (moved,) = preview.drawn(preview.read(session))[0].marks
    assert (moved.rest, moved.start, moved.end) == (0.012, mark.start, mark.end)
    assert moved.about == "0.01200 rad, stated and subtracted"
    (run,) = read_records([session.uploads / "log.csv"], read_recipe(session.choices)).campaign.runs
    np.testing.assert_array_equal(run.record.yaw_rad, before.campaign.runs[0].record.yaw_rad - 0.012)
    preview.move(session, mark, {"rest": None})
    assert preview.drawn(preview.read(session))[0].marks[0].rest == mark.rest
    preview.move(session, mark, {"rest": 3.0})
    with pytest.raises(TunnelError, match="never passes the stated rest of 3 rad"):
        preview.read(session)


def test_choices_are_a_recipe_and_can_be_taken_back(session: Session) -> None:
    preview.state(session, {"unit": "deg", "angle": ["yaw_rad"]})
    assert preview.choices_of(session).unit == "deg"
    with pytest.raises(TunnelError, match="rate"):
        preview.state(session, {"rate": -1.0})
    preview.state(session, {"unit": None, "angle": ()})
    assert preview.choices_of(session).unit is None
    assert preview.column_names(session) == ["time", "yaw"]


def test_a_campaign_written_again_keeps_its_conditions(session: Session) -> None:
    write(session, preview.read(session))
    cells = conditions.stated(session)
    (run,) = (row for row in cells if row)
    cells[run]["spring_stiffness"] = "16.12"
    conditions.save(session, cells)
    preview.move(session, preview.drawn(preview.read(session))[0].marks[0], {"start": 3.0})
    write(session, preview.read(session))
    found = read_campaign(session.campaign).runs[0]
    assert found.spring_stiffness == 16.12
    assert found.record.time_s.size == 1200
