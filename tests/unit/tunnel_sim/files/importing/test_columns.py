"""Which rows of a sheet are its head, and which of its columns are times and angles. Truth: tables by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tunnel_sim import TunnelError
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.column_names import named_kind
from tunnel_sim.files.importing.column_numbers import in_seconds
from tunnel_sim.files.importing.columns import find_pairs
from tunnel_sim.files.importing.formats.layout import find_layout
from tunnel_sim.files.importing.tables import Channel, Table

TIME = 0.05 * np.arange(200)
SWING = 0.3 * np.exp(-0.1 * TIME) * np.cos(4.0 * TIME)
NUMBERS = [["0.00", "0.35"], ["0.01", "0.34"], ["0.02", "0.32"]]


def layout(*head: str, width: int = 2, delimiter: str = ";"):
    """The layout of some lines above rows of numbers."""
    rows = [*(line.split(delimiter) for line in head), *NUMBERS]
    found = find_layout(rows, [*head, *(delimiter.join(row) for row in NUMBERS)], ".", width)
    assert found is not None
    return found


@pytest.mark.parametrize("end", ["", ";", ";;;"])
def test_delimiters_after_the_last_name_do_not_hide_the_names(end: str) -> None:
    found = layout(f"time [s];yaw [rad]{end}")
    assert (found.names, found.units, found.first, found.headed) == (("time", "yaw"), ("s", "rad"), 1, True)


def test_a_row_of_more_texts_than_columns_names_nothing() -> None:
    found = layout("time [s];yaw [rad];state")
    assert (found.names, found.units, found.headed) == (("column 1", "column 2"), ("", ""), False)


def test_a_row_of_units_below_the_names_and_a_remark_above() -> None:
    found = layout("measured by hand", "clock;swing", "[ms];[deg]")
    assert (found.names, found.units, found.first) == (("clock", "swing"), ("ms", "deg"), 3)
    assert layout("# clock;swing").names == ("clock", "swing")


def test_columns_of_one_name_are_told_apart_by_their_place() -> None:
    assert layout("yaw;yaw").names == ("yaw #1", "yaw #2")


def test_numbers_stated_above_the_table_are_in_seconds_and_hertz() -> None:
    found = layout("Rate: 2 kHz", "Step = 0,5 ms", "Gain: 3 V", "clock;swing")
    assert found.facts == pytest.approx({"Rate": 2000.0, "Step (s)": 5e-4, "Gain (V)": 3.0})


def pairs(*channels: Channel, headed: bool = True, **choices: object):
    """What is taken of some columns, by name, and why."""
    found = find_pairs(Table(channels, headed=headed), ImportChoices(**choices), "log.csv")  # type: ignore[arg-type]
    taken = [(pair.run, pair.time.channel.name or None, pair.reading.channel.name) for pair in found]
    return taken, [words for pair in found for words in pair.remarks]


def test_columns_may_be_chosen_by_their_numbers() -> None:
    names = ("a", "b", "c")
    columns = [Channel(name, values) for name, values in zip(names, (SWING, TIME, 2.0 * SWING), strict=True)]
    assert pairs(*columns, time="2", angle=("3",))[0] == [("", "b", "c")]
    assert pairs(*columns, time="2", angle=("1", "3"))[0] == [("a", "b", "a"), ("c", "b", "c")]
    for outside in ("0", "4"):
        with pytest.raises(TunnelError, match=f"no column '{outside}'"):
            pairs(*columns, time=outside, angle=("3",))


def test_steady_numbers_are_times_and_a_count_of_samples_is_not() -> None:
    swing = Channel("column 2", SWING)
    taken, said = pairs(Channel("column 1", TIME), swing, headed=False)
    assert taken == [("", "column 1", "column 2")]
    assert "times from 'column 1': evenly stepped numbers, and the file names no columns" in said
    count = Channel("n", np.arange(200.0))
    assert pairs(count, Channel("yaw", SWING, "rad"))[0] == [("", None, "yaw")]


def test_the_first_of_several_columns_of_times_is_taken() -> None:
    taken, said = pairs(
        Channel("time", TIME, "s"), Channel("elapsed", TIME, "s"), Channel("yaw", SWING, "rad")
    )
    assert taken == [("", "time", "yaw")]
    assert "times from 'time', the first of 2 columns of times; --time names another" in said


@pytest.mark.parametrize(("share", "left_out"), [(0.015, True), (0.025, False)])
def test_a_column_that_hardly_moves_beside_another_is_left_out(share: float, left_out: bool) -> None:
    columns = (
        Channel("time", TIME, "s"),
        Channel("yaw", SWING, "rad"),
        Channel("roll", share * SWING, "rad"),
    )
    if left_out:
        taken, said = pairs(*columns)
        assert taken == [("", "time", "yaw")]
        assert "'roll' is left out: it hardly moves" in said
    else:
        with pytest.raises(TunnelError, match="2 columns may be the angle: 'yaw', 'roll'"):
            pairs(*columns)


@pytest.mark.parametrize("cycles", [2.0, 20.0])
def test_an_angle_beside_its_acceleration_is_not_still(cycles: float) -> None:
    """Without units the sizes do not compare: at 2 Hz the acceleration is 158 times the angle."""
    time, omega = np.arange(4000) / 1000.0, 2.0 * np.pi * cycles
    swing = np.cos(omega * time)
    columns = (
        Channel("time", time, "s"),
        Channel("theta", swing),
        Channel("alpha", -(omega**2) * swing),
    )
    with pytest.raises(TunnelError, match="2 columns may be the angle: 'theta', 'alpha'"):
        pairs(*columns)
    rate = Channel("beta", -omega * np.sin(omega * time))
    taken, said = pairs(*columns[:2], rate)
    assert taken == [("", "time", "theta")]
    assert "'beta' is left out: it is the rate of another column" in said


def test_runs_that_share_their_times_are_named_by_their_marks() -> None:
    taken, _ = pairs(
        Channel("time", TIME, "s"), Channel("yaw Run #3", SWING, "rad"), Channel("yaw Run #7", -SWING, "rad")
    )
    assert taken == [("run-3", "time", "yaw Run #3"), ("run-7", "time", "yaw Run #7")]


def test_many_columns_are_counted_where_they_are_listed() -> None:
    columns = [Channel(f"yaw {name}", SWING, "rad") for name in "abcdefghij"]
    with pytest.raises(TunnelError, match=r"10 columns may be the angle: 'yaw a', .*'yaw h' and 2 more"):
        pairs(Channel("time", TIME, "s"), *columns)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("ZGyro", "rate"), ("gyrox", "rate"), ("xGyro", "rate"), ("gyro_z", "rate"),
        ("YawRate", "rate"), ("theta_dot", "rate"), ("Winkelgeschwindigkeit", "rate"),
        ("AngularVelocity", "rate"), ("Drehrate", "rate"), ("θ̇", "rate"),
        ("ω", "rate"), ("accX", "acceleration"), ("Winkelbeschleunigung", "acceleration"), ("θ̈", "acceleration"),
        ("theta_ddot", "acceleration"),
        ("theta", ""), ("rotation", ""), ("anecdote", ""), ("generated", ""), ("accuracy", ""), ("accumulated", ""),
    ],
)  # fmt: skip
def test_what_a_name_calls_a_rate_or_an_acceleration(name: str, kind: str) -> None:
    assert named_kind(name) == kind


@pytest.mark.parametrize(
    ("times", "facts", "said"),
    [
        (TIME, {"Sample rate (Hz)": 100.0}, True),
        (TIME, {"Messrate": 20.0}, False),
        (TIME, {"Sample rate": 20.4}, False),  # rounded
        (TIME, {}, False),
        (np.delete(TIME, slice(80, 160)), {"fs": 20.0}, False),  # a gap
        (np.round(TIME, 1), {"fs": 20.0}, False),  # stamps coarser than the sampling
        (
            np.where(TIME[3] == TIME, np.nan, 1e3 * TIME),
            {"dt (s)": 0.05},
            True,
        ),  # milliseconds taken for seconds
    ],
)
def test_a_stated_rate_that_contradicts_the_times_is_said(
    times: np.ndarray, facts: dict[str, float], said: bool
) -> None:
    found = in_seconds(Channel("time", times, "s"), times.size, facts, ImportChoices(), "log.csv")
    np.testing.assert_array_equal(found.values, times)
    assert bool(found.why) == said
    assert all(words.doubt and "the times are used" in words for words in found.why)


@pytest.mark.parametrize(("rate", "said"), [(20.0, False), (7.0, True)])
def test_a_stated_rate_confirms_the_times_or_contradicts_them(rate: float, said: bool) -> None:
    found = in_seconds(
        Channel("time", TIME, "s"), TIME.size, {"fs": 7.0}, ImportChoices(rate=rate), "log.csv"
    )
    assert bool(found.why) == said
    assert all("not 7 Hz as stated" in words and "--rate 20 confirms them" in words for words in found.why)
