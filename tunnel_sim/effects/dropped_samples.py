"""Samples missing without a gap in the time stamps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tunnel_sim.effects.base import Drawn, Effect
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.record import Array

_MARGIN = 0.1  # s of motion beyond what is read: samples need not divide the time lost


@dataclass(frozen=True)
class DroppedSamples(Effect):
    """Samples missing without a gap in the time stamps.

    Args:
        lost_time: time that the missing samples would have taken, s; an equal part at each instant.
    """

    name = "dropped_samples"
    place = 25
    channel = "calibration"
    condition = "always"
    advice = "Replace the logger, or state the time of every sample"
    equation = (
        "y(t) = β(t) until the instant and β(t + τ) after it, shared out over one sample interval; "
        "the instant is drawn for every run. With n instants in a run, τ/n is lost at each"
    )
    signature = (
        "The phase jumps at an instant of a run; before and after it frequency and damping are the same."
    )
    references = ("Doebelin, Measurement Systems, McGraw-Hill 2003",)
    example = (0.02,)
    autonomous = False
    skips = True

    lost_time: float = parameter(
        "τ", "s", "time that the missing samples would have taken", scale=0.005, lower=0.0, upper=1.0
    )

    def draw(self, stated: RunSettings, rng: np.random.Generator) -> Drawn:
        """The instant, as a share of the run, well inside it."""
        del stated
        return float(rng.uniform(0.1, 0.9))

    def on_run(self, run: RunSettings, stated: RunSettings, drawn: Drawn) -> RunSettings:
        """Let the motion go on for as long as it is read."""
        del stated
        if self.is_null:
            return run
        self._instants(drawn)  # an error here, before the motion is computed
        return replace(run, duration=run.duration + self.lost_time + _MARGIN)

    def on_time(self, time_s: Array, stated: RunSettings, drawn: Drawn) -> Array:
        """The true time runs ahead of the stamps from every instant on."""
        if self.is_null:
            return time_s
        instants = self._instants(drawn) * stated.duration
        interval = time_s[1] - time_s[0]
        after = sum(np.clip((time_s - instant) / interval + 0.5, 0.0, 1.0) for instant in instants)
        return np.asarray(time_s + self.lost_time * (after / instants.size), np.float64)

    def _instants(self, drawn: Drawn) -> Array:
        """Shares of the run, shape (n,)."""
        return drawn if isinstance(drawn, np.ndarray) else np.array([self.drawn_number(drawn)])
