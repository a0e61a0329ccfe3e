from importlib import resources

import numpy as np
import pytest

from identification import datasets
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.errors import TunnelError


def test_table_2_is_the_paper_s() -> None:
    rows = datasets.paper_springs()
    assert [row.number for row in rows] == list(range(1, 11))
    assert (rows[4].stiffness_n_m_per_rad, rows[4].frequency_hz) == (16.12, 2.0333)
    # The gradient the reading of the paper gives (kg m²), and its intercept (N m/rad).
    omega = 2.0 * np.pi * np.array([row.frequency_hz for row in rows])
    gradient, intercept = np.polyfit(omega**2, [row.stiffness_n_m_per_rad for row in rows], 1)
    assert gradient == pytest.approx(0.1014, abs=5e-5)
    assert intercept == pytest.approx(-0.02, abs=5e-3)


def test_table_2_agrees_with_the_rig() -> None:
    assert {row.number: row.stiffness_n_m_per_rad for row in datasets.paper_springs()} == dict(
        load_rig().springs
    )


def test_table_3_is_the_paper_s_with_its_garbled_windows_marked() -> None:
    rows = datasets.paper_windows()
    assert [row.number for row in rows] == list(range(1, 9))
    assert [row.zeta for row in rows] == [0.0091, 0.0086, 0.0079, 0.0074, 0.0059, 0.0056, 0.0065, 0.0065]
    assert (rows[0].omega_n_rad_per_s, rows[7].omega_n_rad_per_s) == (12.4332, 12.6331)
    garbled = {row.number: row.omega_n_second_reading_rad_per_s for row in rows}
    assert {number for number, reading in garbled.items() if reading is not None} == {3, 4}
    for row in rows[2:4]:
        assert row.omega_n_second_reading_rad_per_s == pytest.approx(row.omega_n_rad_per_s - 0.002, abs=2e-4)


def test_table_4_is_the_paper_s() -> None:
    assert {row.method: (row.cn_beta_per_rad, row.cn_r_per_rad) for row in datasets.paper_derivatives()} == {
        "neural network": (0.4719, -0.1033),
        "conventional": (0.49519, -0.11397),
    }


@pytest.mark.parametrize(
    ("name", "runs", "rate", "release_deg"),
    [
        ("kvlcc2-roll-decay-0kn", 2, 100.0, [9.3, 10.3]),
        ("rotary-pendulum", 3, 1000.0, [90.0, 135.0, 45.0]),
    ],
)
def test_measured_campaigns_read(name: str, runs: int, rate: float, release_deg: list[float]) -> None:
    campaign = datasets.measured_campaign(name)
    assert campaign.name == name
    assert len(campaign.runs) == runs
    for run, release in zip(campaign.runs, release_deg, strict=True):
        assert run.spring_stiffness is None
        assert not run.wind_on
        assert run.record.sample_rate == pytest.approx(rate, rel=1e-6)
        assert abs(np.rad2deg(run.record.yaw_rad[0])) == pytest.approx(release, abs=0.5)


def test_an_unknown_campaign_is_named() -> None:
    with pytest.raises(TunnelError, match="did you mean 'rotary-pendulum'"):
        datasets.measured_campaign("rotary_pendulum")


@pytest.mark.parametrize("folder", [f"measured/{name}" for name in datasets.MEASURED_CAMPAIGNS] + ["paper"])
def test_every_dataset_says_where_it_comes_from(folder: str) -> None:
    data = resources.files("identification") / "data" / folder
    source = (data / "SOURCE.md").read_text(encoding="utf-8")
    assert "Source:" in source
    if folder != "paper":
        assert "MIT" in source
        licence = (data / "LICENSE").read_text(encoding="utf-8")
        assert licence.startswith("MIT License")
        holder = licence.split("(c) ")[1].split("\n")[0]
        assert holder in source


def test_every_packaged_campaign_is_listed() -> None:
    folders = (resources.files("identification") / "data" / "measured").iterdir()
    assert sorted(f.name for f in folders if f.is_dir()) == sorted(datasets.MEASURED_CAMPAIGNS)
