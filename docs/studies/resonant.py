"""A policy for the operator preset of ``FreeDecay-v0``: it keeps the body swinging.

A planned drive is tuned to the expected resonance. Feedback finds the actual one: the moment has the sign of the
rate while the swing is smaller than desired.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tunnel_sim.envs.engines import operator_action
from tunnel_sim.envs.episode_conditions import FreeDecayConfig
from tunnel_sim.envs.information import propagator
from tunnel_sim.vocabulary.arguments import Number

_FOLLOWS = 0.5  # gain of the observer in a sixth of a cycle
_BAND = 0.05  # share of the amplitude within which the moment is reduced


class Resonant:
    """Push in the direction of the rate below an amplitude, and against it above.

    An observer estimates angle and rate: an undamped oscillator, driven by the applied moment and corrected by
    every reading. The moment follows from their prediction for the coming period.

    Args:
        config: configuration of the environment.
        stiffness: stiffness of spring and air together, N m/rad; an error of a few per cent is harmless.
        inertia: Izz, kg m²; an error of a few per cent is harmless.
        wind_speed: wind-speed set-point, m/s.
        amplitude: desired amplitude of the swing, rad.

    Raises:
        EnvError: when stiffness, inertia or amplitude is not a positive number.
    """

    def __init__(
        self,
        config: FreeDecayConfig,
        *,
        stiffness: float,
        inertia: float,
        wind_speed: float,
        amplitude: float,
    ) -> None:
        for name, value, unit in (
            ("stiffness", stiffness, "N m/rad"),
            ("inertia", inertia, "kg m2"),
            ("amplitude", amplitude, "rad"),
        ):
            Number(above=True, unit=unit).checked(value, name, "excitation")
        self.config, self.wind_speed, self.amplitude = config, wind_speed, amplitude
        self.stiffness, self.omega = stiffness, float(np.sqrt(stiffness / inertia))
        still, square = np.zeros(1), np.array([self.omega**2])
        interval = 1.0 / config.sample_rate
        self._step = np.array(propagator(still, square, interval)).reshape(2, 2)
        self._ahead = np.array(propagator(still, square, 0.5 * config.control_period)).reshape(2, 2)
        share = 1.0 - (1.0 - _FOLLOWS) ** (self.omega * interval)  # a radian is a sixth of a cycle
        self._gain = share * np.array([1.0, self.omega])
        self.state: np.ndarray[Any, Any] | None = None
        self._centre = 0.0  # centre of the oscillation under the moment of the last period, rad

    def __call__(self, observation: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """The action for the period after an observation, shape (2,)."""
        readings = observation[:-2]
        if self.state is None:  # the body is fixed at its angle
            self.state = np.array([float(np.mean(readings)), 0.0])
        else:
            shift = np.array([self._centre, 0.0])
            for reading in readings:
                self.state = self.state + self._gain * (reading - self.state[0])
                self.state = shift + self._step @ (self.state - shift)
        swing = float(np.hypot(self.state[0], self.state[1] / self.omega))
        rate = (self._ahead @ self.state)[1]
        short = np.clip((1.0 - swing / self.amplitude) / _BAND, -1.0, 1.0)
        moment = float(self.config.moment_limit * short * np.sign(rate))
        self._centre = moment / self.stiffness
        return operator_action(self.config, wind_speed=self.wind_speed, moment=moment)
