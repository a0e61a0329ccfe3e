"""A flexible rod of driven runs is named. The truth is the exact response of two masses."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from diagnosis import diagnose
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.input_kinds import InputColumn
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Array, Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

RATE, INERTIA, DAMPING, NOISE = 200.0, 0.1, 0.02, 3e-4
COMPLIANCE, SHARE = 2e-3, 0.2
TIME = np.arange(2000) / RATE


def reading(column: InputColumn, values: Array, spring: float) -> Array:
    """Angle of the upper end, which carries the spring, from rest; the input is linear between its samples."""
    upper, lower = SHARE * INERTIA, (1.0 - SHARE) * INERTIA
    loss = 2.0 * 0.01 * np.sqrt(INERTIA * SHARE * (1.0 - SHARE) / COMPLIANCE)
    a = np.zeros((6, 6))
    a[0, 1] = a[2, 3] = a[4, 5] = 1.0
    a[1, :4] = (
        -(spring + 1.0 / COMPLIANCE) / upper,
        -(DAMPING + loss) / upper,
        1.0 / COMPLIANCE / upper,
        loss / upper,
    )
    a[3, :4] = 1.0 / COMPLIANCE / lower, loss / lower, -1.0 / COMPLIANCE / lower, -loss / lower
    a[(1, 4) if column == "base_rad" else (3, 4)] = spring / upper if column == "base_rad" else 1.0 / lower
    step, state, seen = expm(a / RATE), np.zeros(6), []
    for now, then in zip(values, np.append(values[1:], 0.0), strict=True):
        state[4:] = now, (then - now) * RATE
        seen.append(state[0])
        state = step @ state
    return np.array(seen)


@pytest.mark.slow
@pytest.mark.parametrize("column", ["moment_nm", "base_rad"])
def test_a_flexible_rod_is_named(column: InputColumn) -> None:
    runs = []
    for seed, spring in enumerate((16.0, 45.0)):
        rng = np.random.default_rng(seed)
        lines = np.arange(0.5, 6.0, 3.0 / TIME[-1])
        waves = np.cos(2.0 * np.pi * np.outer(TIME, lines) + rng.uniform(0.0, 2.0 * np.pi, lines.size))
        values = waves.sum(axis=1) * (0.2 if column == "moment_nm" else 0.01)
        seen = reading(column, values, spring) + NOISE * rng.standard_normal(TIME.size)
        drive = Input(column, values)
        runs.append(Run(f"r{seed}", Record(TIME, seen), 0.0, spring_stiffness=spring, drive=drive))
    campaign = Campaign("driven", RigProperties(), SensorProperties(sample_rate=RATE), tuple(runs))
    names = "rod_flexibility", "second_mode", "cubic_stiffness", "input_delay", "dropped_samples"
    found = diagnose(campaign, kinds=[effect_class(name) for name in names])
    assert found.causes == ("rod_flexibility",)
    parameters = found.candidates[0].parameters
    for name, truth in (("compliance", COMPLIANCE), ("inertia_share", SHARE)):
        std = parameters[name].std
        assert std is not None
        assert abs(parameters[name].value - truth) < max(4.0 * std, 0.01 * truth)
