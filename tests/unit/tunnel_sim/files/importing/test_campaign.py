"""From files to a campaign on disk: conditions, recipe, originals, and what is left when something is wrong.

Truth: the numbers that the files were made from.
"""

from __future__ import annotations

import hashlib
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.support.import_files import csv, decay, written
from tunnel_sim import TunnelError, read_campaign
from tunnel_sim.files.importing.choices import ImportChoices, Stretch, parse_setting, read_recipe
from tunnel_sim.files.importing.column_numbers import read_calibration
from tunnel_sim.files.importing.condition_names import Conditions
from tunnel_sim.files.importing.records import read_records
from tunnel_sim.files.importing.writing import import_records

WIND = Conditions(wind_speed=12.0, spring_stiffness=16.0, air_density=1.2, frontal_area=0.036)


def test_the_campaign_reads_back_as_imported(tmp_path: Path) -> None:
    path = csv(tmp_path)
    imported = import_records([path], tmp_path / "rig", ImportChoices(conditions=WIND))
    campaign = read_campaign(tmp_path / "rig")
    assert campaign.name == "rig"
    (run,) = campaign.runs
    assert (run.id, run.wind_speed, run.spring_stiffness, run.air_density) == ("log", 12.0, 16.0, 1.2)
    assert campaign.rig.frontal_area == 0.036
    np.testing.assert_array_equal(run.record.yaw_rad, imported.campaign.runs[0].record.yaw_rad)
    np.testing.assert_allclose(run.record.yaw_rad, decay()[1], atol=6e-9)


def test_what_is_not_known_is_a_comment_with_its_unit(tmp_path: Path) -> None:
    import_records([csv(tmp_path)], tmp_path / "rig")
    text = (tmp_path / "rig" / "campaign.toml").read_text(encoding="utf-8")
    for key in ("frontal_area", "reference_length", "yaw_inertia", "spring_stiffness", "air_density"):
        assert f"\n# {key} =   # " in text
    filled = text.replace("# spring_stiffness =   #", "spring_stiffness = 16.0 #")
    filled = filled.replace("# frontal_area =   #", "frontal_area = 0.036 #")
    (tmp_path / "rig" / "campaign.toml").write_text(filled, encoding="utf-8")
    campaign = read_campaign(tmp_path / "rig")
    assert campaign.runs[0].spring_stiffness == 16.0
    assert campaign.rig.frontal_area == 0.036


def test_the_originals_are_named_with_their_hash(tmp_path: Path) -> None:
    path = csv(tmp_path)
    imported = import_records([path], tmp_path / "rig")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    assert f"# Original: log.csv, SHA-256 {digest}" in (tmp_path / "rig" / "campaign.toml").read_text("utf-8")
    (original,) = tomllib.loads((tmp_path / "rig" / "import.toml").read_text("utf-8"))["originals"]
    assert (original["file"], original["sha256"]) == ("log.csv", digest)
    assert original["said"] == imported.remarks()


def test_a_recipe_makes_the_next_file_go_the_same_way(tmp_path: Path) -> None:
    time, angle = decay()
    rows = "\n".join(
        f"{1e3 * t:.0f};{1000 + 4096 * y / 2 / np.pi:.3f};{t:.3f}" for t, y in zip(time, angle, strict=True)
    )
    text = "tick;ai0;ai1\n" + rows.replace(".", ",")
    choices = ImportChoices(
        time="tick", time_unit="ms", angle=("ai0",), counts_per_turn=4096.0, conditions=WIND
    )
    first = import_records([written(tmp_path, "one.txt", text)], tmp_path / "one", choices)
    kept = read_recipe(tmp_path / "one")
    assert (kept.delimiter, kept.decimal, kept.counts_per_turn) == (";", ",", 4096.0)
    second = import_records([written(tmp_path, "two.txt", text)], tmp_path / "two", kept)
    assert second.campaign.runs[0].record.yaw_rad.tobytes() == first.campaign.runs[0].record.yaw_rad.tobytes()
    assert second.campaign.runs[0].wind_speed == 12.0
    zero = angle + 2.0 * np.pi * 1000.0 / 4096.0
    np.testing.assert_allclose(first.campaign.runs[0].record.yaw_rad, zero, atol=1e-6)


def test_a_stated_rest_is_subtracted_and_kept_in_the_recipe(tmp_path: Path) -> None:
    path = csv(tmp_path)
    imported = import_records([path], tmp_path / "rig", ImportChoices(rest=0.1))
    assert imported.campaign.sensor.zero is None
    assert any("0.1 rad, is subtracted" in line for line in imported.remarks())
    again = import_records([path], tmp_path / "again", read_recipe(tmp_path / "rig"))
    for run in (*again.campaign.runs, *read_campaign(tmp_path / "rig").runs):
        np.testing.assert_allclose(run.record.yaw_rad, decay()[1] - 0.1, atol=6e-9)


def test_a_rest_of_one_run_leaves_the_others_and_gives_every_run_its_own_zero(tmp_path: Path) -> None:
    paths = [csv(tmp_path, f"{name}.csv") for name in "ab"]
    (tmp_path / "recipe.toml").write_text(
        'schema_version = 1\n[[choices.stretches]]\nfile = "b.csv"\nrun = "b"\nrest = -0.02\n'
    )
    imported = import_records(paths, tmp_path / "rig", read_recipe(tmp_path / "recipe.toml"))
    assert [part.rest for part in imported.parts] == [None, -0.02]
    assert any("a separate zero" in line for line in imported.remarks())
    campaign = read_campaign(tmp_path / "rig")
    assert campaign.sensor.zero == "per_run"
    for run, rest in zip(campaign.runs, (0.0, -0.02), strict=True):
        np.testing.assert_allclose(run.record.yaw_rad, decay()[1] - rest, atol=6e-9)
        assert run.record.time_s.size == decay()[0].size  # start and end are as found


def test_a_file_whose_name_no_recipe_can_hold_is_read(tmp_path: Path) -> None:
    (part,) = read_records([csv(tmp_path, "two\nlines.csv")]).parts
    assert part.rest is None


def test_a_rest_between_two_levels_leaves_the_resolution(tmp_path: Path) -> None:
    rows = "".join(f"{t:.3f},{round(y, 2):.2f}\n" for t, y in zip(*decay(), strict=True))
    paths = [written(tmp_path, f"{name}.csv", f"time_s,yaw_rad\n{rows}") for name in "ab"]
    stretch = Stretch(file="b.csv", run="b", rest=0.005)
    campaign = read_records(paths, ImportChoices(stretches=(stretch,))).campaign
    assert campaign.sensor.resolution == pytest.approx(0.01)


def test_conditions_from_a_table(tmp_path: Path) -> None:
    files = [csv(tmp_path, name, seed) for seed, name in enumerate(("a.csv", "b.csv"))]
    table = written(
        tmp_path,
        "runs.csv",
        "file;wind_speed;spring_stiffness;air_density;who\na.csv;0;5,5;;me\nb;12,5;5,5;1,2;me\n",
    )
    imported = read_records(files, conditions=table)
    conditions = [(r.wind_speed, r.spring_stiffness, r.air_density) for r in imported.campaign.runs]
    assert conditions == [(0.0, 5.5, None), (12.5, 5.5, 1.2)]
    assert any("not conditions: who" in line for line in imported.remarks())


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("name,wind_speed\na,1\n", "no column file or run"),
        ("file,colour\na.csv,1\n", "no column of conditions"),
        ("file,wind_speed\nb.csv,1\n", "no row for run 'a' of a.csv"),
        ("file,wind_speed\na.csv,fast\n", "wind_speed = 'fast' is not a number"),
        ("file,wind_speed\na.csv,1\na.csv,2\n", "'a.csv' occurs twice"),
        ("file,wind_speed\na.csv,-1\n", "greater than or equal to 0"),
        ("file,wind_speed\na.csv\n", "1 cell in line 2, but 2 names"),
    ],
)
def test_a_bad_table_of_conditions(tmp_path: Path, text: str, what: str) -> None:
    with pytest.raises(TunnelError) as caught:
        read_records([csv(tmp_path, "a.csv")], conditions=written(tmp_path, "runs.csv", text))
    assert what in caught.value.what
    assert "runs.csv" in caught.value.where


def test_conditions_from_file_names(tmp_path: Path) -> None:
    files = [csv(tmp_path, name) for name in ("S16.12_V0_a.csv", "S5p5_V12.5_b.csv")]
    choices = ImportChoices(name="S{spring}_V{wind_speed}_*", conditions=Conditions(air_density=1.2))
    runs = read_records(files, choices).campaign.runs
    assert [(run.spring_stiffness, run.wind_speed) for run in runs] == [(16.12, 0.0), (5.5, 12.5)]
    with pytest.raises(TunnelError, match="the name does not match"):
        read_records([csv(tmp_path)], choices)
    with pytest.raises(TunnelError, match=r"'\{sprig\}' is not a condition.*did you mean 'spring'"):
        read_records(files, ImportChoices(name="S{sprig}_*"))


def test_the_wind_is_not_guessed(tmp_path: Path) -> None:
    with pytest.raises(TunnelError, match=r"name states that the wind is on.*--set wind_speed"):
        read_records([csv(tmp_path, "wind_on_1.csv")])
    for given in ({"spring_stiffness": 16.0}, {"reference_length": 0.6}):
        with pytest.raises(TunnelError, match=r"wind-on \(12 m/s\) without air_density.*--set air_density"):
            read_records([csv(tmp_path)], ImportChoices(conditions=Conditions(wind_speed=12.0, **given)))
    found = read_records([csv(tmp_path)], ImportChoices(conditions=Conditions(wind_speed=12.0)))
    assert found.campaign.runs[0].air_density is None  # only ωn and ζ are possible


def test_only_a_driven_run_may_be_stated_to_have_no_spring(tmp_path: Path) -> None:
    choices = ImportChoices(conditions=Conditions(spring_stiffness=0.0))
    with pytest.raises(TunnelError, match="only a driven run may have no spring"):
        read_records([csv(tmp_path)], choices)
    time, yaw = decay()
    moment = np.sin(3.0 * time) + 0.5 * np.sin(7.0 * time)
    lines = "\n".join(f"{t},{y},{m}" for t, y, m in zip(time, yaw, moment, strict=True))
    driven = written(tmp_path, "driven.csv", f"time_s,yaw_rad,moment_nm\n{lines}\n")
    (run,) = read_records([driven], choices).campaign.runs
    assert run.unrestrained


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0.1 + 20*V", (0.1, 20.0)), ("20 V", (0.0, 20.0)), ("-2*V - 0.5", (-0.5, -2.0)), ("V", (0.0, 1.0)),
        ("12*(V-2.5)", (-30.0, 12.0)), ("(V - 2.5) * 12", (-30.0, 12.0)), ("1 - 4*(2.5 - V)", (-9.0, 4.0)),
        ("(V-2)/0.5", (-4.0, 2.0)), ("-V", (0.0, -1.0)), ("V/4 + 1", (1.0, 0.25)), ("-(V - 1)", (1.0, -1.0)),
    ],
)  # fmt: skip
def test_a_calibration_formula(text: str, expected: tuple[float, float]) -> None:
    assert read_calibration(text) == expected


def test_a_voltage_is_converted_by_formula_or_table(tmp_path: Path) -> None:
    time, angle = decay()
    rows = "".join(f"{t:.3f},{2.5 + y / 0.5:.9f}\n" for t, y in zip(time, angle, strict=True))
    path = written(tmp_path, "pot.csv", "time (s),pot (V)\n" + rows)
    table = written(
        tmp_path,
        "cal.csv",
        "V,angle (deg)\n" + "".join(f"{v},{np.rad2deg(0.5 * (v - 2.5))}\n" for v in range(5)),
    )
    for calibration in ("-1.25 + 0.5*V", str(table)):
        imported = read_records([path], ImportChoices(calibration=calibration))
        (run,) = imported.campaign.runs
        np.testing.assert_allclose(run.record.yaw_rad, angle, atol=1e-9)
        assert any(
            "the calibration of 'pot' states no unit of the angle" in line for line in imported.remarks()
        )
    for text in ("2*V**2", "12*(V-2.5", "1 + V + 2", "V/0", "12*(V*V)", "a + b*V", "1.5"):
        with pytest.raises(TunnelError, match="is not a formula"):
            read_records([path], ImportChoices(calibration=text))


def test_settings_are_checked() -> None:
    assert parse_setting("wind_speed=12.5, width=0.2", "--set")[0].width == 0.2
    for text, what in (
        ("wind_speed", "not of the form"),
        ("wind=1", "unknown key 'wind'"),
        ("width=-1", "greater than 0"),
    ):
        with pytest.raises(TunnelError, match=what):
            parse_setting(text, "--set")


def test_nothing_is_left_where_something_is_wrong(tmp_path: Path) -> None:
    good, bad = csv(tmp_path), written(tmp_path, "bad.csv", "time_s,yaw_rad\n0,1\n1,nothing\n")
    with pytest.raises(TunnelError, match=r"bad\.csv"):
        import_records([good, bad], tmp_path / "rig")
    assert not (tmp_path / "rig").exists()
    import_records([good], tmp_path / "rig")
    before = {path: path.read_bytes() for path in (tmp_path / "rig").rglob("*") if path.is_file()}
    with pytest.raises(TunnelError, match="the folder exists"):
        import_records([good], tmp_path / "rig")

    def broken(_: object) -> bytes:
        raise TunnelError("no picture")

    with pytest.raises(TunnelError, match="no picture"):
        import_records([good], tmp_path / "rig", overwrite=True, picture=broken)
    assert {path: path.read_bytes() for path in (tmp_path / "rig").rglob("*") if path.is_file()} == before
    import_records([good], tmp_path / "rig", overwrite=True)


def test_a_run_that_is_too_short_is_left_out_and_said(tmp_path: Path) -> None:
    time, angle = decay()
    short = "".join(f"{t:.3f},{y:.8f}\n" for t, y in zip(time[:150], angle[:150], strict=True))
    imported = read_records([csv(tmp_path), written(tmp_path, "short.csv", "time_s,yaw_rad\n" + short)])
    assert [run.id for run in imported.campaign.runs] == ["log"]
    assert any("short: left out: about" in line for line in imported.remarks())
    with pytest.raises(TunnelError, match="no run can be used"):
        read_records([tmp_path / "short.csv"])
