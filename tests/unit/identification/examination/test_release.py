"""The release is found where it was planted, and nowhere in a record that starts with it."""

from __future__ import annotations

import numpy as np
import pytest

from identification.examination.examine import from_releases
from identification.examination.free_motion import find_release
from identification.status import Outcome
from tests.support.decays import ANGLE, NOISE, RATE, grid, reading, run
from tunnel_sim.vocabulary.campaign import SensorProperties
from tunnel_sim.vocabulary.record import Record

HELD = int(3.0 * RATE)
BEFORE = {
    "held still": np.full(HELD, ANGLE),
    "led there slowly": ANGLE * np.linspace(0.0, 1.0, HELD),
    "led there from the other side": ANGLE * np.linspace(-0.9, 1.0, HELD),
    "let back slowly": ANGLE * np.linspace(1.05, 1.0, HELD),
    "at rest in the middle, then there at once": np.zeros(HELD),
    "at rest on the other side, then there at once": np.full(HELD, -0.4 * ANGLE),
}


@pytest.mark.parametrize("before", BEFORE.values(), ids=BEFORE)
@pytest.mark.parametrize("speed", [0.0, 25.0])
def test_what_lies_before_the_release_is_found(before, speed):
    free = run("r", 16.0, speed)
    noise = np.random.default_rng(1).normal(0.0, NOISE, HELD)
    found = find_release(
        reading(free, np.concatenate([before + 0.003 + noise, free.record.yaw_rad])).record,
        SensorProperties(),
    )
    assert abs(found - HELD) <= 0.006 * RATE


def test_records_that_start_with_the_release_are_the_very_same():
    data = grid()
    kept, remarks = from_releases(data)
    assert kept is data
    assert remarks == ()


@pytest.mark.parametrize("start", range(0, 700, 50))
def test_a_record_may_start_anywhere_in_the_swing(start):
    record = run("r", 16.0, 0.0).record
    assert find_release(Record(record.time_s[start:], record.yaw_rad[start:]), SensorProperties()) == 0


@pytest.mark.parametrize("cycles", [0.5, 0.6, 0.7])
@pytest.mark.parametrize("angle", [ANGLE, -ANGLE])
def test_a_hand_that_pulls_the_body_aside_is_known_by_its_slowness(cycles, angle):
    free = run("r", 16.0, 0.0, angle=angle)
    pull = np.arange(round(cycles * 2.0 * np.pi / np.sqrt(160.0) * RATE))
    before = angle * np.sin(0.5 * np.pi * pull / pull.size) + 0.003
    found = find_release(
        reading(free, np.concatenate([before, free.record.yaw_rad])).record, SensorProperties()
    )
    assert abs(found - pull.size) <= 0.02 * RATE


def test_the_release_is_found_at_uneven_times():
    free = run("r", 16.0, 0.0)
    held = reading(free, np.concatenate([np.full(HELD, free.record.yaw_rad[0]), free.record.yaw_rad])).record
    kept = np.random.default_rng(3).uniform(size=held.time_s.size) > 0.2
    uneven = Record(held.time_s[kept], held.yaw_rad[kept])
    found = find_release(uneven, SensorProperties())
    assert uneven.time_s[found] == pytest.approx(HELD / RATE, abs=0.006)


def test_a_plateau_of_a_clipping_sensor_is_no_hold():
    record = run("r", 16.0, 0.0).record
    clipped = Record(record.time_s, np.clip(record.yaw_rad, -0.2, 0.2))
    assert find_release(clipped, SensorProperties()) == 0


def test_motion_that_builds_up_has_no_release():
    time = np.arange(10_000) / RATE
    growing = 0.3 / (1.0 + np.exp(-(time - 12.0))) * np.cos(12.0 * time)
    noise = np.random.default_rng(2).normal(0.0, NOISE, time.size)
    assert find_release(Record(time, growing + noise), SensorProperties()) == 0


def test_the_remark_says_when_the_release_was():
    free = run("r", 16.0, 0.0)
    held = np.concatenate([np.full(HELD, free.record.yaw_rad[0]), free.record.yaw_rad])
    data = grid()
    kept, (remark,) = from_releases(type(data)(data.name, data.rig, data.sensor, (reading(free, held),)))
    assert remark.outcome is Outcome.CUT
    assert remark.what.startswith("release found at 3.00")
    assert kept.runs[0].record.time_s[0] == pytest.approx(3.0, abs=0.005)
