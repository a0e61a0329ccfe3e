"""Columns with clocks of their own are aligned by the times that the file states, or refused.

Truth: the response to a known moment, sampled on the clock of each column.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timedelta
from functools import cache
from pathlib import Path
from typing import Any

import nptdms
import numpy as np
import pytest
from scipy.integrate import OdeSolution, solve_ivp

from tunnel_sim import TunnelError
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.records import Imported, read_records
from tunnel_sim.vocabulary.record import Array

RATE, END = 200.0, 20.0
START = datetime(2024, 3, 5, 10, 11, 12)
Column = tuple[str, Array, Mapping[str, Any]]


def torque(time: Array) -> Array:
    """A moment of slowly rising frequency, N m."""
    return np.asarray(np.sin(6.0 * time + 0.3 * time**2))


@cache
def motion() -> OdeSolution:
    """Angle and rate of an oscillator of 12.57 rad/s under the torque, from its rest at 0."""
    return solve_ivp(
        lambda t, y: [y[1], 10.0 * float(torque(np.asarray(t))) - 1.3 * y[1] - 158.0 * y[0]],
        (0.0, END + 1.0), [0.0, 0.0], rtol=1e-8, atol=1e-10, dense_output=True,
    ).sol  # fmt: skip


def angle(time: Array) -> Array:
    """The response of the oscillator, rad."""
    return np.asarray(motion()(time)[0])


def times(rate: float = RATE, first: float = 0.0, last: float = END) -> Array:
    """Times from the first to the last one, s."""
    return np.asarray(first + np.arange(round((last - first) * rate)) / rate)


def clock(rate: float = RATE, offset: float = 0.0, *, dated: bool = False) -> dict[str, Any]:
    """What a channel states about its clock."""
    if dated:
        start = np.datetime64(START + timedelta(seconds=offset))
        return {"wf_increment": 1.0 / rate, "wf_start_offset": 0.0, "wf_start_time": start}
    return {"wf_increment": 1.0 / rate, "wf_start_offset": offset}


def imported(folder: Path, *columns: Column, choices: ImportChoices = ImportChoices()) -> Imported:  # noqa: B008
    """The import of a TDMS file with some channels of one group."""
    units = {"torque": "N m", "angle": "rad", "temperature": "°C", "gyro": "rad/s"}
    path = folder / "log.tdms"
    with nptdms.TdmsWriter(path) as file:
        file.write_segment(
            [
                nptdms.ChannelObject("rig", name, values, {"unit_string": units[name], **properties})
                for name, values, properties in columns
            ]
        )
    return read_records([path], choices)


@pytest.mark.parametrize("dated", [False, True])
@pytest.mark.parametrize(
    ("rates", "of_torque", "of_angle"),
    [
        ((200.0, 200.0), (0.0, END), (0.35, END)),  # of unequal lengths
        ((200.0, 200.0), (0.0, END - 0.35), (0.35, END)),  # of equal lengths
        ((200.0, 200.0), (0.5, END), (0.0, END)),  # the moment is recorded later
        ((200.0, 200.0), (0.0, END - 2.0), (0.0, END)),  # and ends earlier
        ((1000.0, 200.0), (0.0, END), (0.012, END)),  # and is sampled more often
    ],
)
def test_a_moment_is_that_of_the_same_time(
    rates: tuple[float, float],
    of_torque: tuple[float, float],
    of_angle: tuple[float, float],
    dated: bool,
    tmp_path: Path,
) -> None:
    first, second = times(rates[0], *of_torque), times(rates[1], *of_angle)
    found = imported(
        tmp_path,
        ("torque", torque(first), clock(rates[0], of_torque[0], dated=dated)),
        ("angle", angle(second), clock(rates[1], of_angle[0], dated=dated)),
    )
    (run,) = found.campaign.runs
    assert run.drive is not None
    assert run.drive.column == "moment_nm"
    common = second[(second > first[0] - 1e-6) & (second < first[-1] + 1e-6)]
    np.testing.assert_allclose(run.record.time_s, common - common[0], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(run.record.yaw_rad, angle(common), rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(run.drive.values, torque(common), rtol=0.0, atol=1e-9)
    said = " ".join(found.remarks())
    assert ("is sampled more often" in said) == (rates[0] > rates[1])


def test_the_angle_is_read_on_its_own_clock_beside_others(tmp_path: Path) -> None:
    free = 0.3 * np.exp(-0.2 * times()) * np.cos(12.0 * times())
    found = imported(
        tmp_path,
        ("angle", free, clock()),
        ("temperature", 20.0 + 0.01 * times(20.0), clock(20.0)),
        ("gyro", np.cos(times(100.0)), clock(100.0, 0.0013)),
    )
    (run,) = found.campaign.runs
    np.testing.assert_allclose(run.record.time_s, times(), rtol=0.0, atol=1e-9)
    np.testing.assert_array_equal(run.record.yaw_rad, free)
    assert run.drive is None
    assert "'gyro' is left out: it is sampled every 0.01 s from 0.0013 s on" in " ".join(found.remarks())


NOISE = np.random.default_rng(20260601).standard_normal(times(1000.0).size)


@pytest.mark.parametrize(
    ("column", "why"),
    [
        (("torque", torque(times(100.0)), clock(100.0)), "has no number at 1999 of 3999 samples"),
        (("torque", torque(times()), clock(200.0, 0.0023)), "the samples do not coincide"),
        (("torque", torque(times(150.0)), clock(150.0)), "the samples do not coincide"),
        (("torque", NOISE, clock(1000.0)), "changes between the samples"),
        (("torque", torque(times()), clock(200.0, 100.0)), "they do not overlap"),
        (("torque", torque(times()), clock(dated=True)), "only one of it and 'angle' states when it starts"),
        (("torque", torque(times())[:-7], {}), "its times are not stated"),
    ],
)
def test_a_moment_that_cannot_be_aligned_is_refused_in_one_line(
    column: Column, why: str, tmp_path: Path
) -> None:
    channels = column, ("angle", angle(times()), clock())
    with pytest.raises(TunnelError, match=rf"^[^\n]*{why}[^\n]*--input none[^\n]*$"):
        imported(tmp_path, *channels)
    (run,) = imported(tmp_path, *channels, choices=ImportChoices(input="none")).campaign.runs
    assert run.drive is None
    np.testing.assert_array_equal(run.record.yaw_rad, angle(times()))


def test_a_unit_that_is_not_known_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(TunnelError, match="'angle' is in 'furlong'"):
        imported(tmp_path, ("angle", angle(times()), clock() | {"unit_string": "furlong"}))


def test_channels_without_a_clock_follow_the_one_as_long(tmp_path: Path) -> None:
    found = imported(tmp_path, ("torque", torque(times()), clock()), ("angle", angle(times()), {}))
    (run,) = found.campaign.runs
    assert run.drive is not None
    np.testing.assert_allclose(run.record.time_s, times(), rtol=0.0, atol=1e-9)
