"""Ambient vibration is not given the damping of a decay. Truth: oscillators moved by kicks of their rate."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from identification import Status, identify
from identification.examination.ambient import is_ambient
from tests.marks import slow
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Array, Record

RATE, OMEGA = 100.0, 12.0


def moved(zeta: float, duration: float, seed: int, release: float = 0.0, kicks: float = 1.0) -> Array:
    """The angle under kicks, of unit standard deviation at rest, after a release; rad."""
    rng = np.random.default_rng([20260601, seed])
    count, before = round(duration * RATE), round(8.0 / (zeta * OMEGA) * RATE)
    poles = np.exp((-zeta + np.array([1j, -1j]) * np.sqrt(1.0 - zeta**2)) * OMEGA / RATE)
    random = lfilter([1.0], np.real(np.poly(poles)), rng.standard_normal(count + before))[before:]
    time = np.arange(count) / RATE
    free = release * np.exp(-zeta * OMEGA * time) * np.cos(OMEGA * time)
    return np.asarray(0.05 * kicks * random / random.std() + free + 1e-4 * rng.standard_normal(count))


def run(angle: Array, name: str = "r") -> Run:
    """A run of these angles."""
    return Run(name, Record(np.arange(angle.size) / RATE, angle), 0.0)


def decaying(seed: int) -> dict[str, Array]:
    """Motions that are not ambient vibration."""
    time = np.arange(6000) / RATE
    noise = np.random.default_rng([20260602, seed]).standard_normal(time.size)
    decay = np.exp(-0.02 * time) * np.cos(OMEGA * time)
    phase = 3.0 * seed
    return {
        "decay": 0.3 * decay + 1e-3 * noise,
        "lost in noise": 0.1 * decay + 0.1 * noise,
        "buffeted": moved(0.01, 60.0, seed, release=0.4, kicks=0.3),
        "beat": 0.1 * (np.cos(OMEGA * time) + np.cos((OMEGA + 0.7) * time + phase)) + 1e-3 * noise,
        "decaying beat": 0.1 * decay * (1.0 + 0.6 * np.cos(1.3 * time + phase)) + 1e-3 * noise,
        "pendulum": decay * 0.0 + np.exp(-0.02 * time) * np.cos(OMEGA * time + 20.0 * np.exp(-0.04 * time)),
        "limit cycle": 0.3 * np.sin(OMEGA * time + 0.2 * np.sin(0.2 * time + phase)) + 1e-3 * noise,
        "growth": 1e-3 * np.exp(0.08 * time) * np.cos(OMEGA * time) + 1e-3 * noise,
    }


@pytest.mark.parametrize("seed", [0, *(slow(seed) for seed in range(1, 8))])
def test_only_random_motion_is_ambient(seed: int) -> None:
    for zeta, duration in ((0.02, 60.0), (0.05, 30.0), (0.03, 120.0)):
        assert is_ambient(run(moved(zeta, duration, seed)))
    assert [name for name, angle in decaying(seed).items() if is_ambient(run(angle))] == []


def test_its_damping_is_from_the_filter_alone() -> None:
    angle, zeta = moved(0.03, 120.0, 1), 0.03
    campaign = Campaign("a", RigProperties(), SensorProperties(), (run(angle),))
    for name in ("output_error", "hilbert"):
        found = identify(campaign, name, throw=False)
        assert found.runs[0].zeta is None
        assert found.runs[0].status is Status.AMBIENT_VIBRATION
        assert "-e filter_error" in found.runs[0].status.value
    (filtered,) = identify(campaign, "filter_error").runs
    assert filtered.zeta is not None
    assert abs(filtered.zeta.value - zeta) < 4.0 * filtered.zeta.std
    assert filtered.process_noise is not None


def test_the_other_runs_are_identified_beside_it() -> None:
    free = decaying(1)["decay"]
    runs = (run(free, "free"), run(moved(0.03, 60.0, 2), "random"))
    found = identify(Campaign("a", RigProperties(), SensorProperties(), runs), "output_error")
    assert [one.id for one in found.runs] == ["free", "random"]
    assert found.runs[0].zeta is not None
    assert found.runs[1].zeta is None
    assert Status.AMBIENT_VIBRATION in found.statuses


def test_the_filter_says_where_its_result_is_that_of_output_error() -> None:
    runs = tuple(run(decaying(seed)["decay"], f"r{seed}") for seed in range(2))
    found = identify(Campaign("a", RigProperties(), SensorProperties(), runs), "filter_error")
    said = [str(remark) for remark in found.remarks]
    assert any(
        "runs r0, r1: no random moment is found" in one and "that of output error" in one for one in said
    )
    random = identify(
        Campaign("a", RigProperties(), SensorProperties(), (run(moved(0.03, 60.0, 3)),)), "filter_error"
    )
    assert not any("output error" in str(remark) for remark in random.remarks)
