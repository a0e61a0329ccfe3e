"""Every bad input is refused in one line that names the file, the run and the remedy, and changes nothing."""

import os
from pathlib import Path

import pytest

from tests.skips import USER
from tests.support.spoilt_campaign import (
    GOOD,
    HEAD,
    R1,
    TOML,
    good_campaign,
    in_run,
    refusal,
    swap,
)
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.errors import TunnelError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return good_campaign(tmp_path)


def test_the_campaign_the_others_spoil_is_good(folder: Path) -> None:
    assert [run.id for run in read_campaign(folder).runs] == ["r1", "r2"]


TOML_CASES: dict[str, tuple[str, list[str]]] = {
    "empty file": ("", ["empty"]),
    "blank file": (" \n\n", ["empty"]),
    "malformed": (TOML + "\n[[runs", ["not valid TOML", "correct"]),
    "key twice": (swap('name = "c"', 'name = "c"\nname = "d"'), ["TOML"]),
    "no version": (swap("schema_version = 1\n", ""), ["no schema_version", "schema_version = 1"]),
    "other version": (swap("schema_version = 1", "schema_version = 2"), ["schema_version is 2", "version 1"]),
    "version as text": (swap("schema_version = 1", 'schema_version = "1"'), ["schema_version is '1'"]),
    "version as truth": (swap("schema_version = 1", "schema_version = true"), ["schema_version is True"]),
    "version as float": (swap("schema_version = 1", "schema_version = 1.0"), ["schema_version is 1.0"]),
    "unknown top key": (swap("[rig]", "[rigg]"), ["unknown key 'rigg'", "did you mean 'rig'?"]),
    "unknown rig key": (swap("frontal_area", "frontal_aera"), ["[rig]", "did you mean 'frontal_area'?"]),
    "unknown sensor key": (swap("resolution", "resolutoin"), ["[sensor]", "did you mean 'resolution'?"]),
    "unknown campaign key": (swap("name =", "nmae ="), ["[campaign]", "did you mean 'name'?"]),
    "unknown run key": (
        in_run("spring_stiffness", "spring_stifness"),
        ["run 'r2'", "unknown key 'spring_stifness'", "did you mean 'spring_stiffness'?"],
    ),
    "unknown key like none": (in_run("air_density", "xyz"), ["run 'r2'", "'xyz'", "use one of"]),
    "unknown key of two lines": (in_run("air_density", '"a\\nb"'), ["run 'r2'", "'a b'"]),
    "unknown repeatability key": (
        TOML + "[repeatability]\nwind_sped = 0.01\n",
        ["[repeatability]", "unknown key 'wind_sped'", "did you mean 'wind_speed'?"],
    ),
    "repeatability of one": (
        TOML + "[repeatability]\nwind_speed = 1.0\n",
        ["[repeatability]", "'wind_speed' = 1.0", "relative standard deviation from 0 to below 1"],
    ),
    "repeatability below zero": (TOML + "[repeatability]\nmechanical_damping = -0.1\n", ["[repeatability]"]),
    "repeatability as nan": (TOML + "[repeatability]\nspring_stiffness = nan\n", ["not a finite number"]),
    "repeatability in per cent": (TOML + '[repeatability]\nwind_speed = "0.3 %"\n', ["is not a number"]),
    "repeatability as number": (
        "repeatability = 0.1\n" + HEAD + R1,
        ["'repeatability' = 0.1 is not a table"],
    ),
    "no campaign": (swap('[campaign]\nname = "c"\n', ""), ["'campaign' is missing", "give campaign as"]),
    "no name": (swap('name = "c"\n', ""), ["[campaign]", "'name' is missing"]),
    "empty name": (swap('name = "c"', 'name = ""'), ["[campaign]", "blank"]),
    "no runs": (HEAD, ["'runs' is missing", "[[runs]]"]),
    "empty runs": ("runs = []\n" + HEAD, ["'runs' is empty"]),
    "runs as table": (HEAD + "[runs]\nid = 1\n", ["'runs'", "is not a list"]),
    "rig as number": ("rig = 1\n" + HEAD + R1, ["'rig' = 1 is not a table"]),
    "run as number": ("runs = [1]\n" + HEAD, ["run number 1", "is not a table"]),
    "no id": (in_run('id = "r2"\n', ""), ["run number 2", "'id' is missing"]),
    "empty id": (in_run('"r2"', '""'), ["run number 2", "blank", "give id as"]),
    "blank id": (in_run('"r2"', '"  "'), ["run number 2", "blank"]),
    "id of two lines": (in_run('"r2"', '"r\\n2"'), ["run 'r 2'", "line breaks"]),
    "id as number": (in_run('"r2"', "2"), ["run number 2", "'id' = 2 is not text"]),
    "duplicate id": (in_run('"r2"', '"r1"'), ["run 'r1'", "used twice", "its own id"]),
    "no file": (in_run('file = "runs/r2.csv"\n', ""), ["run 'r2'", "'file' is missing", "runs/r01.csv"]),
    "empty file name": (in_run('"runs/r2.csv"', '""'), ["run 'r2'", "'file'"]),
    "no wind speed": (in_run("wind_speed = 10.0\n", ""), ["run 'r2'", "'wind_speed' is missing", "wind-off"]),
    "wind without density": (in_run("air_density = 1.2\n", ""), ["run 'r2'", "without air_density", "kg/m3"]),
    "release in degrees": (
        in_run("air_density", "release_angle = 20\nair_density"),
        ["run 'r2'", "release_angle = 20", "degrees", "give it in rad"],
    ),
    "absolute path": (in_run("runs/r2.csv", "/etc/r2.csv"), ["run 'r2'", "outside", "inside the folder"]),
    "parent path": (in_run("runs/r2.csv", "../outside.csv"), ["run 'r2'", "outside", "'..'"]),
    "parent path inside": (in_run("runs/r2.csv", "runs/../runs/r2.csv"), ["run 'r2'", "outside", "'..'"]),
    "drive": (in_run("runs/r2.csv", "C:/r2.csv"), ["run 'r2'", "outside"]),
    "backslash parent": (in_run('"runs/r2.csv"', "'..\\outside.csv'"), ["run 'r2'", "outside"]),
    "missing run file": (in_run("runs/r2.csv", "runs/r3.csv"), ["r3.csv", "run 'r2'", "no such file"]),
    "run file under a file": (in_run("runs/r2.csv", "runs/r1.csv/r2.csv"), ["run 'r2'", "no such file"]),
    "endless file name": (in_run("runs/r2.csv", "r" * 300 + ".csv"), ["run 'r2'"]),
    "unsupported type": (in_run("runs/r2.csv", "runs/r2.xlsx"), ["run 'r2'", "'.xlsx'", ".csv or .parquet"]),
    "no type": (in_run("runs/r2.csv", "runs/r2"), ["run 'r2'", ".csv or .parquet"]),
    "a folder as file": (in_run("runs/r2.csv", "runs/dir.csv"), ["run 'r2'", "cannot be read"]),
}
for key, value in {"spring_stiffness": "16.12", "wind_speed": "10.0", "air_density": "1.2"}.items():
    for bad, reason in {
        "-1.0": "greater than",
        "nan": "finite",
        "inf": "finite",
        '"10"': "not a number",
        "true": "not a number",
        "[1.0]": "not a number",
    }.items():
        TOML_CASES[f"{key} = {bad}"] = (
            in_run(f"{key} = {value}", f"{key} = {bad}"),
            ["run 'r2'", f"'{key}'", reason, f"give {key} as"],
        )
for key in ("spring_stiffness", "air_density"):
    TOML_CASES[f"{key} = 0"] = (
        in_run(f"{key} = ", f"{key} = 0  # "),
        ["run 'r2'", f"'{key}' = 0", "greater than 0", f"give {key} as a positive number"],
    )
for key in ("yaw_inertia", "frontal_area", "reference_length"):
    TOML_CASES[f"rig {key} = 0"] = (
        swap(f"{key} = ", f"{key} = 0  # "),
        ["[rig]", f"'{key}' = 0", "positive"],
    )
for bad in ("-0.1", "nan", '"0"'):
    TOML_CASES[f"resolution = {bad}"] = (swap("= 0.0005", f"= {bad}"), ["[sensor]", "'resolution'", "rad"])
for bad in ("0.0", "-1.0", "inf"):
    TOML_CASES[f"sample_rate = {bad}"] = (
        swap("resolution = 0.0005", f"sample_rate = {bad}"),
        ["[sensor]", "Hz"],
    )


@pytest.mark.parametrize("case", TOML_CASES)
def test_bad_campaign_file(folder: Path, case: str) -> None:
    content, expected = TOML_CASES[case]
    (folder / "runs" / "dir.csv").mkdir()
    (folder / "campaign.toml").write_text(content, encoding="utf-8")
    text = refusal(folder)
    for part in [str(folder), *expected]:
        assert part in text


def test_campaign_file_that_is_not_utf8(folder: Path) -> None:
    (folder / "campaign.toml").write_bytes(TOML.replace('"c"', '"é"').encode("latin-1"))
    text = refusal(folder)
    assert "campaign.toml" in text
    assert "save the file as UTF-8" in text


def test_no_campaign_file(folder: Path) -> None:
    (folder / "campaign.toml").unlink()
    text = refusal(folder)
    assert "campaign.toml: no such file" in text
    assert "name a folder that holds a campaign.toml" in text


def test_no_folder(tmp_path: Path) -> None:
    text = refusal(tmp_path / "nowhere")
    assert "nowhere: no such folder" in text
    assert "campaign.toml" in text


def test_a_file_in_place_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text(GOOD)
    assert "run.csv: no such folder" in refusal(tmp_path / "run.csv")


@pytest.mark.skipif(os.geteuid() == 0, reason=f"{USER}: root may read anything")
def test_a_file_without_permission(folder: Path) -> None:
    (folder / "runs" / "r2.csv").chmod(0)
    try:
        with pytest.raises(TunnelError, match=r"run 'r2'.*cannot be read"):
            read_campaign(folder)
    finally:
        (folder / "runs" / "r2.csv").chmod(0o644)
