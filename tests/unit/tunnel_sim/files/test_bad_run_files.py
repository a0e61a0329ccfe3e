"""Every bad run file is refused in one line that names it and the remedy."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from tests.support.spoilt_campaign import GOOD, LINES, TIME, YAW, csv, good_campaign, in_run, refusal, swap
from tunnel_sim.files.campaign_folder import read_campaign


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return good_campaign(tmp_path)


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
    "column twice": (GOOD.replace("time_s,yaw_rad", "yaw_rad,yaw_rad"), ["yaw_rad occurs twice"]),
    "no time, no rate": (csv(None, YAW), ["time_s", "sample_rate", "[sensor]"]),
    "time in milliseconds": (GOOD.replace("time_s", "time_ms"), ["'time_ms'", "did you mean 'time_s'"]),
    "time in capitals": (GOOD.replace("time_s", "Time_s"), ["'Time_s'", "did you mean 'time_s'"]),
    "step back": (change(300, "0.2,0.1"), ["steps back", "sort"]),
    "time stands still": (change(300, LINES[298]), ["stands still", "repeated"]),
    "times a billionth apart": (
        change(300, LINES[298].replace(",", "0000000001,")),
        ["stands still", "repeated"],
    ),
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


PANICS = Path(__file__).parents[4] / "tests" / "data" / "panics.parquet"
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


def test_a_decoder_that_panics_prints_nothing(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = folder / "runs" / "r2.parquet"
    path.write_bytes(PANICS.read_bytes())  # a column that ends behind the end of the file
    (folder / "campaign.toml").write_text(in_run("r2.csv", "r2.parquet"), encoding="utf-8")
    assert "run 'r2': not a readable Parquet file" in refusal(folder)
    assert capfd.readouterr() == ("", "")


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


def test_a_run_at_rest_beside_its_release_angle(folder: Path) -> None:
    (folder / "runs" / "r1.csv").write_text(csv(TIME, 0.0 * YAW), encoding="utf-8")
    assert "no oscillation" in refusal(folder)


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
