"""Packaged measurements: the paper's tables and measured campaigns, each with its source and licence.

The files are in ``identification/data``; a ``SOURCE.md`` beside each states their source.
The paper: "Identification of Aerodynamic Coefficients of Ground Vehicles Using Neural Network".
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from importlib import resources

from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean

MEASURED_CAMPAIGNS: tuple[str, ...] = (
    "kvlcc2-roll-decay-0kn",
    "lee-heave-1",
    "lee-pitch-1",
    "rotary-pendulum",
    "tartaruga-growth",
    "tartaruga-lco",
)
"""Names of the packaged measured campaigns."""

# Windows of Table III with two possible readings of omega_n in the scan, and the reading that is not in the
# file.
_SECOND_READING = {3: 12.5054, 4: 12.5638}


@dataclass(frozen=True)
class SpringRow:
    """One spring of Table II, measured with the wind off.

    Args:
        stiffness_n_m_per_rad: Kr, N m/rad.
        frequency_hz: of the free oscillation, Hz.
    """

    number: int
    stiffness_n_m_per_rad: float
    frequency_hz: float


@dataclass(frozen=True)
class WindowRow:
    """Three consecutive cycles of the wind-on run in Table III.

    Args:
        number: of the window, counted from the release.
        zeta: damping ratio.
        omega_n_rad_per_s: natural frequency, rad/s.
        omega_n_second_reading_rad_per_s: the other possible reading, rad/s, if the scan is unclear; else None.
    """

    number: int
    zeta: float
    omega_n_rad_per_s: float
    omega_n_second_reading_rad_per_s: float | None = None


@dataclass(frozen=True)
class DerivativeRow:
    """One row of Table IV.

    Args:
        cn_beta_per_rad: Cnβ, 1/rad; positive lowers the frequency.
        cn_r_per_rad: Cnr, 1/rad; negative adds damping.
    """

    method: str
    cn_beta_per_rad: float
    cn_r_per_rad: float


def paper_springs() -> tuple[SpringRow, ...]:
    """Table II: the ten torsion springs and the frequencies measured with the wind off."""
    return tuple(
        SpringRow(int(row["spring"]), float(row["stiffness_N_m_per_rad"]), float(row["frequency_Hz"]))
        for row in _table("table2-springs.csv")
    )


def paper_windows() -> tuple[WindowRow, ...]:
    """Table III: damping and frequency of one wind-on run, three cycles at a time.

    Returns:
        Eight rows, in the order of time.
    """
    rows = [(int(row["window"]), row) for row in _table("table3-windows.csv")]
    return tuple(
        WindowRow(number, float(row["zeta"]), float(row["omega_n_rad_per_s"]), _SECOND_READING.get(number))
        for number, row in rows
    )


def paper_derivatives() -> tuple[DerivativeRow, ...]:
    """Table IV: the yaw-moment derivatives by both of the paper's methods."""
    return tuple(
        DerivativeRow(row["method"], float(row["cn_beta"]), float(row["cn_r"]))
        for row in _table("table4-derivatives.csv")
    )


def measured_campaign(name: str) -> Campaign:
    """A packaged measured campaign.

    Args:
        name: one of :data:`MEASURED_CAMPAIGNS`.

    Returns:
        The campaign, angles in radians. It states no spring stiffness, so only omega_n and zeta can be identified.

    Raises:
        TunnelError: there is no such campaign.
    """
    if name not in MEASURED_CAMPAIGNS:
        raise TunnelError(
            f"no measured campaign '{name}' is packaged", remedy=did_you_mean(name, MEASURED_CAMPAIGNS)
        )
    with resources.as_file(resources.files("identification") / "data" / "measured" / name) as folder:
        return read_campaign(folder)


def _table(file: str) -> list[dict[str, str]]:
    text = (resources.files("identification") / "data" / "paper" / file).read_text(encoding="utf-8")
    return list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
