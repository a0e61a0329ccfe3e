"""What dropped files state and leave open, and the campaign that they become. Truth: the files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.support.import_files import decay
from tunnel_lab.bench import conditions, preview
from tunnel_lab.bench.parts import page_words
from tunnel_lab.bench.records import write
from tunnel_lab.bench.workspace import Session, closed, common_name, rename
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.errors import TunnelError

SPEEDS = (0.0, 8.0, 8.0, 15.0)


def dropped(folder: Path, speeds: tuple[float, ...] = SPEEDS, heading: str = "V [m/s]") -> Session:
    """A file for each speed, which states a stiffness and no density."""
    session = Session(folder, "rig")
    session.uploads.mkdir()
    for number, speed in enumerate(speeds, 1):
        time, angle = decay(number)
        rows = "\n".join(f"{t:.3f},{y:.6f},{speed},16.12" for t, y in zip(time, angle, strict=True))
        (session.uploads / f"run{number}.csv").write_text(f"time_s,yaw_rad,{heading},Kr\n{rows}\n")
    return session


def test_runs_in_wind_are_kept_until_their_density_is_stated(tmp_path: Path) -> None:
    session = dropped(tmp_path)
    imported, faults = preview.read(session)
    assert faults == ()
    write(session, imported)
    runs = read_campaign(session.campaign).runs
    assert [run.wind_speed for run in runs] == list(SPEEDS)
    assert "Correct the conditions" in closed(session, "identify")
    cells = conditions.typed(session)
    assert [cells[run.id]["spring_stiffness"] for run in runs] == ["16.12"] * len(SPEEDS)
    wrong = conditions.faults(cells, plausible=True)
    assert set(wrong) == {(run.id, "air_density") for run in runs if run.wind_speed > 0.0}
    for run in runs:
        cells[run.id]["air_density"] = "1.2"
    assert conditions.save(session, cells) == {}
    assert {run.spring_stiffness for run in read_campaign(session.campaign).runs} == {16.12}
    # Written once more, what was stated stands.
    write(session, preview.read(session)[0])
    again = read_campaign(session.campaign).runs
    assert {(run.spring_stiffness, run.air_density) for run in again} == {(16.12, 1.2)}


def test_sizes_of_the_rig_wait_for_the_density_too(tmp_path: Path) -> None:
    session = dropped(tmp_path, (8.0,))
    path = session.uploads / "run1.csv"
    path.write_text("frontal_area [cm2]: 360\n" + path.read_text())
    write(session, preview.read(session)[0])
    cells = conditions.typed(session)
    assert cells[conditions.RIG]["frontal_area"] == "0.036"
    cells["run1"]["air_density"] = "1.2"
    assert conditions.save(session, cells) == {}
    assert read_campaign(session.campaign).rig.frontal_area == pytest.approx(0.036)


def test_a_speed_that_is_only_hinted_at_is_asked_for_in_all_files(tmp_path: Path) -> None:
    session = dropped(tmp_path, heading="V")
    with pytest.raises(TunnelError, match="'V' is left out") as caught:
        preview.read(session)
    words = page_words(str(caught.value))
    assert "“Conditions of all runs” wind_speed=V uses it" in words
    preview.state(session, preview.settings_from("wind_speed=V"))
    assert preview.settings_of(preview.choices_of(session)) == "wind_speed=V"
    runs = preview.read(session)[0].campaign.runs
    assert [run.wind_speed for run in runs] == list(SPEEDS)
    preview.state(session, preview.settings_from(""))
    with pytest.raises(TunnelError):
        preview.read(session)
    with pytest.raises(TunnelError, match="not of the form"):
        preview.settings_from("wind_speed")


def test_files_and_runs_are_left_out_by_choice_alone(tmp_path: Path) -> None:
    session = dropped(tmp_path, (0.0, 0.0, 0.0))
    (session.uploads / "notes.csv").write_text("who,what\nme,nothing\n")
    imported, faults = preview.read(session)
    assert (len(imported.campaign.runs), len(faults)) == (3, 1)
    preview.leave_out(session, ["notes.csv", "run2"])
    imported, faults = preview.read(session)
    assert faults == ()
    assert [run.id for run in imported.campaign.runs] == ["run1", "run3"]
    fault = next(
        mark.fault for record in preview.drawn(imported) for mark in record.marks if mark.run == "run2"
    )
    assert fault == "left out as stated"
    write(session, imported)
    assert [run.id for run in read_campaign(session.campaign).runs] == ["run1", "run3"]
    preview.leave_out(session, ["run9"])
    with pytest.raises(TunnelError, match=r"no run or file 'run9' to leave out.*did you mean"):
        preview.read(session)


@pytest.mark.parametrize(
    ("files", "name"),
    [
        (["log.csv"], "log"),
        (["rig/a.csv", "rig/b.csv"], "rig"),
        (["rig_01.csv", "rig_02.csv"], "rig"),
        (["S16_V0.csv", "S16_V10.csv"], "S16"),
        (["day-3-V0.csv", "day-3-V12.csv", "day-3-V15.csv"], "day-3"),
        (["a.csv", "b.csv"], "a"),
        (["rig.csv", "rig_2.csv"], "rig"),
        (["Messung1.csv", "Messung12.csv"], "Messung1"),
        (["../a.csv", "../b.csv"], "a"),
    ],
)
def test_a_campaign_has_a_name_that_its_files_share(files: list[str], name: str) -> None:
    assert common_name(files) == name


def test_a_name_can_be_changed_until_the_campaign_is_written(tmp_path: Path) -> None:
    session = dropped(tmp_path, (0.0,))
    preview.state(session, {"unit": "rad"})
    (tmp_path / "other.uploads").mkdir()
    for name, what in (("other", "is taken"), ("a/b", "is not the name"), ("", "is not the name")):
        with pytest.raises(TunnelError, match=what):
            rename(session, name)
    renamed = rename(session, "day-3")
    assert [path.name for path in preview.files_of(renamed)] == ["run1.csv"]
    assert preview.choices_of(renamed).unit == "rad"
    assert not session.uploads.exists()
    imported, _ = preview.read(renamed)
    assert imported.campaign.name == "day-3"
    write(renamed, imported)
    np.testing.assert_array_equal(read_campaign(renamed.campaign).runs[0].wind_speed, 0.0)
    with pytest.raises(TunnelError, match="has been written"):
        rename(renamed, "day-4")
