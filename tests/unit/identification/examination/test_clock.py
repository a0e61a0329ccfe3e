"""The clock behind rounded stamps is found; uneven stamps are left as they are; missing samples are counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.examination.examine import examine, find_clock, with_clocks
from identification.status import Outcome
from tests.support.decays import campaign, grid, run
from tunnel_sim.vocabulary.campaign import SensorProperties
from tunnel_sim.vocabulary.record import Record, evenly_spaced


def at(one, time, keep=slice(None)):
    return replace(one, record=Record(time[keep], one.record.yaw_rad[: time.size][keep]))


@pytest.mark.parametrize("interval", [0.01004, 1.0 / 30.0, 0.0023])
@pytest.mark.parametrize("cut_off", [False, True])
def test_the_clock_behind_stamps_of_whole_milliseconds(interval, cut_off):
    true = 17.3 + interval * np.arange(4000)
    stamps = np.floor(true * 1e3) / 1e3 if cut_off else np.round(true, 3)
    found = find_clock(stamps)
    assert found is not None
    assert found.interval == pytest.approx(interval, rel=1e-6)
    assert found.missing == 0
    late = found.time - true
    assert np.ptp(late) < 5e-5
    assert -1e-3 * cut_off < late.mean() < 1e-5  # cutting off moves all samples alike


@pytest.mark.parametrize("decimals", [None, 7, 6])
@pytest.mark.parametrize("tick", [0.000249226, 0.000461434, 1.0 / 4096.0])
def test_the_clock_behind_stamps_of_a_timer(tick, decimals):
    """A timer's ticks need be no decimals."""
    true = 17.3 + 0.001 * np.arange(4000)
    stamps = tick * np.round(true / tick)
    found = find_clock(stamps if decimals is None else np.round(stamps, decimals))
    assert found is not None
    assert found.interval == pytest.approx(0.001, rel=1e-6)
    assert found.missing == 0


def test_uneven_samples_on_a_timer_have_no_clock():
    ticks = np.random.default_rng(4).integers(2, 7, 4000)
    assert find_clock(0.000249226 * np.cumsum(ticks)) is None


def test_missing_samples_do_not_hide_the_clock():
    interval, place = 0.01004, np.delete(np.arange(4000), [*range(700, 760), 2000, 3001])
    found = find_clock(np.round(interval * place, 3))
    assert found is not None
    assert found.missing == 62
    np.testing.assert_array_equal(found.place, place)
    assert found.interval == pytest.approx(interval, rel=1e-6)


@pytest.mark.parametrize("share", [0.05, 0.3, 0.9])
def test_jitter_is_no_rounding(share):
    rng = np.random.default_rng(1)
    steps = 0.002 * (1.0 + share * rng.uniform(-1.0, 1.0, 3000))
    assert find_clock(np.cumsum(steps)) is None


def test_a_clock_that_gains_is_taken_as_it_is():
    """Every step is within a thousandth of the others, and yet the last sample is off by half a step."""
    time = np.cumsum(0.002 * (1.0 + 1e-3 * np.linspace(0.0, 1.0, 5000)))
    assert not Record(time, time).uniform
    assert find_clock(time) is None


def test_rounded_stamps_are_replaced_and_said():
    one = run("a", 16.0, 0.0)
    true = 0.00213 * np.arange(4000)
    data = campaign([at(one, np.round(true, 3)), run("b", 35.0, 0.0)])
    kept, (remark,) = with_clocks(replace(data, sensor=SensorProperties()))
    np.testing.assert_allclose(kept.runs[0].record.time_s, true, atol=3e-5)
    assert kept.runs[1] is data.runs[1]
    assert (remark.outcome, remark.runs) == (Outcome.NOTED, ("a",))
    assert "2.13 ms" in remark.what


def test_uneven_stamps_are_kept_and_said():
    one = run("a", 16.0, 0.0)
    time = one.record.time_s + 0.0008 * np.sin(np.arange(one.record.time_s.size) ** 2)
    data = campaign([at(one, time)])
    kept, (remark,) = with_clocks(data)
    assert kept is data
    assert "not evenly spaced" in remark.what


def test_missing_samples_are_counted_and_said():
    one = run("a", 16.0, 0.0)
    keep = np.ones(one.record.time_s.size, bool)
    keep[1000:1025] = keep[3000] = False
    data = campaign([at(one, one.record.time_s, keep)])
    kept, (remark,) = with_clocks(data)
    assert kept is data
    assert "26 samples missing, up to 0.05 s" in remark.what


def test_even_records_pass_untouched():
    data = grid()
    assert with_clocks(data) == (data, ())
    assert evenly_spaced(data.runs[0].record) is data.runs[0].record


def test_resampling_follows_the_motion():
    rng = np.random.default_rng(2)
    time = np.cumsum(0.01 * (1.0 + 0.5 * rng.uniform(-1.0, 1.0, 900)))
    even = evenly_spaced(Record(time, np.sin(5.0 * time)))
    assert even.uniform
    assert even.time_s[[0, -1]].tolist() == time[[0, -1]].tolist()
    assert np.abs(even.yaw_rad - np.sin(5.0 * even.time_s)).max() < 5e-4


def test_an_angle_beyond_half_a_turn_is_noted():
    wide = run("a", 16.0, 0.0, angle=4.0)
    (remark,) = examine(campaign([wide])).remarks
    assert (remark.outcome, remark.runs) == (Outcome.NOTED, ("a",))
    assert "yaw_deg" in remark.remedy
    meant = replace(campaign([wide]), sensor=SensorProperties(plausible=False))
    assert examine(meant).remarks == ()
