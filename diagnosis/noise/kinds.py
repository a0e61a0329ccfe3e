"""The noise of a campaign, with one type for each way of finding it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import ClassVar

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.model.data import Data
from diagnosis.model.fact import Fact
from diagnosis.noise.colour import Colour
from diagnosis.noise.rounding import Rounding
from tunnel_sim.vocabulary.record import Array

_LEAST_WHITE = 1e-3  # of the variance: some of it is white, however coarse the step


@dataclass(frozen=True, eq=False)
class Noise:
    """A campaign's noise, white unless the kind says otherwise.

    Args:
        variance: variance of one sample as the diagnosis uses it, quantisation included, rad², by run id.
        stated_variance: variance of one sample stated by the campaign, rad²; None where it is not stated.
        reason: reason for this kind of noise.
        estimated: the records' own variance, mean over the runs, rad².
        relative: standard deviation of that estimate, a share of it.
        measured: variance of one sample from the spectrum above the motion, rad², by run id.
        rounding: the rounding error beside white noise.
    """

    variance: dict[str, float]
    stated_variance: float | None
    reason: Fact
    estimated: float
    relative: float
    measured: Mapping[str, float]
    rounding: Rounding = field(default_factory=Rounding)

    #: Origin of the variance used: ``stated``, ``estimated`` or ``floor``.
    source: ClassVar[str]
    #: Whether the records show it; its level and its trend with the motion are then tested.
    shown: ClassVar[bool] = True

    @property
    def used(self) -> float:
        """The variance used, mean over the runs, rad²."""
        return float(np.mean(list(self.variance.values())))

    @property
    def std(self) -> float:
        """Standard deviation of one sample, rad."""
        return float(np.sqrt(self.used))

    @property
    def margin(self) -> float:
        """Factor by which the noise may exceed the one used: stated noise may be slightly low and still agree."""
        return max(self.estimated / self.used, 1.0)

    @property
    def colour(self) -> Colour | None:
        """Its spectrum relative to white noise of the variance used; None where it is white."""
        return None

    def spread(self, frequency: Array) -> float:
        """Standard deviation of the mean power over some frequencies, Hz, shape (n,), a share of it."""
        del frequency
        return self.relative

    def noted(self) -> tuple[Fact, ...]:
        """Remarkable features of its spectrum."""
        return ()

    def cautions(self, contradicted: float) -> tuple[Fact, ...]:
        """The caveat of an answer based on it.

        Args:
            contradicted: factor between stated and observed standard deviations from which they disagree.
        """
        ratio = self.estimated**0.5 / self.stated_variance**0.5 if self.stated_variance else 1.0
        if ratio >= contradicted:
            return (Fact("more noise than stated", {"ratio": ratio}),)
        return (Fact("less noise than stated", {"ratio": ratio}),) if ratio <= 1.0 / contradicted else ()

    def white(self, step: float) -> dict[str, float]:
        """The white noise before rounding.

        Args:
            step: of the lattice of the readings, rad; 0 where there is none.

        Returns:
            Standard deviation of one sample, rad, by run id. Where the motion crosses a step in many samples, the
            spectrum above it does not show the rounding error's q²/12 but the frequency with which noise takes a
            reading across the next edge: qσ/√π for noise of a third of a step or less. The edges crossed by the
            motion itself add to that, so noise of less than a tenth of a step is overestimated.
        """
        found = {}
        for run, variance in self.variance.items():
            seen, rounded = self.measured.get(run, variance), step**2 / 12.0
            before = max(variance - rounded, _LEAST_WHITE * variance)
            found[run] = float(np.sqrt(np.pi) * seen / step if seen < rounded else np.sqrt(before))
        return found

    def rounded(self, fit: Fit, step: float) -> Noise:
        """The noise with the rounding error in the residuals of a fit.

        Args:
            step: of the lattice of the readings, rad; 0 where there is none.
        """
        return replace(self, rounding=Rounding.of(fit, self.white(step), step))

    def coloured(self, colour: Colour, data: Data) -> Coloured:
        """The noise with a colour, and with an estimate of all power that the records resolve."""
        extra = [
            self.variance[run.id] / run.block * (colour.mean(run.reading.size, run.interval) - 1.0)
            for run in data.runs
        ]
        whole = float(np.mean(list(self.variance.values())) + np.mean(extra))
        known = {one.name: getattr(self, one.name) for one in fields(self)}
        known |= {"estimated": whole, "reason": Fact("coloured", {"std_rad": float(np.sqrt(whole))})}
        return Coloured(**known, spectrum=colour)


class StatedNoise(Noise):
    """White noise as stated by the campaign, confirmed by the records; arguments as in `Noise`."""

    source = "stated"


class Estimated(Noise):
    """White noise as estimated from the records; arguments as in `Noise`."""

    source = "estimated"


class Floor(Noise):
    """The accuracy of the fits, where the records contain less noise; arguments as in `Noise`."""

    source, shown = "floor", False

    def cautions(self, contradicted: float) -> tuple[Fact, ...]:
        """The caveat that it replaces the records' own noise."""
        del contradicted
        return (Fact("floor", {"records_rad": self.estimated**0.5, "fits_rad": self.used**0.5}),)


@dataclass(frozen=True, eq=False, kw_only=True)
class Coloured(Estimated):
    """Noise with the spectrum of the records; its variance equals the white noise's assumed before.

    Args:
        spectrum: its power relative to that variance; the other arguments as in `Noise`.
    """

    spectrum: Colour

    #: The spectrum is estimated from the records.
    margin: ClassVar[float] = 1.0

    @property
    def colour(self) -> Colour:
        """Its spectrum."""
        return self.spectrum

    @property
    def std(self) -> float:
        """Standard deviation of one sample, all power that the records resolve, rad."""
        return float(np.sqrt(self.estimated))

    def noted(self) -> tuple[Fact, ...]:
        """The fact that the noise is coloured, with its strength."""
        span = self.spectrum.frequency[-1] / self.spectrum.frequency[0]
        ratio = np.exp(np.ptp(self.spectrum.level))
        figures = {"std_rad": self.std, "power_ratio": float(ratio), "frequency_ratio": float(span)}
        return (Fact("coloured", figures),)

    def spread(self, frequency: Array) -> float:
        """The standard deviation of the spectrum's mean power."""
        return self.spectrum.spread(frequency)
