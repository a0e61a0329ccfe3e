"""The JSON of every command reads back, whatever the sensor; truth: closed forms."""

from __future__ import annotations

import json
from math import isfinite
from pathlib import Path

import numpy as np
import pytest

from identification.signal.noise import Residual, noise_level
from tests.marks import slow
from tests.reference.free_decays import Setting, campaign
from tests.support.command import Tunnel
from tests.unit.tunnel_lab.conftest import PROGRESS
from tunnel_sim.files.campaign_folder import write_campaign
from tunnel_sim.vocabulary.campaign import SensorProperties

SENSORS = {
    "noise free": {"noise": 0.0, "stated_noise": None},
    "noise free, said to be": {"noise": 0.0, "stated_noise": 5e-4},
    "noisy": {"noise": 5e-4, "stated_noise": None},
    "noisy, stated": {"noise": 5e-4},
    **{f"step {step}": {"noise": 5e-4, "stated_noise": None, "resolution": step} for step in (2e-3, 1e-2)},
    **{f"step {step}, stated": {"noise": 5e-4, "resolution": step} for step in (2e-3, 1e-2)},
    "step only": {"noise": 0.0, "stated_noise": None, "resolution": 5e-3},
}  # fmt: skip


QUICK = ("noise free", "noisy", "step only")


@pytest.fixture(params=[name if name in QUICK else slow(name) for name in SENSORS])
def any_sensor(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """One spring with the wind off and on, read by one of the sensors."""
    settings = [Setting(16.12, 0.0), Setting(16.12, 15.0)]
    rng = np.random.default_rng(1)
    data = campaign(settings, duration=6.0, rate=250.0, rng=rng, **SENSORS[request.param])
    return write_campaign(data, tmp_path / "campaign")


def no_constant(name: str) -> None:
    raise AssertionError(f"{name} is no JSON")


def read(text: str) -> dict:
    """A document in strict JSON: NaN and infinity refused."""
    document = json.loads(text, parse_constant=no_constant)
    assert document
    assert all(isfinite(number) for number in numbers(document))
    return document


def numbers(value: object) -> list[float]:
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        return [number for item in value for number in numbers(item)]
    return [value] if isinstance(value, float) else []


@pytest.mark.parametrize("estimator", ["output_error", slow("conventional")])
def test_identify(tunnel: Tunnel, any_sensor: Path, tmp_path: Path, estimator: str) -> None:
    file = tmp_path / "estimate.json"
    status, _, err = tunnel("identify", any_sensor, "--json", file, "--estimator", estimator)
    assert err == ""
    assert status in (0, 1)
    read(file.read_text(encoding="utf-8"))


def test_diagnose(tunnel: Tunnel, any_sensor: Path, tmp_path: Path) -> None:
    file = tmp_path / "answer.json"
    status, _, err = tunnel("diagnose", any_sensor, "--json", file, "--effects", "mains_hum")
    assert status == 0
    assert all(PROGRESS.match(line) for line in err.splitlines())
    assert read(file.read_text(encoding="utf-8"))["causes"] is not None


def test_a_verdict_on_the_residual_is_a_plain_truth_value() -> None:
    values = 1e-3 * np.random.default_rng(2).standard_normal(4000) + 1e-2 * np.sin(np.arange(4000) / 100.0)
    for resolution in (None, 0.01):
        level = noise_level([Residual(values, 160.0, 4, 0.3)], SensorProperties(250.0, resolution, None))
        assert type(level.departs) is bool
        assert type(level.std) is float
