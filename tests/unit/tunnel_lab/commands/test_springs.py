"""``tunnel springs``: the paper's table, a table of one's own, and one that gives no inertia."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.support.command import Tunnel


def test_springs_of_the_paper(tunnel: Tunnel) -> None:
    """The inertia and the two springs that leave the line, as worked out from Table II by hand."""
    status, out, err = tunnel("springs")
    assert (status, err) == (0, "")
    assert re.search(r"Izz \(gradient\) = 0\.101\d? ± 0\.00\d+ kg m²", out)
    flagged = [line.split()[0] for line in out.splitlines() if "off the line" in line]
    assert flagged == ["4", "7"]


def test_springs_of_ones_own(tunnel: Tunnel, tmp_path: Path) -> None:
    """Exact springs of Izz = 0.2 kg m²: f = √(Kr/Izz)/2π."""
    rows = [f"s{k},{k},{(k / 0.2) ** 0.5 / 6.283185307179586:.15f}" for k in (1.0, 2.0, 4.0, 8.0)]
    table = tmp_path / "own.csv"
    table.write_text("spring,stiffness_N_m_per_rad,frequency_Hz\n" + "\n".join(rows) + "\n")
    status, out, _ = tunnel("springs", table)
    assert status == 0
    found = re.search(r"Izz \(gradient\) = ([\d.]+) ", out)
    assert found is not None
    assert float(found[1]) == pytest.approx(0.2, abs=1e-9)
    assert "off the line" not in out


def test_springs_that_give_no_inertia_end_with_status_one(tunnel: Tunnel, tmp_path: Path) -> None:
    table = tmp_path / "own.csv"
    table.write_text("stiffness_N_m_per_rad,frequency_Hz\n3,1\n2,2\n1,3\n")
    status, out, err = tunnel("springs", table)
    assert status == 1
    assert "Izz" not in out
    assert err.count("\n") == 1
