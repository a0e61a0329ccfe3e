"""Text files of many dialects become the numbers that were written.

Truth: the numbers that each file was made from.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.support.import_files import RATE, Text, any_dialect, csv, decay, written
from tunnel_sim import TunnelError
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.columns import find_pairs
from tunnel_sim.files.importing.formats.layout import facts_in
from tunnel_sim.files.importing.formats.text import find_dialect
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
        (["1.204;0,5", "1.205,5;0,4"], ";", ",", 2),
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


@pytest.mark.parametrize("head", ["dt_ms: 5", "Ts_us: 5000", "sample_rate_kHz: 0.2", "delta t = 5 ms"])
def test_the_rate_above_the_table_has_a_unit(head: str, tmp_path: Path) -> None:
    time, angle = decay()
    rows = "".join(f"{y:.8f},1\n" for y in angle)
    (run,) = read_records([written(tmp_path, "log.csv", f"{head}\nyaw [rad],x\n{rows}")]).campaign.runs
    np.testing.assert_allclose(run.record.time_s, time, atol=1e-9)


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
        ("2026-03-01 {} UTC", 24),
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
        (b"\x89MCAP0\r\n0,1\n1,2\n", "it begins like an MCAP log", "ending of its format"),
        (b"SQLite format 3\x000,1\n", "it begins like a log of ROS 2", "ending of its format"),
        (b"MDF     4.10    0,1\n1,2\n", "it begins like an MDF file", "ending of its format"),
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


@pytest.mark.parametrize("minus", ["\N{MINUS SIGN}", "\N{EN DASH}"])
def test_a_minus_as_in_print_is_one(minus: str, tmp_path: Path) -> None:
    _, angle = decay()
    path = csv(tmp_path)
    path.write_text(path.read_text("ascii").replace("-", minus), encoding="utf-8")
    (run,) = read_records([path]).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, angle, atol=1e-6)


@pytest.mark.parametrize("form", ["({:.6f})", "{:.6f}-", "-1'{:.6f}", "-1 {:.6f}", "-{:.6f} rad"])
def test_half_a_column_of_unknown_numbers_is_refused(form: str, tmp_path: Path) -> None:
    """The other half has the frequency and the damping of the whole one."""
    time, angle = decay()
    cells = [form.format(-y) if y < 0.0 else f"{y:.6f}" for y in angle]
    text = "t [s];yaw [rad]\n" + "".join(f"{t:.3f};{cell}\n" for t, cell in zip(time, cells, strict=True))
    with pytest.raises(TunnelError, match=r"'yaw' has numbers such as .*, in an unknown form"):
        read_records([written(tmp_path, "log.csv", text)])


def test_three_decimals_are_no_thousands(tmp_path: Path) -> None:
    """Beside a clock, the only sign of a comma's meaning is the column itself."""
    time, angle = decay()
    degrees = (20.0 + np.degrees(angle)).round(3)
    rows = [f"09:30:{t:06.3f};{a:.3f}".replace(".", ",") for t, a in zip(time, degrees, strict=True)]
    path = written(tmp_path, "clock.csv", "\n".join(["Clock;Angle (deg)", *rows]))
    (run,) = read_records([path]).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, np.radians(degrees), atol=1e-9)


def test_a_point_between_thousands_is_no_decimal_point(tmp_path: Path) -> None:
    """Such a clock, in whole milliseconds, would start anew at each thousand, or lose its first rows."""
    time, angle = decay(duration=2.5)
    cells = [f"{y:.6f}".replace(".", ",") for y in angle]
    clock = [f"{1e3 * t - 1900.0:,.0f}".replace(",", ".") for t in time]
    rows = [f"{t};{cell}" for t, cell in zip(clock, cells, strict=True)]
    with pytest.raises(TunnelError, match=r"'Zeit' has numbers such as '-1\.900', in an unknown form"):
        read_records([written(tmp_path, "log.csv", "\n".join(["Zeit [ms];Winkel [rad]", *rows]))])
    rows = [f"{t + 0.5:.3f};{cell};1,5" for t, cell in zip(time, cells, strict=True)]
    path = written(tmp_path, "log.csv", "\n".join(["t [s];yaw [rad];p", *rows]))
    (run,) = read_records([path]).campaign.runs
    np.testing.assert_allclose(run.record.time_s, time, atol=1e-9)
    np.testing.assert_allclose(run.record.yaw_rad, angle, atol=1e-6)


@pytest.mark.parametrize(
    ("above", "below"),
    [
        ("Voltage [V],Angle [deg]\n0,-180\n1,-108\n2,-36\n3,36\n\n", ""),
        ("", "\nPeak,Amplitude\n" + "".join(f"{k},{0.35 * 0.9**k:.4f}\n" for k in range(1, 13))),
        ("", "# mean\n4.0,0.0012\n# deviation\n4.0,0.145\n"),
        ("Channel,Gain\n1,10\n2,20\n3,30\n", "\nStatistics,\nMax,0.35\nSamples,1600\n"),
    ],
)
def test_a_short_table_beside_the_record_is_no_part_of_it(above: str, below: str, tmp_path: Path) -> None:
    time, angle = decay()
    rows = "".join(f"{t:.3f},{1e3 * y:.6f}\n" for t, y in zip(time, angle, strict=True))
    path = written(tmp_path, "log.csv", f"{above}Time [s],Angle [mrad]\n{rows}{below}")
    (run,) = read_records([path]).campaign.runs
    np.testing.assert_allclose(run.record.time_s, time, atol=1e-9)
    np.testing.assert_allclose(run.record.yaw_rad, angle, atol=1e-8)


def test_commas_between_columns_and_in_numbers_need_quotes(tmp_path: Path) -> None:
    time, angle = decay()
    rows = [
        [f"{t:.3f}".replace(".", ","), f"{y:.6f}".replace(".", ",")] for t, y in zip(time, angle, strict=True)
    ]
    bare = "\n".join(["t [s],yaw [rad]", *map(",".join, rows)])
    with pytest.raises(TunnelError, match="commas separate the columns, and are decimal signs as well"):
        read_records([written(tmp_path, "bare.csv", bare)])
    quoted = "\n".join(['"t [s]","yaw [rad]"', *(f'"{t}","{y}"' for t, y in rows)])
    (run,) = read_records([written(tmp_path, "quoted.csv", quoted)]).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, angle, atol=1e-6)


@pytest.mark.parametrize(
    ("head", "row"),
    [('"time_s" "yaw_rad"', '"{}" {:.3f} {:.8f}'), ("time_s,yaw_rad", "{},{:.3f},{:.8f}")],
)
def test_the_numbers_of_rows_may_have_no_name(head: str, row: str, tmp_path: Path) -> None:
    time, angle = decay()
    rows = [row.format(i, t, y) for i, (t, y) in enumerate(zip(time, angle, strict=True), 1)]
    (run,) = read_records([written(tmp_path, "log.txt", "\n".join([head, *rows]))]).campaign.runs
    np.testing.assert_allclose(run.record.time_s, time, atol=1e-9)
    np.testing.assert_allclose(run.record.yaw_rad, angle, atol=1e-8)


def test_seconds_and_milliseconds_in_two_columns_are_no_clock(tmp_path: Path) -> None:
    time, angle = decay()
    rows = [f"{int(t + 7)},{1e3 * (t % 1.0):.0f},{y:.8f}" for t, y in zip(time, angle, strict=True)]
    path = written(tmp_path, "log.csv", "\n".join(["Second,ms,yaw [rad]", *rows]))
    with pytest.raises(TunnelError, match="the times are in two columns, 'Second', 'ms'"):
        read_records([path])


def tidy(time: np.ndarray, angle: np.ndarray) -> dict[str, list[str]]:
    """Rows of times, texts and readings: two series in one column, or one with a text beside it."""
    rate = np.gradient(angle, time)
    values = list(zip(time, angle, rate, strict=True))
    return {
        "t,variable,value": [
            *(f"{t:.4f},angle,{y:.6f}" for t, y, _ in values),
            *(f"{t:.4f},rate,{v:.6f}" for t, _, v in values),
        ],
        "t,sensor,yaw": [
            row for t, y, v in values for row in (f"{t:.4f},a,{y:.6f}", f"{t + 0.002:.4f},b,{v:.6f}")
        ],
        "t,status,yaw": [
            f"{t:.4f},OK,{y:.6f}" if i % 40 else f"{t:.4f},ERR,0.0" for i, (t, y, _) in enumerate(values)
        ],
    }


@pytest.mark.parametrize(("name", "column"), [("value", "variable"), ("yaw", "sensor"), ("yaw", "status")])
def test_series_that_a_column_of_texts_distinguishes_are_not_one(
    name: str, column: str, tmp_path: Path
) -> None:
    head = f"t,{column},{name}"
    path = written(tmp_path, "log.csv", "\n".join([head, *tidy(*decay())[head]]))
    with pytest.raises(TunnelError, match=f"'{name}' holds 2 series, by the column '{column}'"):
        read_records([path])


def test_texts_beside_one_series_distinguish_none(tmp_path: Path) -> None:
    time, angle = decay()
    rows = [
        f"{'TRUE' if i % 7 else 'FALSE'},{t:.3f},{y:.8f}"
        for i, (t, y) in enumerate(zip(time, angle, strict=True))
    ]
    (run,) = read_records([written(tmp_path, "a.csv", "\n".join(["valid,t,yaw", *rows]))]).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, angle, atol=1e-8)
    rows = [f"E{k},{t:.3f},{y:.8f}" for k in (1, 2, 3) for t, y in zip(*decay(k), strict=True)]
    path = written(tmp_path, "b.csv", "\n".join(["experiment,t,yaw", *rows]))
    assert len(read_records([path]).campaign.runs) == 3


@pytest.mark.parametrize(
    ("heading", "factors", "match"),
    [
        ("t [s],yaw [deg]", (1.0, 1.0), "'yaw' has another heading below the first one, 'yaw \\[deg\\]'"),
        ("t [ms],yaw [rad]", (1e3, 1.0), "'t' has another heading below the first one, 't \\[ms\\]'"),
        ("V = 10 m/s\nt [s],yaw [rad]", (1.0, 1.0), "'V' is left out: the file states several numbers"),
    ],
)
def test_another_heading_below_the_first_one_counts(
    heading: str, factors: tuple[float, float], match: str, tmp_path: Path
) -> None:
    time, angle = decay()
    below = [f"{factors[0] * t:.3f},{y:.8f}" for t, y in zip(*decay(2), strict=True)]
    above = [f"{t:.3f},{y:.8f}" for t, y in zip(time, angle, strict=True)]
    lines = ["V = 0 m/s", "t [s],yaw [rad]", *above, "", heading, *below]
    with pytest.raises(TunnelError, match=match):
        read_records([written(tmp_path, "log.csv", "\n".join(lines))])


@pytest.mark.parametrize("end", ["\r\r\n", "\n\n", "\r\n\r\n"])
def test_doubled_line_ends_are_one(end: str, tmp_path: Path) -> None:
    time, angle = decay()
    path = csv(tmp_path)
    path.write_bytes(path.read_bytes().replace(b"\n", end.encode()))
    (run,) = read_records([path]).campaign.runs
    np.testing.assert_allclose(run.record.time_s, time, atol=1e-9)
    only = written(tmp_path, "only.csv", end.join(["yaw [rad]", *(f"{y:.8f}" for y in angle)]))
    (run,) = read_records([only], ImportChoices(rate=RATE)).campaign.runs
    np.testing.assert_allclose(run.record.time_s, time, atol=1e-9)


def test_a_quote_ends_a_cell_only_before_a_delimiter() -> None:
    lines = [f'"{i}" 0.0{i} 0.3{i}' for i in range(9)]
    found = find_dialect(lines, ImportChoices())
    assert found is not None
    assert (found.delimiter, found.width) == (" ", 3)
    assert found.split(lines[1]) == ["1", "0.01", "0.31"]


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
