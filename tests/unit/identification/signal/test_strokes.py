"""Energy lost between reversals, against motions in closed form and against integrals of known laws."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from identification.signal.strokes import reversals, strokes

INERTIA, STIFFNESS, FRICTION, RELEASE = 0.1, 16.0, 0.02, 0.35
OMEGA = np.sqrt(STIFFNESS / INERTIA)
RATE = 2000.0  # Hz


def dry_decay(time):
    """Dry friction: half cycles about ±Tc/K, each of the frequency without friction (Feeny & Liang 1996)."""
    half = np.floor(time * OMEGA / np.pi)
    amplitude = RELEASE - (2.0 * half + 1.0) * FRICTION / STIFFNESS
    return amplitude * np.cos(OMEGA * time) + (-1.0) ** half * FRICTION / STIFFNESS


def test_dry_friction_takes_its_moment_times_the_way():
    time = np.arange(0.0, 3.9, 1.0 / RATE)
    angle = dry_decay(time) + 0.01  # a centre of its own
    turns = reversals(angle, 0.01)
    np.testing.assert_allclose(time[turns], np.pi / OMEGA * np.arange(1, turns.size + 1), atol=1.0 / RATE)
    found = strokes(angle, turns, STIFFNESS, centre=0.01)
    np.testing.assert_allclose(found.lost / found.travel, FRICTION, rtol=5e-4)
    extremes = 0.01 + (RELEASE - 2.0 * FRICTION / STIFFNESS * np.arange(1, turns.size + 1)) * (
        -1.0
    ) ** np.arange(1, turns.size + 1)
    np.testing.assert_allclose(found.angle, extremes, atol=2e-4)


def integrated(law, duration, moment=lambda _: 0.0, stiffness=STIFFNESS, start=(RELEASE, 0.0)):
    """A motion with a smooth law of the rate, by SciPy."""

    def slope(time, state):
        angle, rate = state
        return rate, (moment(time) - law(rate) - stiffness * angle) / INERTIA

    time = np.arange(0.0, duration, 1.0 / RATE)
    found = solve_ivp(slope, (0.0, duration), start, t_eval=time, rtol=1e-10, atol=1e-12)
    return time, found.y[0]


def test_viscous_damping_takes_the_moment_of_the_rate_along_the_way():
    damping = 0.02
    _, angle = integrated(lambda rate: damping * rate, 3.0)
    turns = reversals(angle, 0.01)
    found = strokes(angle, turns, STIFFNESS)
    sigma, wd = damping / (2.0 * INERTIA), np.sqrt(OMEGA**2 - (damping / (2.0 * INERTIA)) ** 2)
    for number in range(turns.size - 1):
        first = np.pi / wd * (number + 1)

        def power(at):
            rate = -RELEASE * OMEGA**2 / wd * np.exp(-sigma * at) * np.sin(wd * at)
            return damping * rate**2

        assert found.lost[number] == pytest.approx(quad(power, first, first + np.pi / wd)[0], rel=2e-3)


def test_a_driven_body_that_nothing_holds_loses_the_work_of_its_input():
    def push(time):
        return 0.4 * np.sin(6.0 * time)

    damping = 0.05
    time, angle = integrated(lambda rate: damping * rate, 12.0, push, 0.0, (0.0, 0.0))
    turns = reversals(angle, 0.05)
    found = strokes(angle, turns, 0.0, push(time))
    rate = np.gradient(angle, time)
    taken = np.concatenate([[0.0], np.cumsum(damping * rate[:-1] ** 2 / RATE)])
    assert turns.size > 8
    np.testing.assert_allclose(found.lost, np.diff(taken[turns]), rtol=5e-3)


def test_noise_makes_no_reversals_and_its_part_in_the_extremes_is_stated():
    time = np.arange(0.0, 4.0, 1.0 / 200.0)
    clean, noise = dry_decay(time), 5e-4
    turns = reversals(clean, 0.01)
    rng = np.random.default_rng(3)
    found = [strokes(clean + rng.normal(0.0, noise, time.size), turns, STIFFNESS) for _ in range(300)]
    scatter = np.std([one.angle for one in found], axis=0)
    np.testing.assert_allclose(scatter, noise * strokes(clean, turns, STIFFNESS).spread, rtol=0.25)
    noisy = reversals(clean + rng.normal(0.0, noise, time.size), 10.0 * noise)
    assert noisy.size <= turns.size + 1  # the release, where the body is at rest, may count
    assert np.max(np.abs(noisy[-turns.size :] - turns)) < 5
    assert reversals(np.zeros(100), 0.01).size == 0
    assert reversals(np.linspace(0.0, 1.0, 100), 0.01).size == 0
