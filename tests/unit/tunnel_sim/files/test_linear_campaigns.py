"""Campaigns of a displacement on the disk: columns, keys and refusals."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.support.linear import FORBIDDEN
from tunnel_sim import read_campaign, write_campaign
from tunnel_sim.vocabulary.errors import TunnelError

TIME = np.arange(1000) / 500.0
READING = 0.02 * np.exp(-0.5 * TIME) * np.cos(2.0 * np.pi * 6.0 * TIME)


def folder(
    path: Path, column: str = "x_m", factor: float = 1.0, *, sensor: str = "", run: str = "", rig: str = ""
) -> Path:
    """A campaign of one run."""
    (path / "runs").mkdir(parents=True)
    table = "".join(f"{t!r},{x!r}\n" for t, x in zip(TIME.tolist(), (READING / factor).tolist(), strict=True))
    (path / "runs/r01.csv").write_text(f"time_s,{column}\n{table}")
    (path / "campaign.toml").write_text(
        f'schema_version = 1\n[campaign]\nname = "cart"\n[rig]\n{rig or "mass = 2.0"}\n[sensor]\n'
        f'motion = "displacement"\n{sensor}\n[[runs]]\nid = "r01"\nfile = "runs/r01.csv"\n'
        f"spring_stiffness = 2842.0\n{run}\n"
    )
    return path


@pytest.mark.parametrize(
    ("column", "factor", "quantity"),
    [
        ("x_m", 1.0, "angle"),
        ("x_mm", 1e-3, "angle"),
        ("x_m_s", 1.0, "rate"),
        ("x_mm_s", 1e-3, "rate"),
        ("x_m_s2", 1.0, "acceleration"),
        ("x_mm_s2", 1e-3, "acceleration"),
        ("x_g", 9.80665, "acceleration"),
    ],
)
def test_every_column_is_read_in_si(tmp_path: Path, column: str, factor: float, quantity: str) -> None:
    found = read_campaign(folder(tmp_path / "c", column, factor, sensor=f'quantity = "{quantity}"'))
    np.testing.assert_allclose(found.runs[0].record.yaw_rad, READING, rtol=1e-12)
    assert found.rig.yaw_inertia == 2.0
    assert found.runs[0].wind_speed == 0.0
    assert found.sensor.unit == ("m", "m/s", "m/s²")[found.sensor.derivative]


def test_a_campaign_is_written_under_its_own_keys(tmp_path: Path) -> None:
    given = read_campaign(folder(tmp_path / "c", run="release_displacement = 0.02"))
    again = write_campaign(given, tmp_path / "again", run_format="csv")
    text = (again / "campaign.toml").read_text()
    assert "mass = 2.0" in text
    assert "release_displacement = 0.02" in text
    assert not re.search(r"yaw|angle|inertia", text)
    assert (again / "runs/r01.csv").read_text().startswith("time_s,x_m\n")
    found = read_campaign(again)
    assert np.array_equal(found.runs[0].record.yaw_rad, given.runs[0].record.yaw_rad)
    assert found.runs[0].release_angle == 0.02


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"run": "wind_speed = 10.0"}, "'wind_speed' is stated of a displacement.*; leave wind_speed out"),
        ({"run": "air_density = 1.2"}, "'air_density' is stated of a displacement"),
        ({"rig": "frontal_area = 0.1"}, "'frontal_area' is stated of a displacement"),
        ({"rig": "yaw_inertia = 2.0"}, "'yaw_inertia' is stated.*; give mass"),
        (
            {"rig": "mass = -2.0"},
            "'mass' = -2.0 should be greater than 0; give mass as a positive number in kg",
        ),
        ({"run": "release_angle = 0.1"}, "'release_angle' is stated.*; give release_displacement"),
        (
            {"column": "yaw_rad"},
            "no column x_m or x_mm .*; name the displacement's column .*motion = 'angle'",
        ),
        ({"factor": 1e-3, "run": "release_displacement = 0.02"}, "x_m moves by ±19.*, about 1000 times"),
        (
            {"column": "x_mm", "run": "release_displacement = 0.02", "factor": 1.0},
            "about 1/1000 of the release",
        ),
        (
            {"factor": 1e-3},
            "the displacement moves by .*: it looks like millimetres; give it in m, or name the column x_mm",
        ),
    ],
)
def test_refusals_name_the_key_and_the_remedy(tmp_path: Path, given: dict[str, object], message: str) -> None:
    with pytest.raises(TunnelError, match=message) as error:
        read_campaign(folder(tmp_path / "c", **given))  # type: ignore[arg-type]
    assert not re.search(r"\brad\b|°|N m\b|degrees|swing", str(error.value))


def test_the_keys_of_a_displacement_are_refused_of_an_angle(tmp_path: Path) -> None:
    path = folder(tmp_path / "c", "yaw_rad")
    text = (path / "campaign.toml").read_text().replace('motion = "displacement"', "")
    (path / "campaign.toml").write_text(text)
    with pytest.raises(
        TunnelError, match=r"'mass' is stated.*; give yaw_inertia, or state motion = 'displacement'"
    ):
        read_campaign(path)


def test_another_motion_is_refused_before_the_keys_that_depend_on_it(tmp_path: Path) -> None:
    path = folder(tmp_path / "c")
    text = (path / "campaign.toml").read_text().replace('"displacement"', '"dispalcement"')
    (path / "campaign.toml").write_text(text)
    with pytest.raises(
        TunnelError, match="motion = 'dispalcement' is no motion; give 'angle' or 'displacement'"
    ):
        read_campaign(path)


def test_a_campaign_says_so_in_its_own_units(tmp_path: Path) -> None:
    said = repr(read_campaign(folder(tmp_path / "c")))
    assert "N/m" in said
    assert not re.search(FORBIDDEN, said)
