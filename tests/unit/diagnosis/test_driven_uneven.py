"""Driven runs whose samples are not evenly spaced. The truth is the equation of motion, integrated by SciPy."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis import diagnose
from diagnosis.noise.sensor_noise import campaign_noise
from diagnosis.settings import Settings
from identification import identify
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.drive import Drive
from tunnel_sim.vocabulary.record import Array, Record

RATE, INERTIA, DAMPING, SPRING, NOISE = 200.0, 0.1, 0.05, 16.0, 3e-4
FULL = np.arange(2000) / RATE


def stamps(seed: int) -> Array:
    """Jitter of a third of the interval, and every fortieth sample lost."""
    rng = np.random.default_rng(seed)
    jittered = FULL + np.append(0.0, rng.uniform(-0.15, 0.15, FULL.size - 1)) / RATE
    return jittered[rng.uniform(size=FULL.size) > 0.025]


def driven_run(seed: int, friction: float) -> Run:
    """A run driven by a multisine from 1 to 3 Hz that is linear between its own samples."""
    rng, time = np.random.default_rng(seed), stamps(seed)
    lines = np.arange(1.0, 3.0, 1.0 / FULL[-1])
    phases = rng.uniform(0.0, 2.0 * np.pi, lines.size)
    values = 0.1 * np.cos(2.0 * np.pi * np.outer(time, lines) + phases).sum(axis=1)

    def slope(t: float, y: Array) -> list[float]:
        moment = np.interp(t, time, values) - SPRING * y[0] - DAMPING * y[1] - friction * np.tanh(y[1] / 1e-3)
        return [y[1], moment / INERTIA]

    span, start = (time[0], time[-1]), [0.02, 0.0]
    angle = solve_ivp(slope, span, start, "LSODA", time, rtol=1e-8, atol=1e-10, max_step=0.01).y[0]
    reading = angle + NOISE * rng.standard_normal(time.size)
    return Run(f"r{seed}", Record(time, reading), 0.0, SPRING, drive=Drive("moment_nm", values))


@cache
def campaign(friction: float) -> Campaign:
    runs = tuple(driven_run(seed, friction) for seed in range(2))
    assert not any(run.record.uniform for run in runs)
    return Campaign("uneven", RigProperties(), SensorProperties(), runs)


def test_the_noise_of_uneven_driven_runs_is_measured() -> None:
    found = campaign_noise(campaign(0.0), Settings().noise)
    assert all(abs(value / NOISE**2 - 1.0) < 0.15 for value in found.variance.values())


def test_the_rig_is_identified() -> None:
    estimate = identify(campaign(0.0))
    for name, truth in (("yaw_inertia", INERTIA), ("mechanical_damping", DAMPING)):
        found = getattr(estimate, name)
        assert abs(found.value - truth) < 4.0 * found.std


def test_a_linear_rig_has_no_gap() -> None:
    assert diagnose(campaign(0.0)).causes == ()


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.01])
def test_dry_friction_is_named(friction: float) -> None:
    kinds = [
        effect_class(n) for n in ("coulomb_friction", "quadratic_damping", "cubic_stiffness", "input_delay")
    ]
    found = diagnose(campaign(friction), kinds=kinds)
    assert found.causes == ("coulomb_friction",)
    size = found.candidates[0].parameters["friction_moment"]
    assert abs(size.value - friction) < 4.0 * size.std
    assert not any("MuJoCo" in said for said in found.cautions)
