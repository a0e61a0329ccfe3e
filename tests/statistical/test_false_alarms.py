"""Gap-free campaigns raise alarms at the stated rate or below, in every test; noise that misbehaves raises more."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from diagnosis.model.blocks import prepare
from diagnosis.noise import gap
from diagnosis.noise.gap import level_p_value, trend_p_values
from diagnosis.noise.sensor_noise import campaign_noise, noise_trend
from diagnosis.search.prepared import fit_nominal
from diagnosis.settings import Settings
from tests.reference import free_decays
from tests.reference.free_decays import Setting, with_records

NOISE = 4e-4
SETTINGS = (Setting(16.12, 0.0), Setting(44.84, 0.0), Setting(16.12, 20.0), Setting(44.84, 20.0))
SENSORS = {
    "continuous": {},
    "jittered": {"jitter": 0.5},
    "the rig's": {"resolution": 5.1e-4},
    "jittered and the rig's": {"jitter": 0.5, "resolution": 5.1e-4},
    "coarse": {"resolution": 1.5e-3},
    "hides the noise": {"resolution": 3e-3},
}
RATES = (0.1, 0.01, 1e-3)
"""Rates at which alarms are counted."""
CHANCE = 1e-4
"""Of each bound being exceeded by a test that keeps its rate."""


def decays(seed, *, noise=NOISE, **options):
    """Four runs of the nominal model in closed form, read at 1 kHz."""
    rng = np.random.default_rng(seed)
    return free_decays.campaign(SETTINGS, noise=noise, rate=1000.0, duration=3.0, rng=rng, **options)


def judged(data):
    """All tests of a campaign."""
    noise = campaign_noise(data, Settings().noise)
    nominal = fit_nominal(prepare(data, noise.variance))
    return gap.gap_test(nominal, noise, noise_trend(data), coarse_step=False)


@pytest.mark.slow
@pytest.mark.parametrize("name", SENSORS)
def test_no_test_sounds_more_often_than_it_says(name):
    """The bound: as many alarms as a test of exactly its rate exceeds with a chance of 1e-4, by test and in all."""
    trials = 150
    found = [judged(decays(seed, **SENSORS[name])) for seed in range(trials)]
    values = {test: np.array([one.tests[test] for one in found]) for test in found[0].tests}
    values["all"] = np.array([one.p_value for one in found])
    assert {"noise against amplitude", "noise against rate", "noise in bursts", "noise level"} < set(values)
    for test, p in values.items():
        assert np.all((p >= 0.0) & (p <= 1.0))
        for rate in RATES:
            assert np.count_nonzero(p < rate) <= binom.ppf(1.0 - CHANCE, trials, rate), (test, rate)


@pytest.mark.slow
def test_the_bound_is_exceeded_by_noise_that_misbehaves():
    """The same count for noise a quarter louder at full rate: it must not pass."""
    trials = 12
    alarms = 0
    for seed in range(trials):
        rng = np.random.default_rng(1000 + seed)

        def louder(time, yaw, rng=rng):
            rate = np.abs(np.gradient(yaw, time))
            return yaw + 0.75 * NOISE * rate / rate.max() * rng.standard_normal(yaw.size)

        alarms += judged(with_records(decays(seed), louder)).p_value < 1e-3
    assert alarms > binom.ppf(1.0 - CHANCE, trials, 1e-3)


def with_bursts(data, share, size, seed=5):
    """A share of the record, in pieces of a tenth of a second, with noise of another size added."""
    rng = np.random.default_rng(seed)

    def change(_time, yaw):
        pieces = np.repeat(rng.uniform(size=yaw.size // 100 + 1) < share, 100)[: yaw.size]
        return yaw + pieces * size * NOISE * rng.standard_normal(yaw.size)

    return with_records(data, change)


@pytest.mark.parametrize(("share", "size", "alarm"), [(0.0, 0.0, False), (0.1, 0.3, False), (0.1, 3.0, True)])
def test_bursts_are_distinguished_from_noise_that_is_nearly_steady(share, size, alarm):
    data = with_bursts(decays(2), share, size)
    noise = campaign_noise(data, Settings().noise)
    p = trend_p_values(noise_trend(data), fit_nominal(prepare(data, noise.variance)), noise)
    assert (p["noise in bursts"] < 1e-6) == alarm
    assert 0.0 < p["noise in bursts"] <= 1.0


def test_the_same_campaign_has_the_same_p_values():
    data = decays(3, resolution=5.1e-4)
    assert judged(data).tests == judged(data).tests


def test_a_level_is_as_certain_as_its_record_is_long():
    short = decays(4, stated_noise=0.75 * NOISE)  # 1.78 times the variance stated, 1.5 times is let pass
    longer = free_decays.campaign(SETTINGS, noise=NOISE, stated_noise=0.75 * NOISE, duration=30.0,
                                  rng=np.random.default_rng(4))  # fmt: skip
    values = []
    for data in (short, longer):
        noise = campaign_noise(data, Settings().noise)
        values.append(level_p_value(fit_nominal(prepare(data, noise.variance)), noise))
    assert 1.0 > values[0] > values[1]
    assert values[1] < 1e-9
    noise = campaign_noise(decays(4), Settings().noise)
    assert level_p_value(fit_nominal(prepare(decays(4), noise.variance)), noise) > 0.999
