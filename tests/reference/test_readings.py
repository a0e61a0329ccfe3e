"""The sensor's laws of the reference simulator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.reference.rigs import rig
from tunnel_reference import readings as r
from tunnel_reference.integrator import integrate
from tunnel_reference.readings import Order, ReadingTerm, SensorSignal, read_motion


@pytest.fixture(scope="module")
def swing():
    c = rig()
    return c, integrate([c], [[]], substeps=2)[0]


def read(swing, *terms, seed=0, **changes):
    c, motion = swing
    return read_motion(rig(**changes) if changes else c, motion, terms, np.random.default_rng(seed))


def law(function, order, **params):
    return ReadingTerm(function, order, {k: np.full(2, float(v)) for k, v in params.items()})


def test_noise_and_rounding_have_the_stated_power(swing):
    c, motion = swing
    error = read(swing) - motion.angle - c.zero
    assert np.mean(error**2) == pytest.approx(c.noise_power, rel=0.05)
    steps = read(swing) / c.resolution
    assert np.max(np.abs(steps - np.round(steps))) < 1e-6


def test_the_same_seed_gives_the_same_noise_whatever_the_effects(swing):
    plain = read(swing, noise_std=4e-4, resolution=1e-12)
    drifted = read(swing, law(r.drift, Order.ADDED, drift=0.01, exponent=1), noise_std=4e-4, resolution=1e-12)
    c, _ = swing
    assert drifted - plain == pytest.approx(np.tile(0.01 * c.time[:, None] / c.duration, 2), abs=1e-11)


def test_backlash_lags_by_its_half_width_on_the_way(swing):
    c, motion = swing
    half = np.full(2, 0.002)
    out = r.backlash(
        SensorSignal(motion.angle, motion, c, np.random.default_rng(0)), {"half": half, "start": 0 * half}
    )
    gap = motion.angle - out
    assert np.max(np.abs(gap)) <= 0.002 + 1e-12
    fast = np.abs(motion.rate) > 0.8 * np.max(np.abs(motion.rate), axis=0)
    assert gap[fast] == pytest.approx(0.002 * np.sign(motion.rate[fast]), abs=1e-9)


def test_backlash_is_rate_independent(swing):
    c, motion = swing
    params = {"half": np.full(2, 0.002), "start": np.zeros(2)}
    slow = r.backlash(SensorSignal(motion.angle, motion, c, np.random.default_rng(0)), params)
    quick_motion = replace(motion, rate=2.0 * motion.rate)
    quick = r.backlash(
        SensorSignal(motion.angle, quick_motion, rig(sample_rate=2000.0), np.random.default_rng(0)), params
    )
    assert np.max(np.abs(slow - quick)) < 1e-12


def test_curves_agree_with_their_cubic_at_small_angles(swing):
    c, motion = swing
    small = 0.1 * motion.angle
    for s in (-0.5, 0.5):
        reading = SensorSignal(small, motion, c, np.random.default_rng(0))
        cubic = r.cubic_curve(reading, {"s": np.full(2, s)})
        for other in (r.sine_curve, r.tangent_curve):
            assert np.max(np.abs(other(reading, {"s": np.full(2, s)}) - cubic)) < 3e-8


def test_loaded_potentiometer_has_unit_slope_at_zero(swing):
    c, motion = swing
    for value in (0.0, 1e-5):
        out = r.loaded_potentiometer(
            SensorSignal(np.full((1, 2), value), motion, c, np.random.default_rng(0)), {"s": np.full(2, 0.3)}
        )
        assert out == pytest.approx(np.full((1, 2), value), rel=1e-3, abs=1e-12)


def test_limits(swing):
    hard = read(swing, law(r.clipping, Order.LIMIT, limit=0.2, lower=1))
    upper = read(swing, law(r.clipping, Order.LIMIT, limit=0.2, lower=0))
    soft = read(swing, law(r.soft_clipping, Order.LIMIT, limit=0.2, knee=0.2))
    c, _ = swing
    assert np.max(np.abs(hard)) <= 0.2 + c.resolution
    assert np.min(upper) < -0.25
    assert np.max(np.abs(soft)) < 0.2 + c.resolution
    low = np.abs(read(swing)) < 0.15
    assert np.array_equal(soft[low], read(swing)[low])


def test_coarse_rounding_has_its_power(swing):
    c, motion = swing
    out = read(swing, law(r.coarse_rounding, Order.ROUNDING, step=0.004))
    assert np.mean((out - motion.angle) ** 2) == pytest.approx(c.noise_std**2 + 0.004**2 / 12, rel=0.05)
