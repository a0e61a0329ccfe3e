"""A second mode beside the motion is named; a harmonic of the motion is not."""

from __future__ import annotations

import numpy as np
import pytest

from diagnosis.answer.other_modes import second_modes
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record


def campaign(*modes: tuple[float, float, float], seconds: float = 20.0) -> Campaign:
    """One run with oscillations given by amplitude (rad), frequency (Hz) and decay rate (1/s)."""
    time = np.arange(int(100 * seconds)) / 100.0
    yaw = np.random.default_rng(3).normal(0.0, 1e-4, time.size)
    for amplitude, frequency, rate in modes:
        yaw += amplitude * np.exp(-rate * time) * np.cos(2.0 * np.pi * frequency * time + 0.3)
    run = Run("swing", Record(time, yaw), 0.0)
    return Campaign("modes", RigProperties(), SensorProperties(100.0), (run,))


MOTION = (0.3, 2.2, 0.1)


@pytest.mark.parametrize("rate", [0.2, 1.0])
def test_a_second_mode_is_named_even_where_it_decays_in_a_quarter_of_the_run(rate):
    (words,) = second_modes(campaign(MOTION, (0.02, 2.9, rate)))
    assert "swing contains a second mode" in words
    assert "2.9 Hz" in words
    assert "beside 0.3 rad at 2.2 Hz" in words


@pytest.mark.parametrize("others", [(), ((0.02, 6.6, 0.3),), ((0.02, 2.21, 0.1),)])
def test_one_mode_its_harmonic_and_a_mode_that_is_not_resolved_are_not_named(others):
    assert second_modes(campaign(MOTION, *others)) == ()
