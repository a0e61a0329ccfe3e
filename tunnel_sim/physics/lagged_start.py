"""The state of the aerodynamic lag at the start of a run that is already in motion."""

from __future__ import annotations

import numpy as np

from tunnel_sim.physics.run_settings import SettingsTable
from tunnel_sim.vocabulary.quantities import Angles, DurationPerRun
from tunnel_sim.vocabulary.rig import Rig

_ITERATIONS = 4  # the lag changes the root by a part of the air's small share of the stiffness
_LARGEST = 100.0  # of an exponent


def lagged_at_start(runs: SettingsTable, rig: Rig, since_release: DurationPerRun) -> Angles:
    """The angle that the air sees at the start of runs with rigid rods, rad, shape (runs,).

    The body is held at its angle, released from rest, and oscillates linearly until the run starts. The state is
    the response of the lag to this oscillation, and the rest of its state at the release, which fades with the
    time constant.

    Args:
        runs: with the angle and the rate at the start.
        since_release: time from the release to the start; 0: the run starts at its release.
    """
    angle, rate, inertia = runs["release_angle"], runs["release_rate"], runs["yaw_inertia"]
    found = angle.copy()
    moving = (runs["aero_lag"] != 0.0) & (runs.wind_speed > 0.0) & (since_release > 0.0)
    if not moving.any():
        return found
    air, air_damping = runs.air(rig)
    decay = 0.5 * (runs["mechanical_damping"] - air_damping) / inertia
    lag = runs["aero_lag"] * rig.body.length / np.where(moving, runs.wind_speed, 1.0)
    time = np.where(moving, np.abs(lag), 1.0)
    # a fit may try a law that does not oscillate, or diverges
    with np.errstate(all="ignore"):
        response = np.ones(len(runs), np.complex128)
        for _ in range(_ITERATIONS):
            seen = np.where(lag < 0.0, 2.0 - response, response)
            stiffness = runs.spring_stiffness - air * seen
            root = -decay + 1j * np.sqrt(stiffness / inertia - decay**2)
            response = 1.0 / (1.0 + root * time)
        amplitude = angle + 1j * (root.real * angle - rate) / root.imag
        back = np.exp(
            np.clip(-root.real * since_release, -_LARGEST, _LARGEST) - 1j * root.imag * since_release
        )
        held = (amplitude * back).real - (amplitude * back * response).real
        state = (amplitude * response).real + held * np.exp(-since_release / time)
    return np.where(moving & np.isfinite(state), state, found)
