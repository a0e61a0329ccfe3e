"""Text files of many dialects become the numbers that were written.

Truth: the numbers that each file was made from.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.support.import_files import Text, any_dialect, csv, decay, written
from tunnel_sim import TunnelError
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.columns import find_pairs
from tunnel_sim.files.importing.formats.text import facts_in, find_dialect
from tunnel_sim.files.importing.records import read_records
from tunnel_sim.files.importing.tables import Channel, Table


@pytest.mark.parametrize("seed", range(20))
def test_a_dialect_is_understood(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng([20260601, seed])
    dialect: Text = any_dialect(rng)
    time, angle = decay(seed)
    path = written(tmp_path, "log.txt", dialect.content(time + 3.0, angle))
    # A file without names cannot say that a swing of ±20 is one in degrees, or that 0.35 is one in radians; the
    # guess is right for these.
    (run,) = read_records([path]).campaign.runs
    np.testing.assert_allclose(run.record.time_s, time, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(run.record.yaw_rad, angle, rtol=0.0, atol=6e-8)


@pytest.mark.parametrize(
    ("lines", "delimiter", "decimal", "width"),
    [
        (["0,00;0,5", "0,01;0,4"], ";", ",", 2),
        (["0.00;0.5", "0.01;0.4"], ";", ".", 2),
        (["0,0 1,5", "0,1 1,4"], " ", ",", 2),
        (["1, 2, 3", "2, 3, 4"], ",", ".", 3),
        (["1.5\t\t2", "1.6\t3\t2"], "\t", ".", 3),
        (["0.5", "0.6"], "\t", ".", 1),
        (["10:00:01;0,5;ok", "10:00:02;0,25;ok"], ";", ",", 3),
        (["1e-3|-2E+1", ".5|5."], "|", ".", 2),
    ],
)
def test_the_dialect_of_some_lines(lines: list[str], delimiter: str, decimal: str, width: int) -> None:
    found = find_dialect(lines, ImportChoices())
    assert found is not None
    assert (found.delimiter, found.decimal, found.width) == (delimiter, decimal, width)


def test_runs_side_by_side_have_their_own_times_and_lengths(tmp_path: Path) -> None:
    (t1, y1), (t2, y2) = decay(1), decay(2, duration=6.0)
    lines = [
        "Time (s) Run #1;Angle (rad) Run #1;Volt (V) Run #1;Time (s) Run #2;Angle (rad) Run #2;Volt (V) Run #2"
    ]
    for i in range(t1.size):
        second = f"{t2[i]:.3f};{y2[i]:.6f};0.1" if i < t2.size else ";;"
        lines.append(f"{t1[i]:.3f};{y1[i]:.6f};0.1;{second}")
    path = written(tmp_path, "two.csv", "\n".join(lines).replace(".", ","))
    runs = read_records([path]).campaign.runs
    assert [run.id for run in runs] == ["run-1", "run-2"]
    for run, angle in zip(runs, (y1, y2), strict=True):
        np.testing.assert_allclose(run.record.yaw_rad, angle, rtol=0.0, atol=6e-7)


def test_the_rate_is_found_above_the_table(tmp_path: Path) -> None:
    _, angle = decay()
    rows = "\n".join(f"{i}\t{y:.8f}" for i, y in enumerate(angle))
    path = written(
        tmp_path, "a.lvm", f"Writer: logger\nSample rate: 0.2 kHz\n\nsample\tangle (rad)\n{rows}\n"
    )
    (run,) = read_records([path]).campaign.runs
    assert run.record.sample_rate == pytest.approx(200.0)


def test_a_rate_beside_the_angle_is_not_taken_for_it(tmp_path: Path) -> None:
    time, angle = decay()
    rate = np.gradient(angle, time)
    rows = "\n".join(f"{t:.3f},{y:.8f},{v:.6f}" for t, y, v in zip(time, angle, rate, strict=True))
    imported = read_records([written(tmp_path, "a.csv", rows)])
    np.testing.assert_allclose(imported.campaign.runs[0].record.yaw_rad, angle, atol=1e-8)
    assert any("'column 3' is left out: it is the rate" in line for line in imported.remarks())


@pytest.mark.parametrize(
    ("stamp", "hours"),
    [
        ("{}", 24),
        ("2026-03-01 {}", 24),
        ("2026-03-01T{}Z", 24),
        ('"{}"', 24),
        ("{} {half}M", 12),
        ("3/1/2026 {}{half}m", 12),
        ('"{} {half}.M."', 12),
    ],
)
@pytest.mark.parametrize("start", [86397.5, 43197.5])
def test_times_of_day_are_seconds_and_go_on_at_noon_and_midnight(
    stamp: str, hours: int, start: float, tmp_path: Path
) -> None:
    seconds, angle = start + 0.05 * np.arange(120), 0.2 * np.cos(9.0 * 0.05 * np.arange(120))
    halves = ["AP"[int(s % 86400 // 43200)] for s in seconds]
    whole = [int(s % 86400 // 3600) for s in seconds]
    shown = [hour if hours == 24 else (hour + 11) % 12 + 1 for hour in whole]
    clocks = [f"{h}:{s % 3600 // 60:02.0f}:{s % 60:06.3f}" for h, s in zip(shown, seconds, strict=True)]
    lines = [
        f"{stamp.format(clock, half=half)};{value:.6f}"
        for clock, half, value in zip(clocks, halves, angle, strict=True)
    ]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["stamp;yaw_rad", *lines]))
    imported = read_records([path])
    record = imported.campaign.runs[0].record
    np.testing.assert_allclose(record.time_s, seconds - seconds[0], atol=1e-6)
    assert any("'stamp' holds times of day" in remark for remark in imported.remarks())


def test_texts_among_the_numbers_are_said(tmp_path: Path) -> None:
    time, angle = decay()
    rows = [f"{t:.3f},{y:.8f},ok" for t, y in zip(time, angle, strict=True)]
    rows[500] = "2.500,error,ok"
    imported = read_records(
        [written(tmp_path, "a.csv", "time_s,yaw_rad,state\n" + "\n".join(rows) + "\nend of data\n")]
    )
    (run,) = imported.campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, np.delete(angle, 500), atol=1e-8)
    said = "\n".join(imported.remarks())
    assert "the column 'state' holds text and is left out" in said
    assert "1 text in the column 'yaw' taken as missing" in said
    assert "sample without a number left out" in said


@pytest.mark.parametrize(
    ("content", "what", "remedy"),
    [
        (b"", "the file is empty", "name a file"),
        (b"\x89HDF\r\n\x1a\n", "it begins like an HDF5 file", "ending of its format"),
        (b"time,angle\n0,1\0\n", "NUL bytes", "ending of its format"),
        (b"all\nwords\nhere\n", "no columns of numbers", "--delimiter"),
        (b"a,b,c\n" + b"".join(b"%d.5,%d,%d\n" % (i, i * i % 7, i * i % 5) for i in range(99)),
         "2 columns may be the angle: 'b', 'c'", '--angle "b"'),
        (b"force (N),temp (K)\n" + b"".join(b"%d,%d\n" % (i % 9, i % 7) for i in range(99)),
         "no column of angles", "--angle NAME"),
        (b"angle (rad)\n" + b"".join(b"0.%d\n" % (i % 9) for i in range(99)), "no column of times", "--rate"),
        (b"time (s),pot (V)\n" + b"".join(b"0.%02d,1.%d\n" % (i, i % 9) for i in range(99)),
         "'pot' is in V", '--calibration "a + b*V"'),
        (b"time (s),enc (counts)\n" + b"".join(b"0.%02d,%d\n" % (i, i % 9) for i in range(99)),
         "'enc' is in counts", "--counts-per-turn"),
        (b"time (s),yaw (rad)\n" + b"".join(b"%d,0.1\n" % i for i in range(9)), "no column of angles", "--angle"),
    ],
)  # fmt: skip
def test_bad_input_says_what_to_give(tmp_path: Path, content: bytes, what: str, remedy: str) -> None:
    with pytest.raises(TunnelError) as caught:
        read_records([written(tmp_path, "bad.csv", content)])
    assert what in caught.value.what
    assert remedy in caught.value.remedy
    assert "bad.csv" in caught.value.where


def test_an_unknown_column_has_a_suggestion(tmp_path: Path) -> None:
    with pytest.raises(TunnelError, match=r"no column 'yw'.*did you mean 'yaw'"):
        read_records([csv(tmp_path)], ImportChoices(angle=("yw",)))


def columns(*names: str) -> Table:
    units = ("s", "rad", "s", "rad")
    values = (np.arange(30.0), np.sin(np.arange(30.0)), np.arange(30.0), np.sin(np.arange(30.0)))
    return Table(tuple(map(Channel, names, values, units)))


@pytest.mark.parametrize("names", [("time", "a", "time", "b"), ("t#1", "a", "clock#2", "b")])
def test_columns_are_several_records_where_the_times_are_repeated(names: tuple[str, ...]) -> None:
    pairs = find_pairs(columns(*names), ImportChoices(), "")
    assert [(pair.time.channel.name, pair.reading.channel.name) for pair in pairs] == [names[:2], names[2:]]


def test_columns_are_one_record_where_the_times_have_different_names() -> None:
    with pytest.raises(TunnelError, match="2 columns may be the angle"):
        find_pairs(columns("time", "a", "clock", "b"), ImportChoices(), "")


def test_records_of_one_name_are_numbered(tmp_path: Path) -> None:
    for place in ("one", "two", "three"):
        (tmp_path / place).mkdir()
    files = [csv(tmp_path / "one", "a.csv"), csv(tmp_path / "two", "b.csv"), csv(tmp_path / "three", "a.csv")]
    assert [run.id for run in read_records(files).campaign.runs] == ["a-1", "b", "a-2"]


def test_names_and_units_in_two_rows(tmp_path: Path) -> None:
    time, angle = decay()
    rows = "".join(f"{t:.3f},{np.rad2deg(a):.6f}\n" for t, a in zip(time, angle, strict=True))
    (tmp_path / "log.csv").write_text("clock,swing\ns,deg\n" + rows)
    assert read_records([tmp_path / "log.csv"]).choices.angle == ("swing",)


def log(folder: Path, heading: str, factor: float, name: str = "log.csv") -> Path:
    """A file of times and a reading under a heading."""
    time, angle = decay()
    rows = "".join(f"{t};{a}\n" for t, a in zip(time.tolist(), (factor * angle).tolist(), strict=True))
    return written(folder, name, f"time_s;{heading}\n{rows}")


@pytest.mark.parametrize("word", ["Inkr.", "Inkremente", "increments", "Pulse", "digits"])
def test_counts_of_an_encoder_are_not_degrees(word: str, tmp_path: Path) -> None:
    for option in ({}, {"angle": ("Winkel",)}):
        with pytest.raises(TunnelError, match="'Winkel' is in counts; give --counts-per-turn N"):
            read_records([log(tmp_path, f"Winkel [{word}]", 551.0)], ImportChoices(**option))


def test_a_unit_that_is_not_known_is_asked_about(tmp_path: Path) -> None:
    path = log(tmp_path, "Winkel [Schr.]", 551.0)
    with pytest.raises(
        TunnelError, match=r"is in 'Schr.', which is not a known unit of an angle; give --unit"
    ):
        read_records([path], ImportChoices(angle=("2",)))
    (run,) = read_records([path], ImportChoices(angle=("2",), counts_per_turn=3462.0)).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, decay()[1] * 551.0 * 2.0 * np.pi / 3462.0)


@pytest.mark.parametrize("heading", ["Winkel", "yaw [deg]"])
def test_a_swing_of_more_than_half_a_turn_is_asked_about(heading: str, tmp_path: Path) -> None:
    path = log(tmp_path, heading, 551.0)
    with pytest.raises(
        TunnelError, match=r"would swing by more than half a turn in degrees; give --counts-per-turn N"
    ):
        read_records([path])
    (run,) = read_records([path], ImportChoices(unit="deg")).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, np.deg2rad(551.0 * decay()[1]))


@pytest.mark.parametrize(("unit", "column"), [("rad", "clock"), ("V", "1")])
def test_a_column_of_times_in_another_unit_is_refused(unit: str, column: str, tmp_path: Path) -> None:
    path = log(tmp_path, "yaw (rad)", 1.0)
    path.write_text(path.read_text().replace("time_s", f"clock ({unit})"))
    with pytest.raises(TunnelError, match="which is not a unit of time"):
        read_records([path], ImportChoices(time=column))


@pytest.mark.parametrize(
    "stated", ["fs=1e999", "fs = 1e-320", "dt = 1e999", "Ts: 1e-320", "fs = -1", "sample rate;0;Hz"]
)
def test_a_rate_that_is_not_one_is_not_believed(stated: str, tmp_path: Path) -> None:
    rows = "".join(f"{a}\n" for a in decay()[1].tolist())
    with pytest.raises(TunnelError, match="no column of times"):
        read_records([written(tmp_path, "log.csv", f"{stated}\nyaw (rad)\n{rows}")])


@pytest.mark.parametrize("stamp", ["14.03.2026", "2026-03-14", "03/14/2026", "14:03:07", "14.03.26 15:10"])
def test_a_date_or_a_time_of_day_states_no_number(stamp: str) -> None:
    assert facts_in([f"Datum;{stamp}", f"Date: {stamp}", "Luftdichte;1,190"]) == {"Luftdichte": 1.19}
