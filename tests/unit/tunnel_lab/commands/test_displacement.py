"""From a file in millimetres to the report of a diagnosis, by the command line alone."""

from __future__ import annotations

import json
import re
from math import tanh
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.support.linear import FORBIDDEN, linear_campaign
from tests.unit.tunnel_lab.conftest import Tunnel

MASS = 2.0
KINDS = "coulomb_friction,cubic_stiffness"


def dry(x: float, v: float, k: float) -> float:
    """Dry friction of 0.04 N, smoothed for the integrator."""
    del x, k
    return -0.04 * tanh(v / 1e-4)


@pytest.fixture
def files(tmp_path: Path) -> dict[Path, float]:
    """Files of a logger in mm, with the stiffness of each run's spring, N/m."""
    found = {}
    for run in linear_campaign(MASS, (3.2, 5.0), (0.01, 0.005), dry).runs:
        path = tmp_path / f"{run.id}.csv"
        rows = (f"{t:.6f},{1e3 * x:.5f}" for t, x in zip(run.record.time_s, run.record.yaw_rad, strict=True))
        path.write_text("time (s),x (mm)\n" + "\n".join(rows) + "\n")
        assert run.spring_stiffness is not None
        found[path] = run.spring_stiffness
    return found


@pytest.mark.usefixtures("causes_alone", "undrawn", "unrendered")
def test_import_identify_diagnose_report(tunnel: Tunnel, files: dict[Path, float], tmp_path: Path) -> None:
    table = tmp_path / "springs.csv"
    table.write_text("file,spring_stiffness\n" + "".join(f"{one.name},{k!r}\n" for one, k in files.items()))
    cart, page, answer = tmp_path / "cart", tmp_path / "report.html", tmp_path / "answer.json"
    shown = []

    status, printed, _ = tunnel(
        "import", *files, "--out", cart, "--conditions", table, "--set", f"mass={MASS}", "--yes"
    )
    assert status == 0
    shown.append(printed.replace(str(tmp_path), ""))
    shown.append((cart / "campaign.toml").read_text())
    assert 'motion = "displacement"' in shown[-1]
    assert (cart / "runs/r01.csv").read_text().startswith("time_s,x_m\n")

    status, printed, _ = tunnel("identify", cart)
    assert status == 0
    shown.append(printed)
    mass = re.search(r"m \[kg\] +(\S+)", printed)
    assert mass is not None
    assert float(mass[1]) == pytest.approx(MASS, rel=0.01)

    status, printed, _ = tunnel("diagnose", cart, "--report", page, "--json", answer, "--effects", KINDS)
    assert status == 0
    shown.append(printed)
    document = json.loads(answer.read_text())
    assert document["causes"] == ["coulomb_friction"]
    friction = document["candidates"][0]["parameters"]["friction_moment"]
    assert friction["unit"] == "N"
    assert friction["value"] == pytest.approx(0.04, abs=max(4.0 * friction["std"], 2e-4))
    assert "coulomb_friction" in page.read_text() or "dry friction" in page.read_text().lower()

    status, printed, _ = tunnel("plot", cart, "--out", tmp_path / "figures")
    assert status == 0
    for text in shown:
        assert not re.search(FORBIDDEN, text), re.findall(rf".{{0,40}}(?:{FORBIDDEN}).{{0,40}}", text)


@pytest.mark.slow
@pytest.mark.usefixtures("causes_alone")
@pytest.mark.parametrize(
    ("heading", "per_newton"),
    [("force (N)", 1.0), ("base acceleration (g)", -1.0 / (MASS * 9.80665))],
)
def test_a_pushed_and_a_shaken_cart_from_file_to_report(
    tunnel: Tunnel, tmp_path: Path, heading: str, per_newton: float
) -> None:
    """SciPy's friction is found with its size."""
    k, damping, friction, time = 50.0, 0.3, 0.05, np.arange(3000) / 100.0
    wave = np.sin(2.0 * np.pi * (0.2 + 0.03 * time) * time)

    def moved(force: np.ndarray) -> np.ndarray:
        values = [*force.tolist(), float(force[-1])]

        def slope(t: float, state: np.ndarray) -> list[float]:
            x, v = state.tolist()
            place, between = divmod(100.0 * t, 1.0)
            pushed = values[int(place)] * (1.0 - between) + values[int(place) + 1] * between
            dragged = damping * v + k * x + friction * tanh(v / 1e-3)
            return [v, (pushed - dragged) / MASS]

        ends = (0.0, float(time[-1]))
        return np.asarray(
            solve_ivp(slope, ends, [0.0, 0.0], t_eval=time, rtol=1e-8, atol=1e-10, max_step=0.02).y[0]
        )

    rng = np.random.default_rng(8)
    files = [tmp_path / f"{heading[:5].strip()}{place}.csv" for place in (1, 2)]
    for path, peak in zip(files, (1.5, 0.7), strict=True):
        x = 1e3 * (moved(peak * wave) + 3e-5 * rng.standard_normal(time.size))
        table = np.stack([time, x, peak * per_newton * wave], axis=1)
        np.savetxt(path, table, "%.8g", ",", header=f"time (s),x (mm),{heading}", comments="")
    cart, answer = tmp_path / heading[:5].strip(), tmp_path / f"{heading[:5]}.json"
    stated = ("--set", f"mass={MASS}", "--set", f"spring_stiffness={k}", "--input-hold", "linear")
    status, printed, _ = tunnel("import", *files, "--out", cart, *stated, "--yes")
    assert status == 0
    shown = [printed.replace(str(tmp_path), "")]
    status, printed, _ = tunnel("diagnose", cart, "--json", answer, "--effects", KINDS)
    assert status == 0
    shown.append(printed)
    document = json.loads(answer.read_text())
    assert document["causes"] == ["coulomb_friction"]
    found = document["candidates"][0]["parameters"]["friction_moment"]
    assert found["unit"] == "N"
    assert found["value"] == pytest.approx(friction, rel=0.005)
    after = document["coefficients"]["after"]
    assert after["yaw_inertia"]["value"] == pytest.approx(MASS, rel=0.002)
    assert after["mechanical_damping"]["value"] == pytest.approx(damping, rel=0.02)
    for text in shown:
        assert not re.search(FORBIDDEN, text), re.findall(rf".{{0,40}}(?:{FORBIDDEN}).{{0,40}}", text)


def test_a_unit_of_length_makes_a_displacement(
    tunnel: Tunnel, files: dict[Path, float], tmp_path: Path
) -> None:
    """Also of a column without a unit, and of an acceleration in g."""
    first = next(iter(files))
    bare = tmp_path / "bare.csv"
    bare.write_text(first.read_text().replace("x (mm)", "signal"))
    for unit, column, factor in (("mm", "x_m", 1e-3), ("g", "x_m_s2", 9.80665), ("mm/s", "x_m_s", 1e-3)):
        out = tmp_path / column
        status, _, _ = tunnel("import", bare, "--out", out, "--angle", "signal", "--unit", unit, "--yes")
        assert status == 0
        head, row, *_ = (out / "runs/bare.csv").read_text().splitlines()
        assert head == f"time_s,{column}"
        value = float(bare.read_text().splitlines()[1].split(",")[1])
        assert float(row.split(",")[1]) == pytest.approx(factor * value)


def test_a_wind_is_refused_in_one_line(tunnel: Tunnel, files: dict[Path, float], tmp_path: Path) -> None:
    out = tmp_path / "windy"
    status, _, said = tunnel("import", *files, "--out", out, "--set", "wind_speed=10", "--yes")
    assert status == 2
    assert "leave wind_speed out" in said
    assert said.count("\n") == 1
    assert not out.exists()


def test_springs_give_the_mass(tunnel: Tunnel, tmp_path: Path) -> None:
    table = tmp_path / "springs.csv"
    rows = "".join(f"{k},{np.sqrt(k / MASS) / (2.0 * np.pi):.9f}\n" for k in (50.0, 90.0, 140.0, 200.0))
    table.write_text(f"stiffness_N_per_m,frequency_Hz\n{rows}")
    status, printed, _ = tunnel("springs", table)
    assert status == 0
    assert float(re.search(r"m \(gradient\) = (\S+)", printed)[1]) == pytest.approx(MASS, rel=1e-6)  # type: ignore[index]
    assert "k [N/m]" in printed
    assert "ωn² [1/s²]" in printed
    assert not re.search(FORBIDDEN, printed.replace(str(tmp_path), ""))
