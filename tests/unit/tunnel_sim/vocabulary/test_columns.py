"""Columns that a user gives to a record. Truth: NumPy's own arrays of the same numbers."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pytest

from identification import identify
from tunnel_sim import Record, TunnelError

TIME = np.arange(5) * 0.25
YAW = np.array([0.3, 0.1, -0.2, -0.1, 0.2])
START = np.datetime64("2024-05-21T10:00:00.125", "ns")
DATES = START + np.round(TIME * 1e9).astype("timedelta64[ns]")
ZONE = timezone(timedelta(hours=2))
MASK = [False, False, True, False, False]


@pytest.mark.parametrize(
    ("time", "yaw"),
    [
        (TIME.tolist(), tuple(YAW)),
        (pd.Series(TIME), pd.Series(YAW, dtype="Float64")),
        (pl.Series(TIME), pl.Series(YAW)),
        (DATES, YAW.astype(np.longdouble)),
        (pd.Series(DATES), pd.array(YAW)),
        (pd.Series(DATES).dt.tz_localize("Europe/Paris"), np.array(YAW, dtype=object)),
        (pd.DatetimeIndex(DATES, tz="UTC"), YAW),
        (pl.Series(DATES), pl.Series(YAW)),
        (pl.Series(DATES).dt.replace_time_zone("UTC"), np.ma.masked_array(YAW)),
        (DATES - START, YAW),
        ([datetime(2024, 5, 21, tzinfo=ZONE) + timedelta(seconds=s) for s in TIME], YAW),
        ([timedelta(seconds=s) for s in TIME], YAW),
    ],
)
def test_the_same_numbers_are_the_same_record(time: Any, yaw: Any) -> None:
    record = Record(time, yaw)
    np.testing.assert_allclose(record.time_s, TIME, atol=1e-15)
    np.testing.assert_array_equal(record.yaw_rad, YAW)
    assert record.time_s.dtype == record.yaw_rad.dtype == np.float64
    assert not record.yaw_rad.flags.writeable


def with_(value: object, at: int = 2) -> list[object]:
    return [value if i == at else float(y) for i, y in enumerate(YAW)]


@pytest.mark.parametrize(
    ("time", "yaw", "said"),
    [
        (TIME, with_(np.nan), "yaw_rad is nan, not a finite number, at index 2"),
        (TIME, with_(-np.inf), "yaw_rad is -inf"),
        (with_(np.nan), YAW, "time_s is nan"),
        (np.where(MASK, np.datetime64("NaT"), DATES), YAW, "time_s is nan"),
        (TIME, with_(None), "yaw_rad is nan"),
        (TIME, pl.Series(with_(None)), "yaw_rad is nan"),
        (TIME, pd.Series(with_(pd.NA), dtype="object"), "yaw_rad holds <NA>"),
        (TIME, YAW + 0j, "complex"),
        (TIME, with_(1j), "complex"),
        (TIME, YAW > 0, "truth values"),
        (TIME, YAW.astype(str), "texts"),
        (TIME, pl.Series(YAW).cast(pl.String), "texts"),
        (TIME, with_("0.1"), "text"),
        (TIME, np.ma.masked_array(YAW, MASK), "1 masked value"),
        (TIME, DATES, "dates"),
        (TIME, DATES - START, "durations"),
        (TIME, YAW[:, None], "2 dimensions"),
        (TIME, None, "0 dimensions"),
        (TIME, [[0.1], [0.2, 0.3]], "is not an array"),
        (TIME, YAW[:4], "5 times and 4 readings"),
        (TIME[:1], YAW[:1], "1 times and 1 readings"),
        (TIME[::-1], YAW, "does not increase at index 1"),
        (np.round(TIME), YAW, "does not increase"),
        (1e200 * TIME, YAW, "time_s is"),
    ],
)
def test_other_values_are_one_line(time: Any, yaw: Any, said: str) -> None:
    with pytest.raises(TunnelError) as caught:
        Record(time, yaw)
    assert said in str(caught.value)
    assert caught.value.remedy


@pytest.mark.parametrize("given", [None, 3, [1.0], {}, b"rig"])
def test_what_is_not_a_campaign_is_one_line(given: Any) -> None:
    with pytest.raises(TunnelError, match="is not a campaign"):
        identify(given)
