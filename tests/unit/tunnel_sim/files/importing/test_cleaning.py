"""Clean-up and cutting of records: nothing is changed silently, and nothing is cut from a free decay.

Truth: closed-form decays, and what a hand or a logger was made to do to them.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.support.import_files import RATE, decay, written
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.cleaning import cleaned, clipped, clock_text, from_zero, resolution, restarts
from tunnel_sim.files.importing.column_numbers import guessed_angle_unit, without_codes, without_overflow
from tunnel_sim.files.importing.records import read_records
from tunnel_sim.files.importing.releases import RecordPiece, find_runs, find_runs_of_rate
from tunnel_sim.files.importing.tables import Channel
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array


def held(angle: float, seconds: float) -> np.ndarray:
    return np.full(round(seconds * RATE), angle)


def pulled(to: float, seconds: float) -> np.ndarray:
    return np.linspace(0.0, to, round(seconds * RATE))


def uniform(reading: np.ndarray) -> np.ndarray:
    return np.arange(reading.size) / RATE


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize(("find", "stream", "logarithm"), [(find_runs, 7, 5.0), (find_runs_of_rate, 8, 4.0)])
def test_a_free_decay_of_angles_or_rates_is_not_cut(
    seed: int, find: Callable[[Array, Array], list[RecordPiece]], stream: int, logarithm: float
) -> None:
    """It may end where the motion has fallen to e to the minus ``logarithm``."""
    rng = np.random.default_rng([stream, seed])
    time = np.arange(round(rng.uniform(8.0, 40.0) * RATE)) / RATE
    phase, zeta = rng.uniform(0.0, 2.0 * np.pi), 10.0 ** rng.uniform(-3.0, -1.3)
    omega = 2.0 * np.pi * rng.uniform(0.5, 4.0)
    values = np.exp(-zeta * omega * time) * np.cos(omega * time + phase) + rng.uniform(-0.05, 0.05)
    values += rng.choice([1e-4, 1e-2, 0.1]) * rng.standard_normal(time.size)
    (piece,) = find(time, values)
    assert piece.first == 0
    assert piece.last == time.size or zeta * omega * time[-1] > logarithm


@pytest.mark.parametrize("hold", [0.0, 2.0])
@pytest.mark.parametrize("bias", [0.0, 0.02])
@pytest.mark.parametrize("seed", range(5))
def test_the_hand_before_a_release_is_cut_off_a_record_of_rates(hold: float, bias: float, seed: int) -> None:
    rng = np.random.default_rng([9, seed])
    time = np.arange(round(40.0 * RATE)) / RATE
    free = -0.35 * 4.0 * np.pi * np.exp(-0.15 * time) * np.sin(4.0 * np.pi * time)
    pull, steady = np.full(round(RATE), 0.35), 0.02 * rng.standard_normal(round(hold * RATE))
    shaking = 0.3 * np.sin(2.0 * np.pi * 3.0 * np.arange(pull.size) / RATE) * np.hanning(pull.size)
    before = np.concatenate([held(0.0, 1.0), pull + shaking, steady])
    rate = np.concatenate([before, free]) + bias
    rate += 2e-3 * rng.standard_normal(rate.size)
    (piece,) = find_runs_of_rate(uniform(rate), rate)
    # A quarter of a cycle of 0.5 s after the release, and never before it.
    assert (piece.first - before.size) / RATE == pytest.approx(0.125, abs=0.03)
    assert piece.last > before.size + 18.0 * RATE


def test_an_imported_record_of_rates_begins_after_the_hand(tmp_path: Path) -> None:
    time = np.arange(round(30.0 * RATE)) / RATE
    free = -0.35 * 4.0 * np.pi * np.exp(-0.15 * time) * np.sin(4.0 * np.pi * time)
    before = np.concatenate([held(0.0, 1.0), np.full(round(2.0 * RATE), 0.175), held(0.0, 1.0)])
    rate = np.concatenate([before, free]) + 1e-3 * np.random.default_rng(1).standard_normal(
        before.size + free.size
    )
    rows = "".join(f"{t:.3f},{y:.8f}\n" for t, y in zip(uniform(rate), rate, strict=True))
    imported = read_records([written(tmp_path, "imu.csv", "time_s,yaw_rate_rad_s\n" + rows)])
    (run,) = imported.campaign.runs
    assert run.record.time_s[-1] == pytest.approx(29.87, abs=0.1)
    assert any("at the largest rate after the release" in line for line in imported.remarks())


def test_growing_motion_is_left_whole() -> None:
    time = np.arange(4000) / RATE
    angle = 0.3 * np.tanh(1e-3 * np.exp(0.5 * time)) * np.cos(12.0 * time)
    (piece,) = find_runs(time, angle)
    assert (piece.first, piece.last) == (0, time.size)


@pytest.mark.parametrize("hold", [0.0, 2.0])
def test_the_pull_of_a_hand_is_cut_off(hold: float) -> None:
    _, free = decay()
    before = np.concatenate([held(0.0, 1.0), pulled(0.35, 1.0), held(0.35, hold)])
    reading = np.concatenate([before, free])
    (piece,) = find_runs(uniform(reading), reading)
    assert abs(piece.first - before.size) <= 4
    assert piece.last == reading.size


def test_runs_one_after_another_are_separated(tmp_path: Path) -> None:
    parts, begins = [], []
    for seed, amplitude in ((1, 0.35), (2, 0.3), (3, -0.35)):
        parts += [held(0.0, 1.5), pulled(amplitude, 1.2), held(amplitude, 0.8)]
        begins.append(sum(part.size for part in parts))
        parts.append(decay(seed, duration=20.0, amplitude=amplitude)[1])
    reading = np.concatenate(parts)
    rows = "".join(f"{t:.3f},{y:.8f}\n" for t, y in zip(uniform(reading), reading, strict=True))
    path = written(tmp_path, "day.csv", "time_s,yaw_rad\n" + rows)
    imported = read_records([path])
    assert [run.id for run in imported.campaign.runs] == ["day-1", "day-2", "day-3"]
    assert [part.piece.first for part in imported.parts] == pytest.approx(begins, abs=6)
    for part, following in zip(imported.parts, [*begins[1:], reading.size + 700], strict=True):
        assert part.piece.last <= following - 2.0 * RATE  # the hand's pull belongs to no run
        assert part.piece.last - part.piece.first > 18.0 * RATE
    (whole,) = read_records([path], ImportChoices(cut=False)).campaign.runs
    assert whole.record.time_s.size == reading.size


def test_a_rest_longer_than_the_motion_is_shortened() -> None:
    _, free = decay(duration=20.0)
    reading = np.concatenate([free, held(0.0, 200.0)])
    (piece,) = find_runs(uniform(reading), reading)
    assert 30.0 * RATE < piece.last < 60.0 * RATE


def test_missing_rows_disorder_and_repeats_are_said() -> None:
    time, angle = decay()
    reading = angle.copy()
    reading[700] = np.nan
    order = np.concatenate([np.arange(100, 800), np.arange(100), np.arange(790, time.size)])
    found = cleaned(time[order] + 5.0, reading[order])
    assert found.time_s.size == time.size - 1
    np.testing.assert_allclose(found.time_s, np.delete(time, 700), atol=1e-12)
    np.testing.assert_array_equal(found.reading, np.delete(angle, 700))
    said = "; ".join(found.remarks)
    for part in (
        "1 sample without a number",
        "sorted by time",
        "10 repeated samples",
        "at 5 s",
        "1 sample missing in 1 gap, ",
    ):
        assert part in said


def test_stamps_coarser_than_the_sampling_are_spread() -> None:
    time, angle = decay()
    found = cleaned(np.floor(time * 50.0) / 50.0, angle)
    assert found.time_s.size == time.size
    assert "coarser than the sampling" in "; ".join(found.remarks)
    assert np.abs(found.time_s - time).max() <= 0.02


@pytest.mark.parametrize("start", [0.0, 0.6])
@pytest.mark.parametrize("stamp", [0.1, 1.0])
def test_the_rate_of_coarse_stamps_is_that_of_the_whole_ones(stamp: float, start: float) -> None:
    """The first and the last second of a clock that shows seconds have fewer samples."""
    time, angle = decay()
    clock = np.floor((time + start * stamp) / stamp + 1e-9) * stamp
    found = cleaned(clock, angle)
    np.testing.assert_allclose(found.time_s, time, rtol=2e-3, atol=1e-9)


@pytest.mark.parametrize("series", [2, 3])
def test_series_whose_rows_alternate_are_not_one_reading(series: int) -> None:
    time, angle = decay()
    rate = np.gradient(angle, time)
    both = np.stack([angle, rate, angle + 0.05][:series], axis=1).ravel()
    with pytest.raises(TunnelError, match=f"every time has {series} rows") as refused:
        cleaned(np.repeat(time, series), both)
    assert "a column or a file of its own" in refused.value.remedy
    noisy = angle + 0.02 * np.random.default_rng(1).standard_normal(angle.size)
    assert cleaned(np.repeat(time[::series], series)[: time.size], noisy).time_s.size == time.size


def test_uneven_stamps_are_kept_and_said() -> None:
    time, angle = decay()
    uneven = cleaned(time + 4e-4 * np.sin(np.arange(time.size)), angle)
    assert "differ from an even clock by up to" in "; ".join(uneven.remarks)
    np.testing.assert_allclose(uneven.time_s, time + 4e-4 * np.sin(np.arange(time.size)), atol=1e-8)


def test_times_count_from_the_first_sample_to_a_millionth_of_a_step() -> None:
    time = np.cumsum(np.random.default_rng(1).uniform(4e-3, 6e-3, 50))
    time -= time[0]
    assert np.array_equal(from_zero(time), time)
    for start in (-3.0, 1.7e9 / 1024.0):
        moved = from_zero(time + start)
        assert moved[0] == 0.0
        assert np.abs(moved - time).max() < 1e-6 * 5e-3
    even = 0.005 * np.arange(50)
    assert np.array_equal(from_zero(even + 0.3), np.round(even, 9))  # no digits of the subtraction
    assert np.array_equal(from_zero(np.array([4.0])), [4.0])


@pytest.mark.parametrize("full", [2.0 * np.pi, 360.0, 65536.0])
def test_overflow_is_taken_out(full: float) -> None:
    angle = 0.4 * full * np.cos(np.arange(2000) / 40.0) + 0.9 * full
    if full == 65536.0:
        angle = np.round(angle)
    found, said = without_overflow(np.mod(angle, full))
    np.testing.assert_allclose(found - found[0], angle - angle[0], atol=1e-9 * full)
    assert "overflow" in said[0]


@pytest.mark.parametrize(
    ("heading", "full", "choices"),
    [
        ("angle [rev]", 1.0, ImportChoices()),
        ("angle [gon]", 400.0, ImportChoices()),
        ("angle [mrad]", 2000.0 * np.pi, ImportChoices()),
        ("encoder [counts]", 4000.0, ImportChoices(counts_per_turn=4000.0)),
        ("sensor [V]", 5.0, ImportChoices(calibration="72*V", unit="deg")),
        ("sensor [V]", 5.0, ImportChoices(calibration="72*V")),
    ],
)
def test_a_turn_has_the_length_that_it_has_in_its_unit(
    heading: str, full: float, choices: ImportChoices, tmp_path: Path
) -> None:
    time, angle = decay()
    turned = np.mod((angle + 0.1) / (2.0 * np.pi) * full, full)
    turned = np.round(turned) if choices.counts_per_turn else turned
    rows = "".join(f"{t:.3f},{y:.8f}\n" for t, y in zip(time, turned, strict=True))
    (run,) = read_records([written(tmp_path, "a.csv", f"time [s],{heading}\n{rows}")], choices).campaign.runs
    error = 1e-3 if choices.counts_per_turn else 1e-6
    np.testing.assert_allclose(run.record.yaw_rad - run.record.yaw_rad[0], angle - angle[0], atol=2 * error)


@pytest.mark.parametrize("heading", ["yaw", "yaw [rad]", "x [mm]", "encoder [counts]"])
def test_a_code_for_a_missing_reading_is_none(heading: str, tmp_path: Path) -> None:
    time, angle = decay()
    values = np.round(angle * 4096.0 / (2.0 * np.pi)) if "counts" in heading else angle
    values[50::97], values[60::97] = -9999.0, 9.91e37
    rows = "".join(f"{t:.3f},{y:.8g}\n" for t, y in zip(time, values, strict=True))
    path = written(tmp_path, "a.csv", f"time [s],{heading}\n{rows}")
    counts = 4096.0 if "counts" in heading else None
    imported = read_records([path], ImportChoices(counts_per_turn=counts))
    (run,) = imported.campaign.runs
    assert np.abs(run.record.yaw_rad).max() < 0.4
    assert run.record.time_s.size == time.size - values[50::97].size - values[60::97].size
    said = "; ".join(imported.remarks())
    assert "readings of -9999, far from all others, taken as missing" in said
    assert "readings of 9.91e+37, far from" in said


def test_one_reading_far_from_all_others_does_not_change_the_unit() -> None:
    _, angle = decay()
    angle[700] = 8.2
    assert guessed_angle_unit(angle)[0] == "rad"
    found, said = without_codes(angle)
    assert found is angle
    assert said == []


def test_what_does_not_overflow_is_not_touched() -> None:
    square = np.where(np.arange(2000) // 10 % 2, 300.0, 0.0)
    for reading in (3.0 * np.cos(np.arange(2000) / 40.0), square):
        found, said = without_overflow(reading)
        assert found is reading
        assert said == []


def test_a_clock_that_starts_anew_begins_another_run(tmp_path: Path) -> None:
    time, angle = decay()
    rows = "".join(f"{t:.3f},{y:.8f}\n" for seed in (1, 2) for t, y in zip(*decay(seed), strict=True))
    runs = read_records([written(tmp_path, "two.csv", "time_s,yaw_rad\n" + rows)]).campaign.runs
    assert [run.id for run in runs] == ["two-1", "two-2"]
    np.testing.assert_allclose(runs[0].record.yaw_rad, angle, atol=1e-8)
    shuffled = np.random.default_rng(1).permutation(time)
    assert restarts(shuffled, time) == []


BETWEEN = {
    "blank line": "\n",
    "repeated heading": "time_s,yaw_rad\n",
    "boot lines": "Boot v1.2\nIMU ok\ntime_s,yaw_rad\n",
    "comment": "# second run\n",
    "row of nan": "nan,nan\n",
    "heading with numbers": "Samples,3000\nX0,0.0E+0\ntime_s,yaw_rad\n",
    "missing reading": "0.0,\n",
    "half a row": ",0.35\n",
}


@pytest.mark.parametrize("row", BETWEEN)
def test_a_row_that_is_not_a_number_does_not_hide_another_run(tmp_path: Path, row: str) -> None:
    """Three runs of different lengths and damping, each from zero on by the clock."""
    lengths = (8.0, 5.0, 11.0)
    texts = [
        "".join(f"{t:.3f},{y:.8f}\n" for t, y in zip(*decay(seed, duration=length), strict=True))
        for seed, length in enumerate(lengths)
    ]
    path = written(tmp_path, "log.csv", "time_s,yaw_rad\n" + BETWEEN[row].join(texts))
    runs = read_records([path]).campaign.runs
    assert [run.record.duration for run in runs] == pytest.approx(lengths, abs=0.02)
    for seed, (run, length) in enumerate(zip(runs, lengths, strict=True)):
        angle = decay(seed, duration=length)[1]
        np.testing.assert_allclose(run.record.yaw_rad[-900:], angle[-900:], atol=1e-8)


@pytest.mark.parametrize("row", ["nan,nan\n", "\n", "# note\n", "3.5,\n"])
def test_a_missing_row_within_a_run_leaves_one_run(tmp_path: Path, row: str) -> None:
    time, angle = decay()
    lines = [f"{t:.3f},{y:.8f}\n" for t, y in zip(time, angle, strict=True)]
    lines[700] = row
    (run,) = read_records([written(tmp_path, "log.csv", "time_s,yaw_rad\n" + "".join(lines))]).campaign.runs
    np.testing.assert_allclose(run.record.time_s, np.delete(time, 700), atol=1e-9)


def test_rows_of_several_runs_are_never_sorted_into_one() -> None:
    time, angle = decay()
    late = np.concatenate([time, time + 3.0])  # the second clock starts within the first run's times
    assert restarts(late, np.concatenate([angle, angle])) == [time.size]
    shuffled = np.random.default_rng(1).permutation(late.size)
    both = np.concatenate([angle, decay(2, amplitude=0.2)[1]])
    with pytest.raises(TunnelError, match="rows are out of order"):
        cleaned(late[shuffled], both[shuffled])
    offset = np.concatenate([time, time + 0.5 / RATE])[shuffled]  # an even clock at twice the rate
    with pytest.raises(TunnelError, match="rows are out of order"):
        cleaned(offset, both[shuffled])


def test_a_clock_that_is_set_back_ends_a_run_unless_it_repeats_rows() -> None:
    time, angle = decay()
    back = np.where(time < 4.0, time, np.round(time - 0.8, 9))  # onto stamps of the first part
    assert restarts(back, angle) == [800]
    again = np.concatenate([time[:800], time[640:]])
    assert restarts(again, np.concatenate([angle[:800], angle[640:]])) == []


def test_rows_of_one_run_are_sorted_however_mixed_up() -> None:
    time, angle = decay()
    shuffled = np.random.default_rng(1).permutation(time.size)
    found = cleaned(time[shuffled], angle[shuffled])
    np.testing.assert_array_equal(found.reading, angle)
    assert "sorted" in "; ".join(found.remarks)


def test_rows_from_the_last_to_the_first_are_one_record() -> None:
    time, angle = decay()
    uneven = time + 1e-3 * np.random.default_rng(1).random(time.size)
    found = cleaned(uneven[::-1], angle[::-1])
    np.testing.assert_array_equal(found.reading, angle)
    np.testing.assert_allclose(found.time_s, uneven - uneven[0], atol=1e-8)
    coarse = cleaned(np.floor(time[::-1] * 50.0) / 50.0, angle[::-1])
    np.testing.assert_array_equal(coarse.reading, angle)
    assert np.abs(coarse.time_s - time).max() <= 0.02


def test_coarse_stamps_are_not_spread_across_a_gap() -> None:
    time, angle = decay()
    kept = (time < 3.0) | (time >= 5.0)
    found = cleaned((np.floor(time * 50.0) / 50.0)[kept], angle[kept])
    assert np.abs(found.time_s - time[kept]).max() <= 0.02
    angle[300] = np.nan  # a missing row keeps its place
    found = cleaned(np.floor(time * 50.0) / 50.0, angle)
    assert np.abs(found.time_s - np.delete(time, 300)).max() <= 0.02


@pytest.mark.parametrize("step", [0.0, 2.0 * np.pi / 4096.0])
def test_peaks_that_a_sensor_cuts_off_are_recognised(step: float) -> None:
    _, angle = decay(duration=20.0)
    rounded = angle if step == 0.0 else step * np.round(angle / step)
    assert clipped(rounded) == []
    (low, below), (high, above) = sorted(clipped(np.clip(rounded, -0.2, 0.25)), key=lambda limit: limit[0])
    assert (low, high) == (-0.2, 0.25)
    assert above.size == np.count_nonzero(rounded >= 0.25)
    assert below.size == np.count_nonzero(rounded <= -0.2)


def test_the_step_of_a_sensor_is_found() -> None:
    _, angle = decay(duration=20.0)
    step = 2.0 * np.pi / 4000.0
    levels = step * np.round(angle / step)
    assert resolution([levels]) == pytest.approx(step, rel=1e-6)
    assert resolution([np.round(levels, 5)]) == pytest.approx(step, rel=1e-3)
    assert resolution([angle]) is None


def test_samples_outside_start_and_end_are_left_out(tmp_path: Path) -> None:
    time, angle = decay()
    rows = "".join(f"{t:.3f},{y:.8f}\n" for t, y in zip(time + 10.0, angle, strict=True))
    path = written(tmp_path, "a.csv", "time_s,yaw_rad\n" + rows)
    (run,) = read_records([path], ImportChoices(start=10.5, end=15.0)).campaign.runs
    inside = (time >= 0.4999) & (time <= 5.0001)
    np.testing.assert_allclose(run.record.yaw_rad, angle[inside], atol=1e-8)
    assert run.record.time_s[0] == 0.0


def test_a_signalling_nan_of_a_damaged_file_does_not_hide_the_numbers_beside_it():
    values = np.full(172, np.nan)
    values[::3] = np.linspace(-1.0, 2.0, values[::3].size)
    values.view(np.uint64)[1::3] = 0x7FF0000000000001  # signalling
    quiet = Channel("angle", values).values
    assert (np.nanmin(quiet), np.nanmax(quiet)) == (-1.0, 2.0)
    assert set(quiet.view(np.uint64)[1::3].tolist()) == {int(np.array(np.nan).view(np.uint64))}


def test_readings_that_all_have_the_same_stamp_are_refused(tmp_path: Path) -> None:
    yaw = 0.3 * np.cos(np.linspace(0.0, 60.0, 400))
    text = "time_s,yaw_rad\n" + "".join(f"1e+300,{value:.8f}\n" for value in yaw)
    with pytest.raises(TunnelError, match="'yaw' holds no number where the file states a time"):
        read_records([written(tmp_path, "stuck.csv", text)])


@pytest.mark.parametrize(
    ("time", "text"), [(-1e-9, "0"), (34200.0, "34200"), (14.275, "14.275"), (-2.5, "-2.5")]
)
def test_a_time_is_written_to_a_millisecond(time: float, text: str) -> None:
    assert clock_text(time) == text
