"""The spring's after-effect against relaxing elements, integrated by SciPy.

A loss that is the same at all frequencies is that of Maxwell elements of all relaxation times. Released from where
it was held for long, such a spring pulls the body back to that side, less and less.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from tests.analytic.law_cases import RIG
from tests.support.acting import acting
from tunnel_sim.effects import effect_from
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.plan import AeroDerivatives
from tunnel_sim.vocabulary.record import Array

SPRING, INERTIA, LOSS, RELEASE, LENGTH = 21.02, 0.1014, 0.01, 0.3, 10.0
RATE = 100.0
TIMES = np.geomspace(1e-3, LENGTH, 25)  # relaxation times, s


def elements() -> tuple[Array, Array]:
    """Time and angle of a body on a spring with relaxing elements in parallel, held at its release for long."""
    modulus = 2.0 * LOSS * SPRING / np.pi * np.log(TIMES[1] / TIMES[0])
    square = (SPRING / INERTIA) * TIMES**2
    elastic = modulus * np.sum(
        square / (1.0 + square)
    )  # at the natural frequency: part of the stated stiffness

    def slopes(_: float, state: Array) -> Array:
        angle, rate, yielded = state[0], state[1], state[2:]
        moment = -SPRING * angle - modulus * np.sum(angle - yielded) + elastic * angle
        return np.concatenate([[rate, moment / INERTIA], (angle - yielded) / TIMES])

    time = np.arange(0.0, LENGTH, 1.0 / RATE)
    start = np.concatenate([[RELEASE, 0.0], np.full(TIMES.size, RELEASE)])
    found = solve_ivp(slopes, (0.0, LENGTH), start, t_eval=time, method="LSODA", rtol=1e-9, atol=1e-11)
    return time, found.y[0]


def centre(time: Array, angle: Array) -> Array:
    """Means over the cycles from 1 s on, less their own mean: a constant is the sensor's zero."""
    period = 2.0 * np.pi * np.sqrt(INERTIA / SPRING)
    edges = np.arange(1.0, time[-1] - period, period)
    fine = np.arange(0.0, period, 1e-3)
    means = np.array([np.interp(edge + fine, time, angle).mean() for edge in edges])
    return means - means.mean()


def settings(after_effect: float, release: float = RELEASE) -> RunSettings:
    stated = RunSettings(
        SPRING, AeroDerivatives(0.0, 0.0), INERTIA, 0.0, release_angle=release, duration=LENGTH, timestep=1e-3
    )
    effect = effect_from("structural_damping", {"loss_factor": LOSS, "after_effect": after_effect})
    return acting(effect, stated)


def modelled(after_effect: float, release: float = RELEASE) -> Array:
    return forward_motion(RIG, settings(after_effect, release), RATE).angle


def test_the_centre_creeps_as_with_elements_of_all_relaxation_times():
    time, angle = elements()
    still, creeping = (centre(time, modelled(m)[: time.size]) for m in (0.0, 1.0))
    expected, shape = centre(time, angle) - still, creeping - still
    assert expected[0] > 1e-3  # from the side of the release
    assert expected[-1] < -5e-4
    # the longest relaxation time is the length of the run: faster ones alone creep less towards its end
    factor = float(shape @ expected / (shape @ shape))
    assert 0.6 < factor < 0.9
    assert np.std(expected - factor * shape) < 0.1 * np.std(expected)
    assert np.std(expected) > 3.0 * np.std(still)


def test_it_is_in_proportion_to_the_release():
    one, other = (modelled(1.0, sign * RELEASE) for sign in (1.0, -1.0))
    np.testing.assert_allclose(one, -other, atol=1e-12)
