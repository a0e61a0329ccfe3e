"""A sensor whose gain changes with the angle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Drawn, Effect
from tunnel_sim.effects.parameters import Circumstances, Trial, exponent, parameter
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.record import Array

_REFERENCE = 0.2  # rad: angle at which every exponent gives the same error


@dataclass(frozen=True)
class SensorNonlinearity(Effect):
    """A sensor whose gain changes with the angle.

    Args:
        coefficient: cubic coefficient, 1/rad2.
        exponent: power of the angle in the error (unchanged at 0.2 rad), dimensionless; 3 in the textbook form.
        quadratic: coefficient of an additional quadratic error, 1/rad; 0 in the textbook form.
    """

    name = "sensor_nonlinearity"
    place = 16
    channel = "sensor"
    condition = "always"
    advice = "Calibrate the sensor over the whole swing"
    equation = "y = β + s β³; general form: |β|^p sgn β for β³, plus q β²"
    signature = (
        "A third harmonic of s A³/4; the frequency is unchanged, and the decay looks faster by the relative "
        "amount (3/2) s A² for every spring and wind speed."
    )
    references = ("Doebelin, Measurement Systems, McGraw-Hill 2003",)
    example = (0.2,)

    coefficient: float = parameter(
        "s", "1/rad2", "cubic coefficient", scale=0.05, lower=-1e6, upper=1e6, fit_lower=-1.0, fit_upper=1.0
    )

    exponent: float = exponent("p", "power of the angle in the error (unchanged at 0.2 rad)", 3.0)

    quadratic: float = parameter(
        "q",
        "1/rad",
        "coefficient of an additional quadratic error",
        scale=0.02,
        lower=-1e6,
        upper=1e6,
        fit_lower=-1.0,
        fit_upper=1.0,
        form=True,
    )

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """First a cubic error, then one that is mostly quadratic."""
        scale = {info.name: info.scale for info in cls.parameters()}
        mostly_square = {"coefficient": 0.01 * scale["coefficient"], "quadratic": scale["quadratic"]}
        return [*super().trials(campaign), Trial(mostly_square, "quadratic")]

    def on_angle(self, angle: Array, time_s: Array, stated: RunSettings, drawn: Drawn) -> Array:
        """Apply the nonlinear characteristic."""
        del time_s, stated, drawn
        if self.is_null:
            return angle
        if self.exponent == 3.0:
            cubed = angle**3
        else:
            cubed = np.sign(angle) * _REFERENCE**3 * (np.abs(angle) / _REFERENCE) ** self.exponent
        shown = angle + self.coefficient * cubed
        return shown if self.quadratic == 0.0 else shown + self.quadratic * angle**2
