"""No gap is found in white noise more often than stated, from ten samples per cycle to several thousand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from diagnosis.settings import Settings
from tests.reference import free_decays
from tests.reference.free_decays import Setting, with_records
from tests.support.gap_campaigns import judged

NOISE = 4e-4
SETTINGS = (Setting(16.12, 0.0), Setting(20.0, 0.0), Setting(16.12, 20.0), Setting(20.0, 20.0))
CYCLE = 2.0 * np.pi * np.sqrt(0.1014 / 16.12)
"""Period of the first run, s."""
TRIALS = {10: 200, 50: 200, 500: 200, 5000: 200}
CYCLES = {10: 16.0, 50: 16.0, 500: 8.0, 5000: 4.0}
"""Length of the runs: fewer where there are more samples in each."""


def decays(per_cycle, seed, *, step=None):
    """Four runs of the nominal model in closed form, the noise not stated."""
    return free_decays.campaign(
        SETTINGS,
        noise=NOISE,
        stated_noise=None,
        resolution=step,
        rate=per_cycle / CYCLE,
        duration=CYCLES[per_cycle] * CYCLE,
        rng=np.random.default_rng(seed),
    )


def most_alarms(trials):
    """As many as a test of exactly the stated rate exceeds with a chance of one in ten thousand."""
    return binom.ppf(0.9999, trials, Settings().gap.detection_rate)


@pytest.mark.slow
@pytest.mark.parametrize("per_cycle", TRIALS)
def test_white_noise_is_no_gap_at_any_sampling_rate(per_cycle):
    trials = TRIALS[per_cycle]
    found = [judged(decays(per_cycle, seed)) for seed in range(trials)]
    assert sum(one.detected for _, _, one in found) <= most_alarms(trials)
    assert sum(noise.colour is not None for _, noise, _ in found) <= most_alarms(trials)


@pytest.mark.slow
@pytest.mark.parametrize("per_cycle", TRIALS)
def test_rounding_that_hides_the_noise_is_no_gap_at_any_sampling_rate(per_cycle):
    trials = TRIALS[per_cycle] // 4
    found = [judged(decays(per_cycle, seed, step=10.0 * NOISE)) for seed in range(trials)]
    assert sum(one.detected for _, _, one in found) <= most_alarms(trials)


@pytest.mark.slow
@pytest.mark.parametrize("per_cycle", TRIALS)
def test_the_bound_is_exceeded_where_the_model_misses_the_motion(per_cycle):
    """The same count for a motion whose frequency depends on its amplitude: it must not pass."""
    trials = 3 if per_cycle < 5000 else 1

    def softening(time, yaw):
        return yaw + 0.05 * yaw**3 / 0.35**2 * np.exp(-time / CYCLE)

    found = [judged(with_records(decays(per_cycle, seed), softening)) for seed in range(trials)]
    assert all(one.detected for _, _, one in found)
