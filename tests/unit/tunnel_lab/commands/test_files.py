"""``tunnel import``, ``tunnel export``, one file in place of a campaign, and the formats of tables."""

from __future__ import annotations

import csv
import io
import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

from tests.support.command import Tunnel
from tests.support.import_files import csv as record
from tests.support.import_files import decay, written
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.importing.choices import read_recipe

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.mark.usefixtures("unrendered")
def test_an_import_says_what_it_read_and_writes_the_campaign(tunnel: Tunnel, tmp_path: Path) -> None:
    out = tmp_path / "rig"
    status, said, err = tunnel(
        "import", record(tmp_path), "--out", out, "--yes", "--set", "spring_stiffness=16"
    )
    assert (status, err) == (0, "")
    assert "2 columns separated by commas" in said
    assert "wind-off is assumed" in said
    assert sorted(path.name for path in out.iterdir()) == [
        "campaign.toml",
        "import.png",
        "import.toml",
        "runs",
    ]
    assert (out / "import.png").read_bytes().startswith(PNG)
    assert tunnel("identify", out)[0] == 0
    status, _, err = tunnel("import", record(tmp_path), "--out", out, "--yes")
    assert (status, err.count("\n")) == (2, 1)
    assert "the folder exists" in err
    again = ("import", record(tmp_path), "--out", out, "--yes", "--overwrite", "--recipe", out)
    assert tunnel(*again)[0] == 0
    assert "spring_stiffness = 16.0" in (out / "campaign.toml").read_text()


def test_a_preview_writes_the_picture_alone(tunnel: Tunnel, tmp_path: Path) -> None:
    path = record(tmp_path)
    status, said, _ = tunnel("import", path, "--preview", tmp_path / "look.png")
    assert status == 0
    assert "Written" in said
    assert sorted(one.name for one in tmp_path.iterdir()) == ["log.csv", "look.png"]


def test_options_take_a_decimal_comma(tunnel: Tunnel, tmp_path: Path) -> None:
    out = tmp_path / "rig"
    numbers = ("--set", "air_density=1,19,wind_speed=12,5", "--rest", "0,001", "--start", "0,5")
    status, _, err = tunnel("import", record(tmp_path), "--out", out, "--yes", *numbers)
    assert (status, err) == (0, "")
    (run,) = read_campaign(out).runs
    assert (run.air_density, run.wind_speed) == (1.19, 12.5)
    assert read_recipe(out).rest == 0.001
    assert read_recipe(out).start == 0.5
    status, _, err = tunnel("import", record(tmp_path), "--out", out, "--yes", "--rate", "1,200")
    assert (status, err) == (2, "tunnel: --rate: '1,200' may be 1.200 or 1200; give one of these\n")


def test_one_file_is_identified_in_normalised_form(tunnel: Tunnel, tmp_path: Path) -> None:
    status, out, err = tunnel("identify", record(tmp_path), "--json", "-")
    assert status == 0
    (run,) = json.loads(out)["runs"]
    assert abs(run["omega_n"]["value"] - 4.0 * 3.14159265) < 0.01
    assert "Note: log.csv: text (ASCII)" in err
    bad = written(
        tmp_path, "two.csv", "a,b,c\n" + "".join(f"{i}.5,{i * i % 7},{i * i % 5}\n" for i in range(99))
    )
    status, out, err = tunnel("diagnose", bad)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "tunnel import takes options: give --angle" in err


def test_tables_as_csv_markdown_and_json(tunnel: Tunnel) -> None:
    status, out, err = tunnel("springs", "--format", "csv")
    assert status == 0
    title, *lines = out.strip().split("\n")
    assert title == "# Springs of the paper's Table II"
    rows = list(csv.DictReader(io.StringIO("\n".join(lines))))
    assert rows[3]["Kr [N m/rad]"] == "6.12"
    assert "Izz (gradient)" in err
    _, out, _ = tunnel("springs", "--format", "json")
    (document,) = map(json.loads, out.strip().split("\n"))
    assert document["rows"][3]["Kr [N m/rad]"] == 6.12
    assert document["rows"][3]["spring"] == 4
    _, out, _ = tunnel("springs", "--format", "md")
    assert "| 4 | 6.12 | 1.3167 |" in out
    assert "Izz (gradient)" in tunnel("springs")[1]


def test_an_export_is_written(tunnel: Tunnel, tiny_campaign: Path, tmp_path: Path) -> None:
    status, out, _ = tunnel("export", tiny_campaign, "--file-format", "csv", "--out", tmp_path / "all.csv")
    assert status == 0
    assert "2 runs" in out
    assert (tmp_path / "all.csv").read_text().startswith("run,wind_speed,spring_stiffness,")
    status, _, err = tunnel("export", tiny_campaign, "--file-format", "doc")
    assert (status, err.count("\n")) == (2, 1)


def held_and_released(folder: Path, *, first: float) -> Path:
    """A record at 200 Hz, whose body is held aside for 4 s and then let go; its clock starts at ``first``, s."""
    _, free = decay()
    angle = np.concatenate([np.linspace(0.0, 0.35, 200), np.full(600, 0.35), free])
    clock = first + np.arange(angle.size) / 200.0
    rows = "".join(f"{t:.3f},{value:.5f}\n" for t, value in zip(clock, angle, strict=True))
    return written(folder, "log.csv", f"time_s,yaw_rad\n{rows}")


def test_times_of_notes_table_and_picture_are_those_that_start_takes(
    tunnel: Tunnel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[float] = []
    monkeypatch.setattr(Axes, "axvline", lambda _axes, x, **_style: drawn.append(x))  # where a run begins
    path = held_and_released(tmp_path, first=100.0)
    status, said, _ = tunnel("import", path, "--preview", tmp_path / "look.png")
    assert status == 0
    assert "the times stated here are the times of the file, which starts at 100 s" in said
    (row,) = (line.split() for line in said.splitlines() if line.split()[:1] == ["log"])
    begins = row[3]
    assert float(begins) == pytest.approx(104.0, abs=0.02)  # where the body was let go
    assert drawn == pytest.approx([float(begins)])
    status, again, _ = tunnel("import", path, "--preview", tmp_path / "look.png", "--start", begins)
    assert status == 0
    (again_row,) = (line.split() for line in again.splitlines() if line.split()[:1] == ["log"])
    assert again_row[1] == row[1]  # samples
    assert [float(cell) for cell in again_row[3:5]] == pytest.approx(
        [float(cell) for cell in row[3:5]], abs=0.0011
    )
    status, said, _ = tunnel("import", path, "--preview", tmp_path / "look.png", "--start", "log=105")
    (later,) = (line.split() for line in said.splitlines() if line.split()[:1] == ["log"])
    assert later[3] == "105.000"


def test_a_run_that_is_not_there_has_no_start(tunnel: Tunnel, tmp_path: Path) -> None:
    words = ("import", record(tmp_path), "--preview", tmp_path / "look.png", "--start")
    assert "no run 'lag'; did you mean 'log'?" in tunnel(*words, "lag=1")[2]
    assert "--start: 'soon' is not a time; give SECONDS or RUN=SECONDS" in tunnel(*words, "soon")[2]


def several_logs(folder: Path, *, columns: str = "time_s,yaw_rad", prefix: str = "log") -> list[Path]:
    """Three files alike, with a third column that nothing uses."""
    time, free = decay()
    paths = []
    for number in range(3):
        rows = "".join(
            f"{t:.3f},{a:.5f},{20 + t / 9:.2f}\n" for t, a in zip(time[100 * number :], free, strict=False)
        )
        name = f"{prefix}-{number}.csv"
        paths.append(written(folder, name, f"{columns},temperature_C\n{rows}"))
    return paths


def test_several_files_take_one_line_each_and_what_is_to_judge_stands_at_the_end(
    tunnel: Tunnel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    prefix = "2026-11-28_yaw-rig_campaign-7_spring-4_repetition"
    paths = several_logs(tmp_path, prefix=prefix)
    status, said, err = tunnel("import", *paths, "--preview", tmp_path / "look.png")
    assert (status, err) == (0, "")
    lines = said.splitlines()
    last = max(number for number, line in enumerate(lines) if line.startswith("Note: "))
    table = lines[: next(number for number, line in enumerate(lines) if line.startswith("Note: "))]
    assert max(map(len, table)) <= 80
    assert len(table) <= 5 + 2 * 3 + 1  # a long name takes two lines
    assert "In all rows: " in said
    assert "rate [Hz] 200" in said
    checks = lines[last + 1 : -1]
    assert all(line.startswith("Check: all runs: ") for line in checks)
    assert any("not used: 'temperature" in line and "--set KEY=NAME" in line for line in checks)
    assert any("wind-off is assumed; --set wind_speed=SPEED" in line for line in checks)


def test_one_answer_has_the_questions_of_all_files(tunnel: Tunnel, tmp_path: Path) -> None:
    volts = several_logs(tmp_path, columns="time_s,pot [V]")
    counts = several_logs(tmp_path, columns="time_s,yaw [counts]", prefix="enc")
    status, _, err = tunnel("import", *volts, *counts, "--out", tmp_path / "rig", "--yes")
    assert (status, err.count("\n")) == (2, 1)
    assert err.count("'pot' is in V; give --calibration") == 1
    assert err.count("'yaw' is in counts; give --counts-per-turn N") == 1
    assert all(path.name in err for path in (*volts, *counts))
    assert not (tmp_path / "rig").exists()


def test_a_dry_run_shows_the_campaign_and_writes_nothing(tunnel: Tunnel, tmp_path: Path) -> None:
    paths = several_logs(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    rig = tmp_path / "rig"
    status, said, err = tunnel("import", *paths, "--out", rig, "--dry-run")
    assert (status, err) == (0, "")
    assert sorted(tmp_path.rglob("*")) == before
    assert tunnel("import", *paths, "--out", rig, "--yes")[0] == 0
    files = [path for path in rig.rglob("*") if path.is_file()]
    assert all(f"  {path}\n" in said for path in files)
    shown = (rig / "campaign.toml").read_text()
    assert shown.strip() in said
    status, _, err = tunnel("import", *paths, "--out", rig, "--dry-run")
    assert (status, "the folder exists" in err) == (2, True)


def test_a_folder_of_records_gets_the_command_that_imports_it(
    tunnel: Tunnel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("day 1").mkdir()
    paths = several_logs(Path("day 1"))
    for command in ("identify", "diagnose"):
        status, _, err = tunnel(command, "day 1")
        assert (status, err.count("\n")) == (2, 1)
        assert "is a folder of 3 records (.csv), not a campaign; import it: tunnel import" in err
    line = shlex.split(err.partition("import it: ")[2])
    assert line == ["tunnel", "import", "day 1/*.csv", "--out", "day 1-campaign"]
    assert tunnel("import", *paths, *line[3:], "--yes")[0] == 0
    for path in paths:
        path.write_text(path.read_text().replace("yaw_rad", "pot [V]"))
    assert "--out 'day 1-campaign' --calibration \"a + b*V\"; it asks: " in tunnel("diagnose", "day 1")[2]
    for path in paths:  # a column's name is not an option
        path.write_text(path.read_text().replace("pot [V]", "give --overwrite now [V]"))
    assert "--out 'day 1-campaign' --calibration \"a + b*V\"; it asks: " in tunnel("diagnose", "day 1")[2]


def test_a_column_named_as_a_rate_without_a_unit_is_asked_for_its_unit(
    tunnel: Tunnel, tmp_path: Path
) -> None:
    name = "Winkelgeschwindigkeit"
    time, angle = decay(amplitude=30.0)
    rows = "".join(f"{1e3 * t:.0f},{value:.4f}\n" for t, value in zip(time, angle, strict=True))
    path = written(tmp_path, "imu.csv", f"Time,{name}\n{rows}")
    for chosen in ((), ("--angle", name), ("--angle", 2)):
        status, _, err = tunnel("import", path, *chosen, "--preview", tmp_path / "look.png")
        assert (status, err.count("\n")) == (2, 1)
        assert f"'{name}' is a rate by its name, and nothing states its unit" in err
        assert f'--angle "{name}" and --unit, one of rad/s, deg/s, rpm' in err
    status, said, _ = tunnel(
        "import", path, "--angle", name, "--unit", "deg/s", "--preview", tmp_path / "look.png"
    )
    assert status == 0
    assert "[rad/s]" in said
