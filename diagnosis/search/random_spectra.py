"""Spectra of random moments: where a moment comes from, its parts, and the forms of a part that are tried.

The stream's moment is in proportion to its pressure and acts with the wind on; the moment of the surroundings is
the same in every run. The runs with the wind off distinguish them, and so do several wind speeds.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from diagnosis.likelihood.paths import COMMON
from diagnosis.model.data import Data
from diagnosis.model.run_data import RunData
from tunnel_sim.effects import Effect
from tunnel_sim.effects.capabilities import AtRandom
from tunnel_sim.effects.traits import Condition
from tunnel_sim.vocabulary.record import Array

LONGEST_BANDWIDTH = 20.0  # Hz: the rig cannot distinguish a broader spectrum from a white one
_LEAST_STROUHAL = 0.05  # bluff bodies shed at 0.1 to 0.3
_LINE_SPACING = 0.3  # Hz, in the search for a line
_WIDEST_LINE = 0.5  # Hz: beyond it a wandering line is turbulence
_HIGHEST_LINE = 30.0  # Hz
_SHARES = (0.1, 0.3, 1.0, 3.0, 10.0)  # of the moment whose response is as large as the noise
_FARTHEST = 1e4  # from that moment, up or down


@dataclass(frozen=True)
class MomentSource(ABC):
    """Where a random moment comes from.

    Traits:

    - ``condition``: of the effects that are such a moment.
    - ``in_every_run``: whether it acts in every run, as noise of the reading and a steady line do, which could be
      mistaken for it.
    - ``laws``: kinds of law, of `diagnosis.likelihood.paths.COMMON`, that could be mistaken for it: the kinds that
      act in the same runs.
    """

    condition: ClassVar[Condition]
    laws: ClassVar[tuple[str, ...]]
    in_every_run: ClassVar[bool] = False

    def may_be(self, kind: type[Effect]) -> bool:
        """Whether a kind of effect is such a moment."""
        return issubclass(kind, AtRandom) and kind.condition == self.condition

    @abstractmethod
    def acts(self, run: RunData) -> bool:
        """Whether it acts in a run."""

    @abstractmethod
    def moment(self, run: RunData, data: Data) -> float:
        """Moment per unit of its intensity in a run in which it acts: N m, or N m per N m."""


class _Stream(MomentSource):
    """The wind: its intensity is a moment coefficient."""

    condition = "wind_on"
    laws = ("wind",)

    def acts(self, run: RunData) -> bool:
        """Whether the wind blows."""
        return run.wind_on

    def moment(self, run: RunData, data: Data) -> float:
        """½ρV²Al, N m."""
        return data.air_moment(run)


class _Surroundings(MomentSource):
    """Floor, traffic, draughts: the intensity is the moment itself, in every run."""

    condition = "always"
    laws = tuple(COMMON)
    in_every_run = True

    def acts(self, run: RunData) -> bool:
        """In every run."""
        del run
        return True

    def moment(self, run: RunData, data: Data) -> float:
        """1, the moment being its intensity."""
        del run, data
        return 1.0


STREAM, SURROUNDINGS = _Stream(), _Surroundings()
SOURCES: tuple[MomentSource, ...] = (STREAM, SURROUNDINGS)


@dataclass(frozen=True)
class SpectrumPart:
    """A part of a random moment's spectrum: first order about a centre.

    Args:
        intensity: standard deviation of the moment coefficient, dimensionless, or of the moment, N m.
        bandwidth: corner frequency beside the centre, Hz.
        centre: Hz; 0 for a moment without one.
        strouhal_number: of a centre that follows the wind on the body's width; 0 where none does.
        source: where the moment comes from.
    """

    intensity: float
    bandwidth: float
    centre: float = 0.0
    strouhal_number: float = 0.0
    source: MomentSource = STREAM

    @property
    def states(self) -> int:
        """Number of states of the process: the moment, and about a centre its quadrature."""
        return 2 if self.centre > 0.0 or self.strouhal_number > 0.0 else 1

    @property
    def tail(self) -> float:
        """Standard deviation of a white part beside the intensity, below `LONGEST_BANDWIDTH`, in its unit."""
        return 0.0

    def dynamics(self, acceleration: Array, reduced: Array) -> tuple[Array, Array, Array]:
        """The linear dynamics of the part's states in some runs, driven by white noise.

        Args:
            acceleration: acceleration of the body per unit intensity, shape (runs,), rad/s².
            reduced: wind speed over the body's width, shape (runs,), Hz.

        Returns:
            The dynamics of the states, shape (runs, states, states), 1/s; the acceleration of the body by each,
            shape (runs, states); and the spectral intensity of the noise on the body's rate and on the states,
            shape (1 + states, 1 + states), or one such matrix for each run, in SI units squared per s.
        """
        count = self.states
        corner = 2.0 * np.pi * self.bandwidth
        states, on_body = np.zeros((reduced.size, count, count)), np.zeros((reduced.size, count))
        states[:, range(count), range(count)] = -corner
        if count == 2:
            turn = 2.0 * np.pi * (self.centre + self.strouhal_number * reduced)
            states[:, 0, 1], states[:, 1, 0] = -turn, turn
        on_body[:, 0] = acceleration
        return states, on_body, np.diag([0.0, *[2.0 * corner * self.intensity**2] * count])

    @property
    def band(self) -> Literal["broad_band", "narrow_band"]:
        """Whether it is broad or wandering vortices, as `tunnel_sim.effects.Effect.random` has it."""
        return "narrow_band" if self.strouhal_number > 0.0 else "broad_band"

    @property
    def parameters(self) -> tuple[float, ...]:
        """Intensity, bandwidth and, where there is one, the centre or its Strouhal number."""
        return (self.intensity, self.bandwidth, *(x for x in (self.centre, self.strouhal_number) if x > 0.0))

    def is_of(self, kind: type[Effect]) -> bool:
        """Whether it is a part of a kind of effect."""
        return issubclass(kind, AtRandom) and (self.band, self.source.condition) == (
            kind.random,
            kind.condition,
        )


@dataclass(frozen=True)
class FloorPart(SpectrumPart):
    """The inertial moment of a floor that resonates under a white force.

    The acceleration of the floor is small below its resonance and white above it. Half-width and frequency of the
    resonance are bandwidth and centre; the intensity is the standard deviation of the moment in the resonance.
    """

    @property
    def tail(self) -> float:
        """Standard deviation of the acceleration above the resonance; the runs do not show where it ends."""
        return float(np.sqrt(2.0 * LONGEST_BANDWIDTH * self._force))

    @property
    def _force(self) -> float:
        """Spectral intensity of the white force, in the intensity's unit squared, s."""
        return 8.0 * np.pi * self.bandwidth * self.intensity**2 / (2.0 * np.pi * self.centre) ** 2

    def dynamics(self, acceleration: Array, reduced: Array) -> tuple[Array, Array, Array]:
        """Place and speed of the floor; its acceleration moves the body, directly by the force too."""
        del reduced
        omega, damping = 2.0 * np.pi * self.centre, 4.0 * np.pi * self.bandwidth
        motion = np.array([-(omega**2), -damping])
        shaken = np.stack([acceleration, np.zeros_like(acceleration), np.ones_like(acceleration)], axis=1)
        white = self._force * (shaken[:, :, None] * shaken[:, None, :])
        return np.array([[0.0, 1.0], motion]), acceleration[:, None] * motion, white


#: The parts of a random moment's spectrum, whose moments are independent of each other.
Spectrum = tuple[SpectrumPart, ...]


@dataclass(frozen=True, eq=False)
class SpectrumForm:
    """A form of a part of a spectrum: from what parameters it is made, and where they are sought."""

    part: Callable[..., SpectrumPart]
    grid: Sequence[tuple[float, ...]]
    bounds: Sequence[tuple[float, float]]
    steps: Sequence[float]  # of the first simplex, in logarithms
    source: MomentSource = STREAM


BROAD = SpectrumForm(
    SpectrumPart,
    [(s, b) for s in (3e-4, 1e-3, 3e-3, 1e-2, 3e-2) for b in (0.3, 3.0, LONGEST_BANDWIDTH)],
    ((1e-7, 1.0), (0.03, LONGEST_BANDWIDTH)),
    (0.5, 0.5),
)
CENTRED = SpectrumForm(
    SpectrumPart,
    [(s, b, f) for s in (1e-3, 3e-3, 1e-2) for b in (0.5, 2.0) for f in (1.5, 3.0, 4.5, 6.5, 9.0)],
    ((1e-7, 1.0), (0.1, LONGEST_BANDWIDTH), (0.3, 20.0)),
    (0.5, 0.5, 0.05),
)


def wandering(data: Data) -> SpectrumForm | None:
    """Vortex shedding with a wandering phase; None without wind or body width."""
    fastest = max(run.wind_speed for run in data.runs)
    if data.width <= 0.0 or fastest <= 0.0:
        return None
    # lines spaced so that any frequency lies on one, up to the highest that the filter's samples show
    reduced = fastest / data.width
    numbers = np.arange(_LEAST_STROUHAL, min(0.6, _HIGHEST_LINE / reduced), _LINE_SPACING / reduced)
    return SpectrumForm(
        lambda s, b, n: SpectrumPart(s, b, strouhal_number=n),
        [(s, _LINE_SPACING / 3.0, float(n)) for s in (0.01, 0.05) for n in numbers],
        ((1e-7, 5.0), (5e-4, _WIDEST_LINE), (_LEAST_STROUHAL, 1.0)),
        (0.5, 0.5, 2e-3),
    )


def of_surroundings(unit: float) -> tuple[SpectrumForm, SpectrumForm]:
    """A moment of the surroundings without and with a centre; `BROAD` and `CENTRED` are the stream's.

    Args:
        unit: the moment whose response is as large as the noise, N m.
    """
    bounds = (unit / _FARTHEST, unit * _FARTHEST)
    broad = SpectrumForm(
        lambda s, b: SpectrumPart(s, b, source=SURROUNDINGS),
        [(share * unit, b) for share in _SHARES for b in (0.3, 3.0, LONGEST_BANDWIDTH)],
        (bounds, *BROAD.bounds[1:]),
        BROAD.steps,
        SURROUNDINGS,
    )
    centred = SpectrumForm(
        lambda s, b, f: SpectrumPart(s, b, f, source=SURROUNDINGS),
        [
            (share * unit, *rest)
            for share in _SHARES[1:4]
            for rest in dict.fromkeys(g[1:] for g in CENTRED.grid)
        ],
        (bounds, *CENTRED.bounds[1:]),
        CENTRED.steps,
        SURROUNDINGS,
    )
    return broad, centred


def of_floor(centred: SpectrumPart, unit: float) -> SpectrumForm:
    """A moment of a floor, which is sought near a moment about a frequency.

    Args:
        unit: as in `of_surroundings`.
    """
    bounds = ((unit / _FARTHEST, unit * _FARTHEST), (0.01, LONGEST_BANDWIDTH), CENTRED.bounds[2])
    s, b, f = centred.parameters
    near = np.array([(s * size, b * width, f) for size in (0.5, 1.0, 2.0) for width in (0.5, 1.0, 2.0)])
    return SpectrumForm(
        lambda s, b, f: FloorPart(s, b, f, source=SURROUNDINGS),
        np.clip(near, *np.transpose(bounds)).tolist(),
        bounds,
        (0.3, 0.3, 0.03),
        SURROUNDINGS,
    )
