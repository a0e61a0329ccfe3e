"""A random moment from the turbulence of the stream."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from math import exp, pi, sqrt

import numpy as np

from tunnel_sim.effects.base import Drawn, Effect
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.physics.run_settings import RunSettings, Series
from tunnel_sim.vocabulary.record import Array

_INTERVAL = 1e-3  # s between samples of the random moment


@dataclass(frozen=True)
class Buffeting(Effect):
    """A random moment from the turbulence of the stream.

    Args:
        intensity: standard deviation of the moment coefficient, dimensionless.
        bandwidth: corner frequency of the moment's spectrum, Hz.
    """

    name = "buffeting"
    place = 13
    channel = "forcing"
    condition = "wind_on"
    advice = "Quieten the stream, or average over more runs with the wind on"
    equation = "random moment of standard deviation s ½ρV²Al, correlated as exp(−2π fb |t − t'|)"
    signature = (
        "In wind-on runs the response wanders about the decay; after the decay it continues as "
        "narrow-band noise at the rig's natural frequency."
    )
    references = (
        "Dryden & Kuethe, NACA Report 342 (1930)",
        "Gauss–Markov process: Gillespie, Phys. Rev. E 54 (1996) 2084, doi 10.1103/PhysRevE.54.2084",
    )
    example = (0.02, 8.0)
    autonomous = False
    fitted = False
    random = "broad_band"

    intensity: float = parameter(
        "s",
        "1",
        "standard deviation of the moment coefficient",
        scale=0.003,
        lower=0.0,
        upper=1.0,
        per_pressure=True,
    )
    bandwidth: float = parameter(
        "fb",
        "Hz",
        "corner frequency of the moment's spectrum",
        scale=20.0,
        lower=0.01,
        upper=400.0,
        default=20.0,
    )

    def draw(self, stated: RunSettings, rng: np.random.Generator) -> Array:
        """White noise that is filtered into the random moment; the first value sets its initial state."""
        kicks = rng.standard_normal(int(stated.duration / _INTERVAL) + 2)
        kicks[0] = rng.standard_normal()
        return kicks

    def on_run(self, run: RunSettings, stated: RunSettings, drawn: Drawn) -> RunSettings:
        """Add the random moment as a sampled forcing."""
        if stated.wind_speed <= 0.0 or self.is_null:
            return run
        white = self.drawn_numbers(drawn)
        from scipy.signal import lfilter  # here, because it is slow to load

        decay = exp(-2.0 * pi * self.bandwidth * _INTERVAL)
        kicks = np.concatenate([white[:1], sqrt(1.0 - decay**2) * white[1:]])
        series = Series(tuple((self.intensity * lfilter([1.0], [1.0, -decay], kicks)).tolist()), _INTERVAL)
        return dataclasses.replace(run, series={**run.series, "forcing": series})
