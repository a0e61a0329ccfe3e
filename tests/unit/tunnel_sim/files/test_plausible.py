"""Slips of units are refused with what they look like, and kept where the campaign says so."""

from __future__ import annotations

import numpy as np
import pytest

from tunnel_sim.files.campaign_folder import read_campaign, write_campaign
from tunnel_sim.files.plausible import RANGES, checked_record, plausible_values
from tunnel_sim.vocabulary.campaign import SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

SLIPS = {
    "density in g/m3": ("air_density = 1.2", "air_density = 1204", "g/m3"),
    "density in g/cm3": ("air_density = 1.2", "air_density = 0.0012", "g/cm3"),
    "area in mm2": ("frontal_area = 0.036", "frontal_area = 36000", "mm2"),
    "area in cm2": ("frontal_area = 0.036", "frontal_area = 360", "cm2"),
    "length in mm": ("reference_length = 0.625", "reference_length = 625", "mm"),
    "length in cm": ("reference_length = 0.625", "reference_length = 62.5", "cm"),
    "width in mm": ("width = 0.225", "width = 225", "mm"),
    "speed in km/h": ("wind_speed = 10", "wind_speed = 144", "km/h"),
    "time in ms": ("scale = 1", "scale = 1000", "milliseconds"),
    "slow sampling": ("rate = 200", "rate = 7", "too low a sample rate"),
}
TEXT = """schema_version = 1
[campaign]
name = "c"
[rig]
frontal_area = 0.036
reference_length = 0.625
width = 0.225
[sensor]
PLAUSIBLE
[[runs]]
id = "r1"
file = "r1.csv"
wind_speed = 10
air_density = 1.2
# scale = 1
# rate = 200
"""


def written(folder, text, plausible=""):
    options = {line.split()[1]: float(line.split()[3]) for line in text.splitlines() if line.startswith("# ")}
    time = np.arange(0.0, 8.0, 1.0 / options["rate"])
    yaw = 0.3 * np.exp(-0.1 * time) * np.cos(12.0 * time)
    rows = [f"{t:.9f},{y:.9f}" for t, y in zip(time * options["scale"], yaw, strict=True)]
    (folder / "r1.csv").write_text("\n".join(["time_s,yaw_rad", *rows]), encoding="utf-8")
    (folder / "campaign.toml").write_text(text.replace("PLAUSIBLE", plausible), encoding="utf-8")
    return folder


@pytest.mark.parametrize(("right", "wrong", "said"), SLIPS.values(), ids=SLIPS)
def test_a_slip_is_refused_and_can_be_kept(tmp_path, right, wrong, said):
    assert right in TEXT
    text = TEXT.replace(right, wrong)
    with pytest.raises(TunnelError) as caught:
        read_campaign(written(tmp_path, text))
    assert "looks like" in str(caught.value)
    assert said in str(caught.value)
    assert "plausible = false" in caught.value.remedy
    kept = read_campaign(written(tmp_path, text, "plausible = false"))
    assert kept.sensor.plausible is False


def test_the_campaign_the_others_spoil_is_good(tmp_path):
    assert read_campaign(written(tmp_path, TEXT)).sensor.plausible is None
    assert read_campaign(written(tmp_path, TEXT, "plausible = true")).sensor.plausible is True


def test_what_is_kept_is_written_and_read_back(tmp_path):
    folder = tmp_path / "from"
    folder.mkdir()
    kept = read_campaign(written(folder, TEXT.replace("1.2", "1204"), "plausible = false"))
    again = read_campaign(write_campaign(kept, tmp_path / "to"))
    assert again.sensor == kept.sensor
    assert again.runs[0].air_density == 1204.0


@pytest.mark.parametrize("key", RANGES)
def test_the_ends_of_a_range_are_in_it_and_beyond_is_not(key):
    allowed = RANGES[key]
    for value in (allowed.low, allowed.high):
        plausible_values({key: value}, "here")
    with pytest.raises(TunnelError, match="here"):
        plausible_values({key: 1.01 * allowed.high}, "here")
    assert allowed.reason


_TIME = np.arange(2000) / 200.0
_DECAY = 0.3 * np.exp(-0.1 * _TIME) * np.cos(12.0 * _TIME)


@pytest.mark.parametrize(
    ("time", "reading", "says"),
    [
        (_TIME + 1.7e9 * (_TIME >= 4.0), _DECAY, "time_s jumps by 1.7e+09 s after 3.995 s"),
        (_TIME + 1e3 * (_TIME >= 2.5), _DECAY, "time_s jumps by 1000 s after 2.495 s"),
        (_TIME, np.where(np.arange(2000) % 7 == 3, -9.99, _DECAY), "286 of 2000 readings are -9.99"),
        (
            _TIME,
            np.where((_TIME > 3.0) & (_TIME < 5.0), 999.0, _DECAY),
            "readings are 999, far from all others",
        ),
    ],
)
def test_what_hides_an_oscillation_is_named(time: Array, reading: Array, says: str):
    with pytest.raises(TunnelError) as caught:
        checked_record(time, reading, "yaw_rad", SensorProperties(), None, "run 'r1'")
    assert says in str(caught.value)
    assert "no oscillation is visible" not in str(caught.value)


def test_a_record_without_an_oscillation_is_still_refused_for_that():
    with pytest.raises(TunnelError, match="no oscillation is visible"):
        checked_record(_TIME, 1e-3 * _TIME, "yaw_rad", SensorProperties(), None, "r1")


@pytest.mark.parametrize("held", [4.0, 40.0])
def test_a_hold_before_the_motion_counts_no_cycles(held: float) -> None:
    """Two cycles and six of a swing of 2 Hz, released from rest at its angle."""

    def of_cycles(cycles: float) -> tuple[np.ndarray, np.ndarray]:
        time = np.arange(0.0, held + 0.5 * cycles, 0.005)
        free = np.maximum(time - held, 0.0)
        swing = 0.35 * np.exp(-0.1 * free) * np.cos(4.0 * np.pi * free)
        return time, swing + np.random.default_rng(4).normal(0.0, 1e-3, time.size)

    with pytest.raises(TunnelError, match=r"about [12]\.\d cycles of oscillation, fewer than three"):
        checked_record(*of_cycles(2.0), "yaw_rad", SensorProperties(), None, "r1")
    checked_record(*of_cycles(6.0), "yaw_rad", SensorProperties(), None, "r1")


def test_a_motion_that_grows_from_rest_is_no_hold() -> None:
    """By a factor of 2.7 in each cycle, from the noise on: fewer than three cycles exceed a tenth of the range."""
    time = np.arange(0.0, 6.0, 0.005)
    growth = 0.3 * np.exp(2.0 * (time - 6.0)) * np.sin(4.0 * np.pi * time)
    reading = growth + np.random.default_rng(5).normal(0.0, 1e-4, time.size)
    checked_record(time, reading, "yaw_rad", SensorProperties(), None, "r1")
