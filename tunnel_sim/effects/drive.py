"""Effects of the input of a driven run."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from tunnel_sim.effects.base import Drawn, Effect
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.physics.run_settings import RunSettings


@dataclass(frozen=True)
class InputDelay(Effect):
    """An input that acts later than its time stamps say.

    The shifted input is exact for both holds, for any delay and not only whole samples: the integrator ends a step
    at each of its kinks, wherever they fall. The motion is therefore continuous in the delay. What the record does
    not hold is not known: the input keeps its first value until its first sample acts, and its last value after its
    last sample (where the delay is negative).

    Args:
        delay: between stamp and action, s; negative where the stamps are late.
    """

    name = "input_delay"
    place = 26
    channel = "calibration"
    condition = "always"
    advice = (
        "Record input and angle with one clock and equal filters, or correct the stamps of the input by τ"
    )
    equation = "u(t − τ) instead of the stated input u(t), in driven runs"
    signature = (
        "In driven runs the phase between input and angle falls by ωτ, over the whole band and in proportion to "
        "the frequency; a free decay does not change."
    )
    references = ("Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999",)
    example = (0.02,)
    autonomous = False
    driven = True

    delay: float = parameter(
        "τ",
        "s",
        "time by which the input acts later than its stamp",
        scale=0.002,
        lower=-1.0,
        upper=1.0,
        fit_lower=-0.05,  # s, of a resonance of 2 Hz: a tenth of a period early
        fit_upper=0.2,  # and four tenths of one late, below the delay that turns the phase by half a turn
    )

    def on_run(self, run: RunSettings, stated: RunSettings, drawn: Drawn) -> RunSettings:
        """Shift the input; a free decay has none."""
        del stated, drawn
        if self.is_null or run.drive is None:
            return run
        later = dataclasses.replace(run.drive, delay=run.drive.delay + self.delay)
        return dataclasses.replace(run, drive=later)
