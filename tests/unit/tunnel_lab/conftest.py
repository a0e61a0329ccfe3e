"""``tunnel`` in this process, and a campaign whose truth is a closed form."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.command import Outcome, Tunnel
from tunnel_lab.cli import main

PROGRESS = re.compile(r"\d+\.\d s: \w")
"""A step of a command on standard error where no terminal shows it."""


TRUTH = {"cn_beta": 0.5, "cn_r": -0.12, "yaw_inertia": 0.1, "mechanical_damping": 0.02}
DENSITY, AREA, LENGTH = 1.2, 0.036, 0.625
SPRING, SPEED = 16.0, 15.0


@pytest.fixture
def tunnel(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Tunnel:
    """Run ``tunnel`` in this process; returns exit status, standard output and standard error."""
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setenv("NO_COLOR", "1")

    def run(*arguments: str | Path) -> Outcome:
        status = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return run


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium, for the tests of a file."""
    from tests.support.browser import chromium

    with chromium() as found:
        yield found


@pytest.fixture
def unrendered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures in files of their first bytes: rendering takes most of the time, and has tests of its own."""
    from matplotlib.figure import Figure

    begin, savefig = {"png": b"\x89PNG\r\n\x1a\n", "pdf": b"%PDF"}, Figure.savefig

    def begun(figure: Figure, stream: Any, *, format: str, **named: Any) -> None:
        stream.write(begin[format]) if format in begin else savefig(figure, stream, format=format, **named)

    monkeypatch.setattr(Figure, "savefig", begun)


@pytest.fixture
def truth() -> dict[str, float]:
    """What the written campaigns hold, SI."""
    return dict(TRUTH)


def decay(wind_speed: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Closed form of the damped oscillation from rest at 0.35 rad, with a zero of 2 mrad and noise."""
    ka = 0.5 * DENSITY * wind_speed**2 * AREA * LENGTH * TRUTH["cn_beta"]
    ca = 0.5 * DENSITY * wind_speed * AREA * LENGTH**2 * TRUTH["cn_r"]
    square = (SPRING - ka) / TRUTH["yaw_inertia"]
    sigma = (TRUTH["mechanical_damping"] - ca) / (2.0 * TRUTH["yaw_inertia"])
    omega = np.sqrt(square - sigma**2)
    time = np.arange(0.0, 12.0, 0.005)
    clean = 0.35 * np.exp(-sigma * time) * (np.cos(omega * time) + sigma / omega * np.sin(omega * time))
    return time, clean + 0.002 + 5e-4 * np.random.default_rng(seed).standard_normal(time.size)


def write_by_hand(folder: Path, *, stiffness: bool = True) -> Path:
    """A wind-off and a wind-on run, written without the project's own writer."""
    (folder / "runs").mkdir(parents=True)
    lines = [
        "schema_version = 1",
        '[campaign]\nname = "tiny"',
        f"[rig]\nfrontal_area = {AREA}\nreference_length = {LENGTH}",
        "[sensor]\nsample_rate = 200.0",
    ]
    for number, speed in enumerate((0.0, SPEED), 1):
        time, angle = decay(speed, seed=number)
        rows = "".join(f"{t:.3f},{y:.6f}\n" for t, y in zip(time, angle, strict=True))
        (folder / "runs" / f"r0{number}.csv").write_text("time_s,yaw_rad\n" + rows)
        lines.append(f'[[runs]]\nid = "r0{number}"\nfile = "runs/r0{number}.csv"\nwind_speed = {speed}')
        lines.append(f"air_density = {DENSITY}")
        if stiffness:
            lines.append(f"spring_stiffness = {SPRING}")
    (folder / "campaign.toml").write_text("\n".join(lines) + "\n")
    return folder


@pytest.fixture
def tiny_campaign(tmp_path: Path) -> Path:
    """A campaign of two runs with known truth."""
    return write_by_hand(tmp_path / "tiny")


@pytest.fixture
def normalised_campaign(tmp_path: Path) -> Path:
    """The same without spring stiffness."""
    return write_by_hand(tmp_path / "normalised", stiffness=False)
