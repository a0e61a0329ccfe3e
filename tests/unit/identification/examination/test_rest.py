"""A long rest beside the centre is cut off and said; every other end of a record stays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification import identify
from identification.examination.free_motion import without_rest
from identification.status import Outcome
from tests.support.decays import NOISE, campaign, reading, run

RATE, DEAD, OMEGA = 500.0, 0.011, 12.6


def ending_beside(seconds):
    """A dry-friction decay about 0.1 rad and its rest of so many seconds, both with noise."""
    swing, side, parts = 0.35, 1.0, []
    while swing > DEAD:
        clock = np.arange(round(np.pi / OMEGA * RATE)) / RATE
        parts.append(side * (DEAD + (swing - DEAD) * np.cos(OMEGA * clock)))
        swing, side = swing - 2.0 * DEAD, -side
    motion = np.concatenate(parts)
    yaw = np.concatenate([motion, np.full(round(seconds * RATE), side * swing)]) + 0.1
    noise = np.random.default_rng(7).normal(0.0, NOISE, yaw.size)
    return campaign([reading(run("a", 16.0, 0.0), yaw + noise)]), motion.size / RATE


def test_a_long_rest_beside_the_centre_is_cut_off_and_said():
    data, moved = ending_beside(30.0)
    kept, (remark,) = without_rest(data)
    assert (remark.outcome, remark.runs) == (Outcome.CUT, ("a",))
    assert "from the centre of the motion" in remark.what
    assert kept.runs[0].record.duration == pytest.approx(moved + 3.0 * 2.0 * np.pi / OMEGA, abs=0.3)
    assert abs(identify(data).runs[0].sensor_zero.value - 0.1) < 0.002


def test_a_rest_shorter_than_the_motion_stays():
    data, _ = ending_beside(2.0)
    assert without_rest(data) == (data, ())


@pytest.mark.parametrize("drift", [0.0, 0.01])
def test_a_viscous_decay_that_ends_in_noise_stays(drift):
    one = run("a", 16.0, 0.0)
    time = np.arange(20_000) / RATE
    yaw = 0.35 * np.exp(-0.6 * time) * np.cos(12.6 * time) + drift * time / time[-1]
    noise = np.random.default_rng(8).normal(0.0, NOISE, time.size)
    data = campaign([reading(one, yaw + noise)])
    assert without_rest(data) == (data, ())
    clean = campaign([reading(one, yaw)])
    assert without_rest(replace(clean)) == (clean, ())
