"""Turning points identified by their own likelihood. Truth: closed-form decays, read late and beside by chance."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest

from identification.signal.turning_points import fit_turning_points
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.turning_points import LEAST, TurningPoints, are_turning_points

OMEGA, ZETA, ZERO, SWING = 4.65, 0.02, 0.03, 0.35
TIME_STD, ANGLE_STD = 0.02, 2e-3


def points(seed: int, count: int = 60, *, stated: bool = False) -> TurningPoints:
    rng = np.random.default_rng(seed)
    k = np.arange(count)
    damped, delta = OMEGA * sqrt(1.0 - ZETA**2), pi * ZETA / sqrt(1.0 - ZETA**2)
    time = 1.3 + k * pi / damped + TIME_STD * rng.standard_normal(count)
    angle = ZERO + SWING * (-1.0) ** k * np.exp(-delta * k) + ANGLE_STD * rng.standard_normal(count)
    stds = (np.full(count, TIME_STD), np.full(count, ANGLE_STD)) if stated else (None, None)
    return TurningPoints("a", time, angle, *stds)


@pytest.mark.parametrize("stated", [False, True])
def test_values_are_right_within_their_standard_deviations(stated: bool) -> None:
    fits = [fit_turning_points(points(seed, stated=stated)) for seed in range(400)]
    for name, truth in (
        ("omega_n", OMEGA),
        ("zeta", ZETA),
        ("zero", ZERO),
        ("first_swing", SWING),
        ("period", 2.0 * pi / (OMEGA * sqrt(1.0 - ZETA**2))),
        ("decrement", 2.0 * pi * ZETA / sqrt(1.0 - ZETA**2)),
    ):
        values = [getattr(fit, name) for fit in fits]
        z = np.array([(one.value - truth) / one.std for one in values])
        # The mean and the standard deviation of 400 ratios, each within four standard deviations of its own.
        assert abs(z.mean()) < 4.0 / sqrt(z.size), name
        assert abs(z.std() - 1.0) < 4.0 / sqrt(2.0 * z.size) + 0.02, name


def test_scatter_beyond_what_is_stated_is_said_and_used() -> None:
    given = points(1)
    few = np.full(given.time_s.size, 0.25 * TIME_STD)
    fit = fit_turning_points(TurningPoints("a", given.time_s, given.angle_rad, few, None))
    assert any("times scatter" in line and "times as stated" in line for line in fit.remarks)
    assert fit.omega_n.std == pytest.approx(fit_turning_points(given).omega_n.std, rel=1e-6)


def test_what_bends_is_said_at_its_rate() -> None:
    said = [" ".join(fit_turning_points(points(seed)).remarks) for seed in range(400)]
    for word in ("the period changes", "the decrement changes"):
        # At a rate of 1 % of 400: 13 or fewer in all but one in ten thousand cases.
        assert sum(word in line for line in said) <= 13, word
    given = points(3)
    k = given.half_periods
    dry = np.maximum(SWING - 0.005 * k, 0.0) * (-1.0) ** k + 1e-4 * np.random.default_rng(1).standard_normal(
        k.size
    )
    fit = fit_turning_points(TurningPoints("a", given.time_s, dry))
    assert any("the damping is not viscous" in line for line in fit.remarks)
    slower = given.time_s - 2e-3 * k + 1e-4 * k**2
    assert any(
        "ωn is a mean" in line
        for line in fit_turning_points(TurningPoints("a", slower, given.angle_rad)).remarks
    )


def test_two_missing_turning_points_are_counted() -> None:
    given = points(2)
    kept = np.delete(np.arange(given.time_s.size), [10, 11])
    fit = fit_turning_points(TurningPoints("a", given.time_s[kept], given.angle_rad[kept]))
    assert abs(fit.omega_n.value - OMEGA) < 4.0 * fit.omega_n.std
    assert abs(fit.zeta.value - ZETA) < 4.0 * fit.zeta.std
    assert are_turning_points(given.time_s[kept], given.angle_rad[kept])


def record(rate: float) -> tuple[Array, Array]:
    time = np.arange(0.0, 20.0, 1.0 / rate)
    return time, SWING * np.exp(-ZETA * OMEGA * time) * np.cos(OMEGA * time)


def test_records_and_noise_are_not_turning_points() -> None:
    for rate in (2.0, 5.0, 20.0, 200.0):
        assert not are_turning_points(*record(rate))
    for seed in range(200):
        noise = np.random.default_rng(seed).standard_normal(20)
        assert not are_turning_points(np.arange(20.0), noise)
    given = points(1)
    assert are_turning_points(given.time_s[:LEAST], given.angle_rad[:LEAST])
    assert not are_turning_points(given.time_s[: LEAST - 1], given.angle_rad[: LEAST - 1])


@pytest.mark.parametrize(
    "time_s", [np.full(20, 2e93), np.arange(20.0) * 5e-324 + 1e300 * (np.arange(20) > 18)]
)
def test_times_that_no_clock_gives_are_not_turning_points(time_s: Array) -> None:
    assert not are_turning_points(time_s, 1e300 * (-1.0) ** np.arange(20))
