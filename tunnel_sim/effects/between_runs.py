"""Chance differences between runs: of the wind speed, the spring and the mechanical damping.

Each run draws its own deviation. No single run shows it, and no fit of a motion finds it; only its distribution
over the runs can be found.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tunnel_sim.effects.capabilities import BetweenRuns
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.vocabulary.between_runs import USUAL_SCATTER, WIDEST_SCATTER
from tunnel_sim.vocabulary.record import Array


def _spread(meaning: str, scale: float) -> Any:
    """The standard deviation between runs, relative."""
    return parameter("σ", "1", meaning, scale=scale, lower=0.0, upper=WIDEST_SCATTER, relative=True)


@dataclass(frozen=True)
class WindSpeedScatter(BetweenRuns):
    """A wind speed that differs from run to run by chance."""

    name = "wind_speed_scatter"
    place = 27
    channel = "calibration"
    condition = "wind_on"
    scatters = "wind_speed"
    advice = "Log the wind speed of every run, or control it better"
    equation = "true speed of run i = (1 + εi) V, εi normal with standard deviation σ, drawn for every run"
    signature = (
        "The wind-on runs deviate from the model by chance: their stiffness with the square of the speed, their "
        "damping with the speed. The wind-off runs repeat."
    )
    references = ("Barlow, Rae & Pope, Low-Speed Wind Tunnel Testing, Wiley 1999",)
    example = (0.05,)

    spread: float = _spread(
        "standard deviation of the speed between runs, relative", USUAL_SCATTER["wind_speed"]
    )

    @classmethod
    def departure(
        cls, spring: Array, damping: Array, air_stiffness: Array, air_damping: Array
    ) -> tuple[Array | float, Array | float, float]:
        """Ka grows with V², and Ca with V."""
        del spring, damping
        return -2.0 * air_stiffness, -air_damping, 1.0


@dataclass(frozen=True)
class StiffnessScatter(BetweenRuns):
    """A spring whose stiffness differs from run to run by chance, such as by clamping it again."""

    name = "stiffness_scatter"
    place = 28
    channel = "calibration"
    condition = "always"
    on_spring = True
    scatters = "spring_stiffness"
    advice = "Clamp the spring in the same way before every run, or leave it in place"
    advice_for_joint = "Start every run from the same configuration and temperature"
    equation = "(1 + εi) Kr in run i, εi normal with standard deviation σ, drawn for every run"
    signature = "The frequencies of one spring differ by chance, also with the wind off; its damping repeats."
    references = ("Ewins, Modal Testing: Theory, Practice and Application, Research Studies Press 2000",)
    example = (0.02,)

    spread: float = _spread(
        "standard deviation of the stiffness between runs, relative", USUAL_SCATTER["spring_stiffness"]
    )

    @classmethod
    def departure(
        cls, spring: Array, damping: Array, air_stiffness: Array, air_damping: Array
    ) -> tuple[Array | float, Array | float, float]:
        """The spring's own stiffness changes."""
        del damping, air_stiffness, air_damping
        return spring, 0.0, 0.0


@dataclass(frozen=True)
class DampingScatter(BetweenRuns):
    """A mechanical damping that differs from run to run by chance."""

    name = "damping_scatter"
    place = 29
    channel = "damping"
    condition = "always"
    scatters = "mechanical_damping"
    advice = "Run the bearing in before every run, and lay the cable in the same way"
    advice_for_joint = "Warm the joint up before every run, and lay its cables in the same way"
    equation = "(1 + εi) Cr in run i, εi normal with standard deviation σ, drawn for every run"
    signature = (
        "The damping of equal runs differs by chance, also with the wind off; their frequencies repeat."
    )
    references = ("Ewins, Modal Testing: Theory, Practice and Application, Research Studies Press 2000",)
    example = (0.2,)

    spread: float = _spread(
        "standard deviation of the mechanical damping between runs, relative",
        USUAL_SCATTER["mechanical_damping"],
    )

    @classmethod
    def departure(
        cls, spring: Array, damping: Array, air_stiffness: Array, air_damping: Array
    ) -> tuple[Array | float, Array | float, float]:
        """The mechanical damping changes."""
        del spring, air_stiffness, air_damping
        return 0.0, damping, 0.0
