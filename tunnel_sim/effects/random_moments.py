"""Random moments on the body with a broad spectrum: of the stream, and of the surroundings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, pi, sqrt
from typing import Any, ClassVar, Self

import numpy as np

from tunnel_sim.effects.base import Drawn
from tunnel_sim.effects.capabilities import AtRandom
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.physics.run_settings import RunSettings, Series, SettingsTable
from tunnel_sim.vocabulary.record import Array

_INTERVAL = 1e-3  # s between samples of the random moment


def _bandwidth() -> Any:
    meaning = "corner frequency of the moment's spectrum"
    return parameter("fb", "Hz", meaning, scale=20.0, lower=0.01, upper=400.0, default=20.0)


@dataclass(frozen=True)
class RandomMoment(AtRandom):
    """A random moment of first order: a standard deviation, and a bandwidth beyond which its spectrum falls.

    Traits of its own:

    - ``source``: the sampled input of a run (`tunnel_sim.physics.run_settings.RunSettings.series`) for the moment;
      its standard deviation has the same unit.
    """

    source: ClassVar[str]
    channel = "forcing"
    fitted = False
    random = "broad_band"

    @property
    def corner(self) -> float:
        """Corner frequency of the moment's spectrum, the second parameter, Hz."""
        return float(getattr(self, self.parameters()[1].name))

    def moment_density(self, rate: float, reference_moment: float) -> float:
        """Spectral intensity of the random moment at the frequency of the motion."""
        corner = 2.0 * pi * self.corner
        per_severity = reference_moment if self.parameters()[0].per_pressure else 1.0
        return 2.0 * (per_severity * self.severity) ** 2 * corner / (corner**2 + rate**2)

    def draw(self, stated: RunSettings, rng: np.random.Generator) -> Array:
        """White noise to be filtered into the random moment; the first value sets its initial state."""
        kicks = rng.standard_normal(int(stated.duration / _INTERVAL) + 2)
        kicks[0] = rng.standard_normal()
        return kicks

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Add the random moments as sampled inputs."""
        speeds = stated.wind_speed.tolist()
        for place, (effect, own, speed) in enumerate(zip(effects, drawn, speeds, strict=True)):
            if not effect.is_null and cls.acts(wind_on=speed > 0.0):
                runs.series[place] = {**runs.series[place], cls.source: cls._moment(effect, own)}

    def _moment(self, drawn: Drawn) -> Series:
        from scipy.signal import lfilter  # imported here because it is slow to load

        white, decay = self.drawn_numbers(drawn), exp(-2.0 * pi * self.corner * _INTERVAL)
        kicks = np.concatenate([white[:1], sqrt(1.0 - decay**2) * white[1:]])
        return Series(tuple((self.severity * lfilter([1.0], [1.0, -decay], kicks)).tolist()), _INTERVAL)


@dataclass(frozen=True)
class Buffeting(RandomMoment):
    """A random moment from the turbulence of the stream."""

    name = "buffeting"
    place = 13
    condition = "wind_on"
    source = "forcing"
    advice = "Reduce the turbulence of the stream, or average over more runs with the wind on"
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

    intensity: float = parameter(
        "s", "1", "standard deviation of the moment coefficient",
        scale=0.003, lower=0.0, upper=1.0, per_pressure=True,
    )  # fmt: skip
    bandwidth: float = _bandwidth()


@dataclass(frozen=True)
class AmbientVibration(RandomMoment):
    """A random moment from the surroundings: floor, microseisms, traffic, draughts.

    A base that shakes at random acts as a moment, too: its angular acceleration times the inertia, or its
    linear acceleration times mass and arm.
    """

    name = "ambient_vibration"
    place = 33
    condition = "always"
    source = "ambient"
    size = "a random moment of {moment}"
    advice = "Isolate the rig from its floor and from draughts, or average over more runs"
    advice_for_joint = "Isolate the base of the machine from vibration, or average over more runs"
    equation = "random moment of standard deviation s, correlated as exp(−2π fb |t − t'|)"
    signature = (
        "In every run, also with the wind off, the decay ends in narrow-band noise at the rig's natural frequency. "
        "The moment is equally strong in all runs."
    )
    references = (
        "Peterson, Observations and modeling of seismic background noise, USGS Open-File Report 93-322 (1993)",
        "Gauss–Markov process: Gillespie, Phys. Rev. E 54 (1996) 2084, doi 10.1103/PhysRevE.54.2084",
    )
    example = (0.1, 8.0)

    moment: float = parameter(
        "s", "N m", "standard deviation of the moment", scale=0.01, lower=0.0, upper=1e4
    )
    bandwidth: float = _bandwidth()
