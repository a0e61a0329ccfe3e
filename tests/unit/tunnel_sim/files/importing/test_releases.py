"""Cutting of records: every candidate run by its own swings, the noise and the model of a free motion.

Truth: the pieces that the records are made of.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.marks import slow
from tests.support.import_files import written
from tests.support.logs import Log
from tunnel_lab.plotting.runs import import_picture
from tunnel_lab.report.import_table import parts_table
from tunnel_sim.files.importing.records import read_records
from tunnel_sim.files.importing.releases import RecordPiece, find_runs
from tunnel_sim.vocabulary.record import Array

SLOW_END = 0.05  # of the first swing: a run may end where its motion has fallen to it
EARLY, LATE = 0.05, 0.8  # cycles before and after the release in which a run may begin


def hand(log: Log, u: float) -> Log:
    return log.rest(4 * u).pull(0.35, 3 * u).hold(3 * u, 0.002).swing(0.35, 25 * u)


def two_releases(log: Log, u: float) -> Log:
    return hand(log, u).rest(3 * u).pull(0.2, 3 * u).hold(2 * u).swing(0.2, 25 * u)


def pulled_from_motion(log: Log, u: float) -> Log:
    log.pull(0.35, 3 * u).hold(1.2 * u).swing(0.35, 25 * u)
    return log.pull(0.35, 2 * u).hold(1.5 * u).swing(0.35, 25 * u)


def pulled_briefly(log: Log, u: float) -> Log:
    log.pull(0.35, 3 * u).hold(1.2 * u).swing(0.35, 15.3 * u)
    log.pull(0.3, 1.4 * u).hold(0.8 * u).swing(0.3, 15.3 * u)
    return log.pull(0.3, 1.4 * u).swing(0.3, 15.3 * u)


def faded(log: Log) -> float:
    return min(200.0, 4.6 / (2.0 * np.pi * log.zeta)) / log.frequency


def much_smaller(log: Log, u: float) -> Log:
    return log.rest(5 * u).swing(0.35, 1.5 * faded(log)).rest(6 * u).swing(0.0035, 25 * u)


def small_first(log: Log, u: float) -> Log:
    return log.rest(5 * u).swing(0.035, faded(log)).rest(6 * u).swing(0.35, 25 * u)


def knocked(log: Log, u: float) -> Log:
    log.rest(5 * u).swing(0.35, 4 * u, frequency=3.7 * log.frequency, zeta=0.1)
    return log.rest(8 * u).swing(0.035, 25 * u)


def tapped_at_rest(log: Log, u: float) -> Log:
    for speed in (0.2, 0.25, 0.18):
        log.rest(4 * u).tap(speed, faded(log))
    return log


def tapped_in_motion(log: Log, u: float) -> Log:
    return log.rest(3 * u).tap(0.1, 20 * u).tap(0.4, 20 * u).tap(1.5, 20 * u)


def long_tail(log: Log, u: float) -> Log:
    return log.rest(3 * u).swing(0.35, 1.7 * faded(log)).rest(40 * u)


def stopped(log: Log, u: float) -> Log:
    return log.pull(0.35, 2 * u).hold(2 * u).swing(0.35, 25 * u).rest(10 * u)


SESSIONS = (
    hand,
    two_releases,
    pulled_from_motion,
    pulled_briefly,
    much_smaller,
    small_first,
    knocked,
    tapped_at_rest,
    tapped_in_motion,
    long_tail,
    stopped,
)


def wrong(log: Log, found: list[RecordPiece]) -> str:
    """What is wrong with the runs found in a record; empty: nothing."""
    runs, cycle = [piece for piece in found if not piece.doubt], log.rate / log.frequency
    if len(runs) != len(log.free):
        return f"{len(runs)} runs instead of {len(log.free)}"
    for run, (first, last) in zip(runs, log.free, strict=True):
        left = np.exp(-log.zeta * 2.0 * np.pi * (last - first) / cycle)
        seen = first + min(1.0, np.log(SLOW_END) / min(np.log(left), -1e-9)) * (last - first)
        if not first - EARLY * cycle - 1 <= run.first <= first + LATE * cycle:
            return f"begins {(run.first - first) / cycle:.2f} cycles late"
        if run.last < seen - cycle or (left > 2.0 * SLOW_END and run.last > last + 0.1 * cycle + 1):
            return f"ends {(run.last - last) / cycle:.2f} cycles late"
    return ""


def faults(
    session: Callable[[Log, float], Log], noise: float, step: float, per_cycle: tuple[int, ...]
) -> Iterator[str]:
    for frequency in (0.7, 8.0):
        for samples in per_cycle:
            for zeta in (0.003, 0.012, 0.04):
                log = session(Log(samples * frequency, frequency, zeta), 1.0 / frequency)
                time, reading = log.reading(noise, step=step)
                if fault := wrong(log, find_runs(time, reading)):
                    yield f"{frequency} Hz, {samples} samples a cycle, zeta {zeta}: {fault}"


@pytest.mark.parametrize("session", SESSIONS)
def test_every_run_of_a_session_is_found_and_nothing_else(session: Callable[[Log, float], Log]) -> None:
    assert list(faults(session, 1e-4, 0.0, (40,))) == []


@pytest.mark.slow
@pytest.mark.parametrize("step", [0.0, 2.0 * np.pi / 16384])
@pytest.mark.parametrize("session", SESSIONS)
def test_every_run_is_found_at_any_rate_and_with_a_sensor_of_steps(
    session: Callable[[Log, float], Log], step: float
) -> None:
    assert list(faults(session, 2e-4, step, (12, 40, 200))) == []


def test_a_hold_is_not_part_of_a_run_even_if_it_trembles() -> None:
    for seed in range(12):
        log = Log(rate=1000.0, frequency=1.9, zeta=0.01).rest(1.0).pull(0.18, 1.0)
        log.hold(0.5 + 0.17 * seed, 0.001, seed).swing(0.18, 12.0)
        time, reading = log.reading(4e-4, seed, step=2.0 * np.pi / 16384)
        (run,) = find_runs(time, reading)
        assert -0.03 <= time[run.first] - time[log.free[0][0]] <= 0.3, seed


def test_a_motion_of_something_else_is_marked_and_left_out(tmp_path: Path) -> None:
    log = Log().rest(2.0).swing(0.3, 3.0, frequency=12.0, zeta=0.02).rest(3.0).swing(0.1, 15.0)
    rows = "".join(f"{t:.3f},{y:.8f}\n" for t, y in zip(*log.reading(), strict=True))
    imported = read_records([written(tmp_path, "day.csv", "time_s,yaw_rad\n" + rows)])
    assert [run.id for run in imported.campaign.runs] == ["day"]
    assert any("day-other-1: left out: it swings at 12 Hz" in line for line in imported.remarks())
    assert ("day-other-1", "left out") in [(row[0], row[2]) for row in parts_table(imported).rows]
    assert import_picture(imported).startswith(b"\x89PNG")


def test_a_stopped_run_and_a_late_start_are_said(tmp_path: Path) -> None:
    log = Log(frequency=2.0).rest(1.0).pull(0.35, 1.0).hold(0.6).swing(0.35, 10.0).rest(4.0)
    rows = "".join(f"{t:.3f},{y:.8f}\n" for t, y in zip(*log.reading(), strict=True))
    imported = read_records([written(tmp_path, "day.csv", "time_s,yaw_rad\n" + rows)])
    said = "ends at 12.595 s, where something stops or pushes the body"
    assert any(said in line for line in imported.remarks())


@pytest.mark.parametrize("zeta", [0.003, 0.006, 0.012])
def test_a_run_ends_at_a_push_that_enlarges_its_swings(zeta: float) -> None:
    """Twelve cycles, a push, and the rest of the motion, between two whole runs."""
    for push in (1.75, 1.9):
        log = Log(frequency=2.0, zeta=zeta)
        log.pull(0.35, 1.0).hold(1.0).swing(0.35, 15.0)
        log.pull(0.35, 1.0).hold(1.0).swing(0.35, 6.0)
        left = 0.35 * np.exp(-zeta * 4.0 * np.pi * 6.0)
        log.swing(push * left, 9.0)
        log.free.pop()
        log.pull(0.2, 1.0).hold(1.0).swing(0.2, 15.0)
        time, reading = log.reading(2e-4)
        pieces = find_runs(time, reading)
        assert wrong(log, pieces) == "", push
        assert [piece.stopped for piece in pieces] == [False, True, False]


def random_motion(rng: np.random.Generator, zeta: float, size: int) -> Array:
    """A random moment's motion at 40 samples a cycle, in standard deviations."""
    a, w = zeta * 2.0 * np.pi / 40.0, 2.0 * np.pi / 40.0
    white, motion = rng.standard_normal(size), np.zeros(size)
    for k in range(2, size):
        motion[k] = 2.0 * np.exp(-a) * np.cos(w) * motion[k - 1] - np.exp(-2.0 * a) * motion[k - 2] + white[k]
    return motion / motion.std()


@pytest.mark.parametrize("zeta", [slow(0.01), 0.05])
def test_random_motion_is_one_record_and_no_run_begins_in_it(zeta: float) -> None:
    """A pause and a growth by chance are rare, but possible: one of 24 records may be cut."""
    cut = 0
    for seed in range(12):
        ambient = random_motion(np.random.default_rng([11, seed]), zeta, 6000)
        time = np.arange(ambient.size) / 80.0
        free = np.exp(-0.25 * time) * np.cos(4.0 * np.pi * time)
        for reading in (ambient, free + 0.03 * ambient):
            pieces = find_runs(time, reading)
            cut += len(pieces) > 1 or pieces[0].first > 0
    assert cut <= 1


@pytest.mark.parametrize("seed", [27, 29, 37, 45, 50, 54, 58, 59, 90])
def test_a_pull_to_the_next_hold_between_two_samples_loses_no_release(seed: int) -> None:
    """A logger that pauses while the hand moves the body; the pull looks like a swing of half its size."""
    rng, rate, step = np.random.default_rng([9, seed]), 500.0, np.deg2rad(0.01)
    time = np.arange(12000) / rate
    swing = np.exp(-0.0115 * 20.6 * time) * np.cos(20.6 * time)
    parts = [
        part for a in (0.3, 0.2) for part in (np.full(round(rng.uniform(2.0, 3.5) * rate), a), a * swing)
    ]
    yaw = np.concatenate(parts) + 0.007
    yaw = np.round((yaw + 3.5e-4 * rng.standard_normal(yaw.size)) / step) * step
    assert len(find_runs(np.arange(yaw.size) / rate, yaw)) == 2


def test_late_starts_of_several_runs_are_one_line_beside_the_table(tmp_path: Path) -> None:
    for name in ("a", "b", "c"):
        log = Log(frequency=2.0).rest(1.0).pull(0.35, 1.0).hold(0.63, 0.004).swing(0.35, 10.0)
        rows = "".join(f"{t:.3f},{y:.8f}\n" for t, y in zip(*log.reading(), strict=True))
        written(tmp_path, f"{name}.csv", "time_s,yaw_rad\n" + rows)
    imported = read_records(sorted(tmp_path.glob("*.csv")))
    _, judged = imported.summary()
    late = [line for line in judged if "from where on the motion is free" in line]
    assert len(late) == 1
    assert "--start RUN=SECONDS" in late[0]
    assert any("--start b=SECONDS" in line for line in imported.remarks())
