"""Conditions as typed. Truth: ``campaign.toml`` as the reader of campaigns reads it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.import_files import decay
from tunnel_lab.bench import conditions
from tunnel_lab.bench.conditions import RIG
from tunnel_lab.bench.workspace import Session
from tunnel_sim.files import import_records
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.between_runs import Repeatability


@pytest.fixture
def session(tmp_path: Path) -> Session:
    for name in ("a", "b"):
        rows = [f"{t:.3f},{y:.6f}" for t, y in zip(*decay(), strict=True)]
        (tmp_path / f"{name}.csv").write_text("time_s,yaw_rad\n" + "\n".join(rows))
    import_records([tmp_path / "a.csv", tmp_path / "b.csv"], tmp_path / "rig")
    return Session(tmp_path, "rig")


def test_what_is_typed_is_in_the_campaign(session: Session) -> None:
    cells = conditions.stated(session)
    assert cells["a"] == {"wind_speed": "0", "spring_stiffness": "", "air_density": "", "release_angle": ""}
    cells["b"] |= {"wind_speed": "12,5", "spring_stiffness": "16.12", "air_density": "1.2"}
    cells[RIG]["frontal_area"] = "0.036"
    assert conditions.save(session, cells) == {}
    found = read_campaign(session.campaign)
    assert (found.runs[0].wind_speed, found.runs[0].spring_stiffness) == (0.0, None)
    assert (found.runs[1].wind_speed, found.runs[1].spring_stiffness) == (12.5, 16.12)
    assert (found.runs[1].air_density, found.rig.frontal_area) == (1.2, 0.036)
    text = (session.campaign / "campaign.toml").read_text("utf-8")
    assert text.startswith("# Original: a.csv, SHA-256")  # comments of the import stay
    assert "# reference_length =" in text
    assert conditions.typed(session)["b"]["wind_speed"] == "12.5"


def test_what_is_stated_of_the_scatter_stays(session: Session) -> None:
    path = session.campaign / "campaign.toml"
    text = path.read_text("utf-8")
    assert "\n# [repeatability]   # optional: wind_speed, spring_stiffness and mechanical_damping" in text
    path.write_text(
        text.replace("[[runs]]", "[repeatability]\nspring_stiffness = 0.0005\n[[runs]]", 1), "utf-8"
    )
    cells = conditions.stated(session)
    cells["b"]["spring_stiffness"] = "16.12"
    assert conditions.save(session, cells) == {}
    found = read_campaign(session.campaign)
    assert found.runs[1].spring_stiffness == 16.12
    assert found.repeatability == Repeatability(spring_stiffness=0.0005)


def test_a_density_is_asked_for_where_it_is_needed(session: Session) -> None:
    cells = conditions.stated(session)
    cells["b"]["wind_speed"] = "12"
    assert conditions.save(session, cells) == {}  # only ωn and ζ are possible
    for row, key in (("b", "spring_stiffness"), (RIG, "reference_length")):
        more = {name: dict(texts) for name, texts in cells.items()}
        more[row][key] = "1.0"
        assert "without air_density" in conditions.save(session, more)["b", "air_density"]


@pytest.mark.parametrize(
    ("row", "key", "text", "said"),
    [
        ("b", "wind_speed", "fast", "'fast' is not a number"),
        ("b", "wind_speed", "-3", "wind_speed"),
        ("b", "air_density", "1204", "looks like"),
        ("b", "spring_stiffness", "0", "spring_stiffness"),
        ("b", "release_angle", "nan", "release_angle"),
        (RIG, "reference_length", "625", "looks like cm or mm"),
    ],
)
def test_what_is_wrong_is_kept_beside_the_campaign_and_named(
    session: Session, row: str, key: str, text: str, said: str
) -> None:
    before = (session.campaign / "campaign.toml").read_bytes()
    cells = conditions.stated(session)
    cells[row][key] = text
    wrong = conditions.save(session, cells)
    assert len(wrong) == 1
    assert said in next(iter(wrong.values()))
    assert (session.campaign / "campaign.toml").read_bytes() == before
    assert conditions.typed(session)[row][key] == text  # as after a crash
    cells[row][key] = ""
    assert conditions.save(session, cells) == {}
    assert not session.draft.exists()


def test_what_looks_implausible_can_be_kept(session: Session) -> None:
    cells = conditions.stated(session)
    cells["a"]["air_density"] = "1000"
    assert ("a", "air_density") in conditions.save(session, cells)
    conditions.judge(session, False)
    assert not conditions.is_judged(session)
    assert conditions.save(session, cells) == {}
    assert read_campaign(session.campaign).runs[0].air_density == 1000.0


def test_a_block_of_a_spreadsheet_is_put_where_the_cursor_is(session: Session) -> None:
    cells = conditions.stated(session)
    columns = ["wind_speed", "spring_stiffness", "air_density", "release_angle"]
    found = conditions.pasted(cells, columns, "a", "spring_stiffness", "16,12\t1.2\r\n44.84\t1.3\r\n9\t9\r\n")
    assert [found[run]["spring_stiffness"] for run in "ab"] == ["16,12", "44.84"]
    assert [found[run]["air_density"] for run in "ab"] == ["1.2", "1.3"]
    assert cells["a"]["air_density"] == ""
    edge = conditions.pasted(cells, columns, "b", "release_angle", "0.3\t5\n1\t2")
    assert edge["b"]["release_angle"] == "0.3"
    assert edge["a"] == cells["a"]
