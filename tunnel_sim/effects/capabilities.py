"""Capabilities of effects beyond a term of the moment law: each is a type, and an effect may have two.

A hook belongs to the type of its capability, so it is never called for an effect without the capability.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, Self

import numpy as np

from tunnel_sim.effects.base import Drawn, Effect
from tunnel_sim.effects.evidence import Residuals, Sought
from tunnel_sim.effects.parameters import WindOnRun
from tunnel_sim.effects.traits import Channel
from tunnel_sim.physics.run_settings import RunSettings, SettingsTable
from tunnel_sim.vocabulary.plan import SensorModel
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True)
class BetweenRuns(Effect):
    """A quantity of the run that is (1 + σ e) times its stated value, with e drawn from the unit normal.

    Traits of its own:

    - ``scatters``: the quantity: ``wind_speed``, ``spring_stiffness`` or ``mechanical_damping``.
    """

    scatters: ClassVar[str]
    fitted = False
    autonomous = False

    def draw(self, stated: RunSettings, rng: np.random.Generator) -> Drawn:
        """Draw the run's deviation, in standard deviations."""
        del stated
        return float(rng.standard_normal())

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Scale the quantity by every run's own factor."""
        del stated
        own = [effect.deviation(one) for effect, one in zip(effects, drawn, strict=True)]
        runs.deviate(cls.scatters, np.array(own))

    def deviation(self, drawn: Drawn) -> float:
        """The run's own deviation, relative."""
        return 0.0 if self.is_null else self.severity * self.drawn_number(drawn)

    @classmethod
    @abstractmethod
    def departure(
        cls, spring: Array, damping: Array, air_stiffness: Array, air_damping: Array
    ) -> tuple[Array | float, Array | float, float]:
        """Change of the runs' linear motions by a relative deviation of 1 of the scattering quantity.

        Args:
            spring: Kr, N m/rad, shape (runs,).
            damping: Cr, N m s/rad, shape (runs,).
            air_stiffness: Ka of the run, N m/rad, shape (runs,).
            air_damping: Ca of the run, N m s/rad, shape (runs,).

        Returns:
            Changes of the stiffness Kr − Ka, N m/rad, of the damping Cr − Ca, N m s/rad, and of the wind speed,
            as a share.
        """


@dataclass(frozen=True)
class OwnNumbers(Effect):
    """An effect with unknowns of its own in every run; the residuals of a fit without the effect show them."""

    autonomous = False

    @classmethod
    def numbers_like_forms(cls, instants: int) -> int:
        """Number of its unknowns of every run that absorb any slow phase error, as a freed form does.

        Args:
            instants: number of instants in a run.
        """
        del instants
        return 0

    @classmethod
    def gains_in(cls) -> Literal["frequency", "harmonics"]:
        """The channel of the misfit that these unknowns lower by chance."""
        return "harmonics"

    @classmethod
    @abstractmethod
    def sought(cls, residuals: Residuals) -> Iterable[Sought | None]:
        """Starting points of a fit.

        Args:
            residuals: residuals of a fit without the effect.

        Returns:
            The result of the search in the residuals, for each way in which the effect may act.
        """


@dataclass(frozen=True)
class Periodic(OwnNumbers):
    """An oscillation with a phase that differs from run to run.

    Traits of its own:

    - ``frequency_by_wind``: the parameter of the moment law with a frequency proportional to the wind speed;
    empty: none.
    """

    frequency_by_wind: ClassVar[str] = ""

    def draw(self, stated: RunSettings, rng: np.random.Generator) -> Drawn:
        """Draw the run's phase, rad."""
        del stated
        return float(rng.uniform(0.0, 2.0 * np.pi))

    @classmethod
    def per_run_parameters(cls, instants: int) -> tuple[str, ...]:
        """The phase."""
        del instants
        return ("phase",)


@dataclass(frozen=True)
class Clock(OwnNumbers):
    """Readings at other times than stated, from an instant on that differs from run to run.

    The instant is a share of the run.
    """

    @classmethod
    def per_run_parameters(cls, instants: int) -> tuple[str, ...]:
        """The instants."""
        return tuple(f"instant_{number + 1}" for number in range(instants))

    @classmethod
    def numbers_like_forms(cls, instants: int) -> int:
        """All instants."""
        return instants

    @classmethod
    def gains_in(cls) -> Literal["frequency", "harmonics"]:
        """The channel of the frequency: an instant moves the phase."""
        return "frequency"

    @abstractmethod
    def on_time(self, time_s: Array, stated: RunSettings, drawn: Drawn) -> Array:
        """Change the times at which the motion is read.

        Args:
            time_s: times by the stamps, s, shape (n,).

        Returns:
            The true times, s, shape (n,).
        """


@dataclass(frozen=True)
class ReadingEffect(Effect):
    """A change of the reading, not of the motion.

    Traits of its own:

    - ``remembers``: whether a reading depends on earlier samples.
    - ``ahead_of_sensor``: whether it acts between the rod and the sensor, before the sensor's own effects.
    """

    remembers: ClassVar[bool] = False
    ahead_of_sensor: ClassVar[bool] = False

    def on_angle(self, angle: Array, time_s: Array, stated: RunSettings, drawn: Drawn) -> Array:
        """Change the angle that the sensor measures, before zero and noise are added.

        Args:
            angle: angle of the rod's upper end, rad, shape (n,).
            time_s: true times, s, shape (n,).

        Returns:
            The changed angle, rad, shape (n,).
        """
        del time_s, stated, drawn
        return angle

    def on_sensor(self, sensor: SensorModel) -> SensorModel:
        """Change the sensor itself."""
        return sensor

    def on_reading(self, reading: Array) -> Array:
        """Change the reading after noise and before quantisation.

        Args:
            reading: reading, rad, shape (n,).

        Returns:
            The changed reading, rad, shape (n,).
        """
        return reading


@dataclass(frozen=True)
class SecondOscillation(Periodic, ReadingEffect):
    """An oscillation apart from the body's, of a structure or another degree of freedom.

    Traits of its own:

    - ``resembles``: other channels to which its residual may point.
    """

    resembles: ClassVar[tuple[Channel, ...]] = ()

    @abstractmethod
    def oscillation(self, time_s: Array, stated: RunSettings, drawn: Drawn, derivative: int = 0) -> Array:
        """The oscillation in the reading besides the body's.

        Args:
            time_s: true times since the release, s, shape (n,).
            stated: stated physics of the run; its input, if it is driven, is the acting one.
            derivative: which derivative of the angle the sensor measures: 0, 1 or 2.

        Returns:
            The oscillation, rad, rad/s or rad/s², shape (n,), to be added to the angle or its derivative.
        """


@dataclass(frozen=True)
class MainsPickup(Periodic, ReadingEffect):
    """A line of the mains, detected in the records."""

    fitted = False


@dataclass(frozen=True)
class CoarseSteps(ReadingEffect):
    """Steps of the reading coarser than stated, detected in the records."""

    fitted = False


@dataclass(frozen=True)
class InputClock(Effect):
    """An input that acts at other times than stated, in driven runs."""

    autonomous = False
    driven = True


@dataclass(frozen=True)
class Backlash(Effect):
    """A gap that separates the body from its support."""


@dataclass(frozen=True)
class AtRandom(Effect):
    """A random moment, different from run to run.

    Traits of its own:

    - ``random``: kind of its spectrum. The spectrum of vortex shedding also has a line with a steady or
      wandering phase.
    """

    random: ClassVar[Literal["broad_band", "narrow_band"]]
    autonomous = False

    def moment_density(self, rate: float, reference_moment: float) -> float:
        """Spectral intensity of the random moment, as if it were white.

        Args:
            rate: angular frequency of the motion, rad/s.
            reference_moment: ½ρV²Al of the run, N m; 0 with the wind off.

        Returns:
            q of the moment, ⟨M(t)M(t′)⟩ = q δ(t − t′), (N m)² s; 0 without a broad spectrum.
        """
        del rate, reference_moment
        return 0.0


@dataclass(frozen=True)
class Friction(Effect):
    """A moment against the rate that can hold a body at rest."""

    @abstractmethod
    def stands(self, stiffness: float) -> float:
        """Greatest angle from rest at which the friction holds a body that has stopped.

        Args:
            stiffness: stiffness of the restoring moment, N m/rad, or per unit inertia, like the effect's
                moment.

        Returns:
            The angle, rad.
        """

    @abstractmethod
    def sliding(self, rate: Array) -> Array:
        """The friction while the body moves at a steady rate, against the motion.

        Args:
            rate: positive rate, rad/s, shape (n,).

        Returns:
            The moment, N m, shape (n,).
        """


@dataclass(frozen=True)
class OutOfPhase(Effect):
    """A moment of the air with a part out of phase, which Cnβ and Cnr of a nominal fit include."""

    @abstractmethod
    def in_phase(self, cn_beta: float, cn_r: float, runs: Sequence[WindOnRun]) -> tuple[float, float]:
        """Cnβ and Cnr in phase with angle and rate, including this effect's part, 1/rad.

        Args:
            cn_beta: Cnβ of the law beside the effect, 1/rad.
            cn_r: Cnr of the same law, 1/rad.
            runs: the campaign's wind-on runs; their frequencies count equally.
        """
