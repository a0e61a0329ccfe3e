"""A second oscillation beside the first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import NEAR_MOTION, Drawn, Effect
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.record import Array

_LEAST_DAMPING = 1e-4  # of a structure: judgement; a line that does not decay is not a mode
_DECAYS = 1.01  # a fit that ends at the least damping has found a line that something drives
_SLOWEST = 0.1  # of the motion's frequency: judgement; what is slower is a drift in a record of ten cycles
_REFERENCE_RELEASE = 0.35  # rad: where all exponents give the same amplitude


@dataclass(frozen=True)
class SecondMode(Effect):
    """A second oscillation beside the first, as of a bending sting or a coupled freedom.

    Args:
        amplitude: amplitude at the release, rad.
        frequency: undamped angular frequency, rad/s.
        damping_ratio: share of critical damping, dimensionless.
        exponent: power of the release angle that the amplitude follows, dimensionless; 0 is the textbook's.
    """

    name = "second_mode"
    place = 24
    channel = "sensor"
    condition = "always"
    advice = "Stiffen what oscillates beside the body, or model both modes"
    equation = (
        "y = β + a exp(−ζ2 ω2 t) cos(ω2 t + φ), φ drawn for every run; other form: a (|β0|/0.35 rad)^n for a, "
        "β0 the release angle"
    )
    signature = "A decaying line from the release on, at one frequency whatever the spring and the wind."
    references = ("Meirovitch, Fundamentals of Vibrations, McGraw-Hill 2001",)
    example = (0.005, 60.0, 0.01)
    autonomous = False
    line = "ringing"
    ahead_of_sensor = True

    amplitude: float = parameter(
        "a", "rad", "amplitude at the release", scale=0.002, lower=0.0, upper=1.0, default=0.0
    )
    frequency: float = parameter(
        "ω2", "rad/s", "undamped angular frequency", scale=50.0, lower=0.01, upper=1e5, default=50.0
    )
    damping_ratio: float = parameter(
        "ζ2",
        "1",
        "share of critical damping",
        scale=0.01,
        lower=0.0,
        upper=0.9,
        default=0.01,
        fit_lower=_LEAST_DAMPING,
        fit_upper=0.2,
    )
    exponent: float = parameter(
        "n", "1", "power of the release angle", scale=1.0, lower=0.0, upper=3.0, default=0.0, form=True
    )

    def plausible(self, omega: float) -> bool:
        """Whether it is an oscillation of its own: it decays, is not the motion's, and not as slow as a drift."""
        decays = self.damping_ratio > _DECAYS * _LEAST_DAMPING
        return (
            decays and self.frequency > _SLOWEST * omega and abs(self.frequency / omega - 1.0) > NEAR_MOTION
        )

    def oscillation(
        self, time_s: Array, stated: RunSettings, drawn: Drawn, derivative: int = 0
    ) -> Array | None:
        """The second oscillation, at a phase of the run's own."""
        if self.is_null:
            return None
        phase = self.drawn_number(drawn)
        size = self.amplitude * (abs(stated.release_angle) / _REFERENCE_RELEASE) ** self.exponent
        since = np.maximum(time_s, 0.0)  # the body is held before the release
        turn = self.frequency * since
        # a derivative multiplies exp(s t) by s, s = ω2 (i − ζ2)
        factor, lead = (
            self.frequency * np.hypot(1.0, self.damping_ratio),
            np.arctan2(1.0, -self.damping_ratio),
        )
        wave = (
            size
            * factor**derivative
            * np.exp(-self.damping_ratio * turn)
            * np.cos(turn + phase + derivative * lead)
        )
        return np.asarray(wave if derivative == 0 else np.where(time_s >= 0.0, wave, 0.0), np.float64)
