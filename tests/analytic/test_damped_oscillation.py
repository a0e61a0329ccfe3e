"""The closed form against an ODE solver, its derivatives against differences, and its continuity."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from identification.signal.free_decay import (
    Decay,
    envelope_amplitude,
    free_decay,
    response_rows,
    sensitivity_weights,
)

TIME = np.linspace(0.0, 6.0, 601)
DECAYS = [
    Decay.from_modal(omega, zeta)
    for omega in (0.7, 12.6, 26.0)
    for zeta in (-0.01, 0.0, 0.001, 0.05, 0.35, 0.999, 1.0, 1.001, 1.7, 6.0)
] + [Decay(0.3, 0.0), Decay(0.2, -0.5)]


def by_ode(decay, angle, rate):
    solution = solve_ivp(
        lambda _, state: (state[1], -2.0 * decay.rate * state[1] - decay.stiffness * state[0]),
        (0.0, TIME[-1]),
        (angle, rate),
        method="DOP853",
        t_eval=TIME,
        rtol=1e-12,
        atol=1e-13,
    )
    return solution.y[0]


@pytest.mark.parametrize("decay", DECAYS, ids=str)
def test_matches_the_equation_of_motion(decay):
    expected = by_ode(decay, 0.35, -1.2)
    got = free_decay(TIME, decay, 0.35, -1.2)
    np.testing.assert_allclose(got, expected, atol=2e-9 * np.abs(expected).max())


@pytest.mark.parametrize("decay", DECAYS, ids=str)
def test_derivatives_match_differences(decay):
    angle, rate = 0.35, -1.2
    analytic = sensitivity_weights(decay, angle, rate) @ response_rows(TIME, decay)
    steps = (1e-4, 1e-4 * max(abs(decay.stiffness), 1.0))
    for row, (step_rate, step_stiffness) in zip(analytic, ((steps[0], 0.0), (0.0, steps[1])), strict=True):
        # Five-point differences: error of order step⁴.
        def at(multiple, dr=step_rate, dk=step_stiffness):
            return free_decay(
                TIME, Decay(decay.rate + multiple * dr, decay.stiffness + multiple * dk), angle, rate
            )

        numeric = (8.0 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12.0 * (step_rate + step_stiffness))
        np.testing.assert_allclose(row, numeric, atol=1e-6 * max(np.abs(row).max(), 1e-9))


def test_critical_damping_is_no_seam():
    critical = free_decay(TIME, Decay(3.0, 9.0), 1.0, 0.5)
    for offset in (1e-12, -1e-12, 1e-7, -1e-7):
        near = free_decay(TIME, Decay(3.0, 9.0 + offset), 1.0, 0.5)
        np.testing.assert_allclose(near, critical, atol=2.0 * abs(offset) + 1e-15)


def test_heavy_overdamping_neither_overflows_nor_cancels():
    decay = Decay(1e4, 1.0)  # roots near −2e4 and −5e−5
    got = free_decay(np.array([0.0, 1e-3, 1e3]), decay, 1.0, 0.0)
    root = decay.stiffness / (decay.rate + np.sqrt(decay.rate**2 - 1.0))
    np.testing.assert_allclose(got, np.exp(-root * np.array([0.0, 1e-3, 1e3])), rtol=1e-7)


def test_envelope_touches_the_oscillation():
    decay = Decay.from_modal(12.0, 0.02)
    amplitude = envelope_amplitude(decay, 0.2, 1.5)
    fine = np.linspace(0.0, 20.0, 400001)
    response = free_decay(fine, decay, 0.2, 1.5)
    ratio = np.abs(response) / (amplitude * np.exp(-decay.rate * fine))
    assert ratio.max() == pytest.approx(1.0, abs=1e-6)
