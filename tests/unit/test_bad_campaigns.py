"""Every bad input is refused in one line that names the file, the run and the remedy, and changes nothing."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from tunnel_sim.files.campaign_io import read_campaign
from tunnel_sim.vocabulary.errors import TunnelError

HEAD = 'schema_version = 1\n[campaign]\nname = "c"\n'
RIG = "[rig]\nyaw_inertia = 0.11\nfrontal_area = 0.036\nreference_length = 0.625\n"
SENSOR = "[sensor]\nresolution = 0.0005\n"
R1 = """[[runs]]
id = "r1"
file = "runs/r1.csv"
spring_stiffness = 16.12
wind_speed = 0.0
release_angle = 0.349
"""
R2 = """[[runs]]
id = "r2"
file = "runs/r2.csv"
spring_stiffness = 16.12
wind_speed = 10.0
air_density = 1.2
"""
TOML = HEAD + RIG + SENSOR + R1 + R2

TIME = np.arange(1000) / 200.0
YAW = 0.349 * np.exp(-0.1 * TIME) * np.cos(12.6 * TIME)


def csv(time: np.ndarray | None, yaw: np.ndarray, column: str = "yaw_rad") -> str:
    table = {column: yaw} if time is None else {"time_s": time, column: yaw}
    return pl.DataFrame(table).write_csv()


GOOD = csv(TIME, YAW)
LINES = GOOD.splitlines()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "c"
    (folder / "runs").mkdir(parents=True)
    (folder / "campaign.toml").write_text(TOML, encoding="utf-8")
    for run in ("r1", "r2"):
        (folder / "runs" / f"{run}.csv").write_text(GOOD, encoding="utf-8")
    (tmp_path / "outside.csv").write_text(GOOD, encoding="utf-8")
    return folder


def refusal(folder: Path) -> str:
    def listing() -> dict[Path, bytes | None]:
        return {p: p.read_bytes() if p.is_file() else None for p in folder.parent.rglob("*")}

    before = listing()
    with pytest.raises(TunnelError) as caught:
        read_campaign(folder)
    assert listing() == before
    assert caught.value.remedy
    text = str(caught.value)
    assert text.isprintable(), "one line, and nothing a terminal would act on"
    assert len(text) < 400 + len(str(folder))
    return text


def test_the_campaign_the_others_spoil_is_good(folder: Path) -> None:
    assert [run.id for run in read_campaign(folder).runs] == ["r1", "r2"]


def swap(old: str, new: str) -> str:
    assert old in TOML
    return TOML.replace(old, new, 1)


def in_run(old: str, new: str) -> str:
    """The campaign with a change in the second run only."""
    assert old in R2
    return HEAD + RIG + SENSOR + R1 + R2.replace(old, new)


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


def change(at: int, line: str) -> str:
    """The good file with one line (counted from 1, the header) replaced."""
    return "\n".join([*LINES[: at - 1], line, *LINES[at:]]) + "\n"


RUN_CASES: dict[str, tuple[str | bytes, list[str]]] = {
    "empty": ("", ["empty", "time_s"]),
    "blank": ("\n\n", ["empty"]),
    "header only": ("time_s,yaw_rad\n", ["no samples"]),
    "header and blanks": ("time_s,yaw_rad\n\n\n", ["no samples"]),
    "no header": ("\n".join(LINES[1:]), ["no header line", "time_s,yaw_rad"]),
    "not UTF-8": (GOOD.encode() + b"\xff\xfe,1\n", ["UTF-8", "line 1002"]),
    "UTF-16": (GOOD.encode("utf-16"), ["UTF-8"]),
    "binary": (bytes(range(256)) * 4, ["UTF-8"]),
    "semicolons": (GOOD.replace(",", ";"), ["comma"]),
    "tabs": (GOOD.replace(",", "\t"), ["comma"]),
    "decimal commas": ("time_s,yaw_rad\n0,0,3,4\n", ["comma", "decimal points"]),
    "a value too many": (change(7, "0.025,0.3,1"), ["comma-separated"]),
    "a value too few": (change(7, "0.025"), ["yaw_rad", "no value", "line 7"]),
    "blank line": (change(7, ""), ["time_s", "no value", "line 7"]),
    "no value": (change(7, "0.025,"), ["yaw_rad", "no value", "line 7"]),
    "NaN": (change(7, "0.025,NaN"), ["yaw_rad is NaN", "line 7", "cut the record"]),
    "infinity": (change(7, "0.025,-inf"), ["yaw_rad is -inf", "line 7"]),
    "text": (change(7, "0.025,n/a"), ["yaw_rad is n/a", "line 7"]),
    "overflow": (change(7, "0.025,1e999"), ["yaw_rad is 1e999", "line 7"]),
    "NaN in time": (change(7, "nan,0.3"), ["time_s is nan", "line 7"]),
    "no angle": (csv(TIME, YAW, "yaw"), ["yaw_rad or yaw_deg", "columns found: time_s, yaw", "name the"]),
    "both angles": (
        pl.DataFrame({"time_s": TIME, "yaw_rad": YAW, "yaw_deg": np.rad2deg(YAW)}).write_csv(),
        ["both yaw_rad and yaw_deg", "leave one"],
    ),
    "column twice": (GOOD.replace("time_s,yaw_rad", "yaw_rad,yaw_rad"), ["yaw_rad is there twice"]),
    "no time, no rate": (csv(None, YAW), ["time_s", "sample_rate", "[sensor]"]),
    "time in milliseconds": (GOOD.replace("time_s", "time_ms"), ["'time_ms'", "did you mean 'time_s'"]),
    "time in capitals": (GOOD.replace("time_s", "Time_s"), ["'Time_s'", "did you mean 'time_s'"]),
    "step back": (change(300, "0.2,0.1"), ["steps back", "sort"]),
    "time stands still": (change(300, LINES[298]), ["stands still", "repeated"]),
    "time backwards": (csv(TIME[::-1], YAW), ["steps back"]),
    "coarse times": (csv(np.round(TIME, 2), YAW), ["time_s"]),
    "one sample": ("\n".join(LINES[:2]), ["only one sample", "three cycles"]),
    "two samples": ("\n".join(LINES[:3]), ["fewer than three"]),
    "two cycles": ("\n".join(LINES[:200]), ["about 2.", "fewer than three", "record for longer"]),
    "at rest": (csv(TIME, 0.0 * YAW + 0.1), ["no oscillation", "fewer than three"]),
    "only noise": (csv(TIME, np.random.default_rng(0).normal(0, 0.001, TIME.size)), ["fewer than three"]),
    "only hum": (csv(TIME, 0.01 * np.sin(100 * np.pi * TIME)), ["fewer than three"]),
    "creeping": (csv(TIME, 0.3 * np.exp(-TIME)), ["fewer than three"]),
    "degrees as radians": (
        csv(TIME, np.rad2deg(YAW)),
        ["the angle swings by ±", "degrees", "name the column yaw_deg", "plausible = false"],
    ),
    "degrees about an offset": (csv(TIME, 100 + 13 * YAW / 0.349), ["degrees", "yaw_deg"]),
    "a rate where an angle is stated": (
        csv(TIME, YAW, "yaw_rate_rad_s"),
        ["yaw_rad or yaw_deg", "quantity = 'rate' under [sensor]"],
    ),
}


@pytest.mark.parametrize("case", RUN_CASES)
def test_bad_run_file(folder: Path, case: str) -> None:
    content, expected = RUN_CASES[case]
    path = folder / "runs" / "r2.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    text = refusal(folder)
    for part in [str(path), "run 'r2'", *expected]:
        assert part in text


def frame(**columns: object) -> Callable[[Path], None]:
    return lambda path: pl.DataFrame(columns).write_parquet(path)


PARQUET_CASES: dict[str, tuple[Callable[[Path], None], list[str]]] = {
    "empty": (lambda p: p.write_bytes(b""), ["empty"]),
    "not Parquet": (lambda p: p.write_text(GOOD), ["not a readable Parquet file", "again"]),
    "only the marks": (lambda p: p.write_bytes(b"PAR1" + b"\0" * 40 + b"PAR1"), ["not a readable Parquet"]),
    "no rows": (frame(time_s=[], yaw_rad=[]), []),
    "no angle": (frame(time_s=TIME), ["yaw_rad or yaw_deg"]),
    "both angles": (frame(time_s=TIME, yaw_rad=YAW, yaw_deg=YAW), ["both yaw_rad and yaw_deg"]),
    "null": (frame(time_s=TIME, yaw_rad=[None, *YAW[1:]]), ["yaw_rad is no value", "row 1"]),
    "NaN": (frame(time_s=TIME, yaw_rad=np.where(TIME == 1.0, np.nan, YAW)), ["yaw_rad is nan", "row 201"]),
    "text": (frame(time_s=TIME, yaw_rad=[str(y) for y in YAW]), ["String", "not numbers"]),
    "truths": (frame(time_s=TIME, yaw_rad=YAW > 0), ["Boolean", "not numbers"]),
    "durations": (frame(time_s=pl.Series(range(1000), dtype=pl.Duration("ms")), yaw_rad=YAW), ["Duration"]),
    "lists": (frame(time_s=TIME, yaw_rad=[[y] for y in YAW]), ["List", "not numbers"]),
}


@pytest.mark.parametrize("case", PARQUET_CASES)
def test_bad_parquet(folder: Path, case: str) -> None:
    write, expected = PARQUET_CASES[case]
    path = folder / "runs" / "r2.parquet"
    write(path)
    (folder / "campaign.toml").write_text(in_run("r2.csv", "r2.parquet"), encoding="utf-8")
    text = refusal(folder)
    for part in [str(path), "run 'r2'", *expected]:
        assert part in text


def test_truncated_parquet(folder: Path) -> None:
    path = folder / "runs" / "r2.parquet"
    frame(time_s=TIME, yaw_rad=YAW)(path)
    path.write_bytes(path.read_bytes()[:-200])
    (folder / "campaign.toml").write_text(in_run("r2.csv", "r2.parquet"), encoding="utf-8")
    assert "not a readable Parquet file" in refusal(folder)


def test_a_decoder_that_panics_is_reported_like_any_broken_file(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def panic(*_: object, **__: object) -> pl.DataFrame:
        raise pl.exceptions.PanicException("assertion failed")

    monkeypatch.setattr(pl, "read_parquet", panic)
    frame(time_s=TIME, yaw_rad=YAW)(folder / "runs" / "r2.parquet")
    (folder / "campaign.toml").write_text(in_run("r2.csv", "r2.parquet"), encoding="utf-8")
    assert "run 'r2': not a readable Parquet file (assertion failed)" in refusal(folder)


@pytest.mark.parametrize(("rate", "unit"), [("200", 1e3), ("0.2", 1.0), ("200", 1e6)])
def test_times_or_a_sample_rate_in_another_unit(folder: Path, rate: str, unit: float) -> None:
    (folder / "runs" / "r1.csv").write_text(csv(TIME * unit, YAW), encoding="utf-8")
    toml = swap("resolution = 0.0005", f"sample_rate = {rate}")
    (folder / "campaign.toml").write_text(toml, encoding="utf-8")
    text = refusal(folder)
    for part in ("r1.csv", "run 'r1'", f"sample_rate is {rate} Hz", "seconds"):
        assert part in text


@pytest.mark.parametrize("rate", ["1000.0", "190.0", "20.0"])
def test_a_run_with_times_may_have_a_rate_of_its_own(folder: Path, rate: str) -> None:
    """``sample_rate`` is for runs without times; where a run has them, they count."""
    (folder / "campaign.toml").write_text(swap("resolution = 0.0005", f"sample_rate = {rate}"))
    for run in read_campaign(folder).runs:
        assert run.record.sample_rate == pytest.approx(200.0)
        np.testing.assert_array_equal(run.record.time_s, TIME)


@pytest.mark.parametrize("name", ["time_ms", "Time", "t"])
def test_columns_of_other_names_are_left_alone_where_the_rate_is_stated(folder: Path, name: str) -> None:
    (folder / "campaign.toml").write_text(swap("resolution = 0.0005", "sample_rate = 200.0"))
    text = GOOD.replace("time_s", name)
    (folder / "runs" / "r1.csv").write_text(text, encoding="utf-8")
    (run, _) = read_campaign(folder).runs
    np.testing.assert_allclose(run.record.time_s, TIME)
    np.testing.assert_array_equal(run.record.yaw_rad, YAW)


def test_further_columns_may_share_a_name_or_hold_text(folder: Path) -> None:
    lines = [
        "time_s,force,yaw_rad,force,note",
        *(f"{t},1,{y},2,rest" for t, y in zip(TIME, YAW, strict=True)),
    ]
    (folder / "runs" / "r1.csv").write_text("\n".join(lines), encoding="utf-8")
    np.testing.assert_array_equal(read_campaign(folder).runs[0].record.yaw_rad, YAW)


def test_degrees_may_swing_by_more_than_half_a_turn(folder: Path) -> None:
    """The format refuses degrees named radians, not large angles named degrees."""
    wide = csv(TIME, 200.0 * YAW / 0.349, "yaw_deg")
    (folder / "runs" / "r2.csv").write_text(wide, encoding="utf-8")
    run = read_campaign(folder).runs[1]
    np.testing.assert_allclose(run.record.yaw_rad, np.deg2rad(200.0 * YAW / 0.349))


@pytest.mark.parametrize(("column", "factor"), [("yaw_rad", 180 / np.pi), ("yaw_deg", 1.0)])
def test_a_slip_of_unit_too_small_to_see_without_the_release_angle(
    folder: Path, column: str, factor: float
) -> None:
    # 2 degrees written as radians, or radians written as degrees.
    (folder / "runs" / "r1.csv").write_text(csv(TIME, 0.1 * YAW * factor, column), encoding="utf-8")
    angle = 0.0349
    (folder / "campaign.toml").write_text(swap("0.349", str(angle)), encoding="utf-8")
    text = refusal(folder)
    for part in ("r1.csv", "run 'r1'", column, "release_angle of 0.0349"):
        assert part in text


def test_a_link_out_of_the_folder(folder: Path) -> None:
    path = folder / "runs" / "r2.csv"
    path.unlink()
    path.symlink_to(folder.parent / "outside.csv")
    text = refusal(folder)
    for part in (str(path), "run 'r2'", "symbolic link", "copy the file"):
        assert part in text


def test_a_linked_folder_out_of_the_folder(folder: Path) -> None:
    (folder.parent / "elsewhere").mkdir()
    (folder.parent / "elsewhere" / "r2.csv").write_text(GOOD, encoding="utf-8")
    (folder / "linked").symlink_to(folder.parent / "elsewhere")
    (folder / "campaign.toml").write_text(in_run("runs/r2.csv", "linked/r2.csv"), encoding="utf-8")
    assert "symbolic link" in refusal(folder)


def test_a_link_within_the_folder_is_good(folder: Path) -> None:
    path = folder / "runs" / "r2.csv"
    path.unlink()
    path.symlink_to("r1.csv")
    assert len(read_campaign(folder).runs) == 2


def test_a_link_to_itself(folder: Path) -> None:
    path = folder / "runs" / "r2.csv"
    path.unlink()
    path.symlink_to("r2.csv")
    assert "run 'r2'" in refusal(folder)


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


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="the superuser may read anything")
def test_a_file_without_permission(folder: Path) -> None:
    (folder / "runs" / "r2.csv").chmod(0)
    try:
        with pytest.raises(TunnelError, match=r"run 'r2'.*cannot be read"):
            read_campaign(folder)
    finally:
        (folder / "runs" / "r2.csv").chmod(0o644)
