"""The noise of a campaign, one type for each way in which it was found, and what it makes of the tests of a gap."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.run_data import Data
from diagnosis.likelihood.run_noise import WhiteNoise
from diagnosis.noise.bands import TESTS, powers
from diagnosis.noise.colour import Colour
from diagnosis.noise.rounding import rounding_errors
from tunnel_sim.vocabulary.record import Array

_LEAST_WHITE = 1e-3  # of the variance: some of it is white, however coarse the step


@dataclass(frozen=True, eq=False)
class Noise(ABC):
    """A campaign's noise.

    Args:
        variance: of one sample, quantisation included, rad², by run id: what the diagnosis uses.
        stated_variance: of one sample as the campaign states it, rad²; None where it does not.
        reason: why this kind was chosen.
        estimated: the records' own variance, mean over the runs, rad².
        relative: standard deviation of that estimate, a share of it.
        measured: variance of one sample as the spectrum above the motion shows it, rad², by run id.
    """

    variance: dict[str, float]
    stated_variance: float | None
    reason: str
    estimated: float
    relative: float
    measured: Mapping[str, float]

    @property
    @abstractmethod
    def source(self) -> str:
        """Of the variance used: ``stated``, ``estimated`` or ``floor``."""

    @property
    def shown(self) -> bool:
        """Whether the records show it, so that its level and its trend with the motion are tested."""
        return True

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
        """Factor by which the noise may exceed the one used: stated noise may be a little low and still agree."""
        return max(self.estimated / self.used, 1.0)

    @property
    def colour(self) -> Colour | None:
        """Its spectrum relative to white noise of the variance used; None where it is white."""
        return None

    def spread(self, frequency: Array) -> float:
        """Standard deviation of the mean power over some frequencies, Hz, shape (n,), a share of it."""
        del frequency
        return self.relative

    def expected(self, fit: Fit) -> tuple[Array, Array]:
        """The power that it gives the residuals of a fit by `TESTS`, and the scatter of that, shape (tests,) each.

        Both are shares of the power of white noise of the fit's variance; the scatter is that beyond white noise's.
        """
        del fit
        return np.ones(len(TESTS)), np.zeros(len(TESTS))

    def white(self, step: float) -> dict[str, float]:
        """The white noise before rounding.

        Args:
            step: of the lattice of the readings, rad; 0 where there is none.

        Returns:
            Standard deviation of one sample, rad, by run id. Where the motion crosses a step in many samples, the
            spectrum above it does not show the rounding error's q²/12 but how often noise takes a reading across
            the next edge: qσ/√π for noise of a third of a step or less. The edges that the motion itself crosses
            add to that, so noise of less than a tenth of a step is overestimated.
        """
        found = {}
        for run, variance in self.variance.items():
            seen, rounded = self.measured.get(run, variance), step**2 / 12.0
            before = max(variance - rounded, _LEAST_WHITE * variance)
            found[run] = float(np.sqrt(np.pi) * seen / step if seen < rounded else np.sqrt(before))
        return found

    def rounded(self, fit: Fit, step: float) -> Noise:
        """The noise with what rounding makes of the residuals of a fit, where that is not white.

        Args:
            step: of the lattice of the readings, rad; 0 where there is none.
        """
        errors = rounding_errors(fit, self.white(step), step)
        return self if errors is None else Rounded(*self._figures(), self, errors)

    def allowed_in(self, data: Data) -> Data:
        """Data prepared for white noise, with this noise of block means; the same data where that is white."""
        return data

    def coloured(self, colour: Colour, data: Data) -> Coloured:
        """The same noise, found to have a colour, and with an estimate of all power that the records resolve."""
        extra = [
            self.variance[run.id] / run.block * (colour.mean(run.reading.size, run.interval) - 1.0)
            for run in data.runs
        ]
        whole = float(np.mean(list(self.variance.values())) + np.mean(extra))
        found = Coloured(*self._figures(), self, colour)
        return replace(found, estimated=whole, reason=f"it is coloured, {np.sqrt(whole):.3g} rad in all")

    def _figures(self) -> tuple[dict[str, float], float | None, str, float, float, Mapping[str, float]]:
        return (
            self.variance, self.stated_variance, self.reason, self.estimated, self.relative, self.measured,
        )  # fmt: skip


class Stated(Noise):
    """White noise as the campaign states it, with which the records agree."""

    @property
    def source(self) -> str:
        """The statement."""
        return "stated"


class Estimated(Noise):
    """White noise as the records show it."""

    @property
    def source(self) -> str:
        """The records."""
        return "estimated"


class Floor(Noise):
    """The accuracy of the fits, as white noise, where the records contain less noise than that."""

    @property
    def source(self) -> str:
        """The fits."""
        return "floor"

    @property
    def shown(self) -> bool:
        """It is not the records' own."""
        return False


@dataclass(frozen=True, eq=False)
class Rounded(Noise):
    """Noise of readings on a lattice, whose rounding error is not white.

    Args:
        before: the noise without regard to that.
        errors: what noise and rounding alone leave in the block means, by run, repetitions of it, shape
            (repetitions, blocks), rad.
    """

    before: Noise
    errors: Sequence[Array]

    @property
    def source(self) -> str:
        """That of the noise."""
        return self.before.source

    @property
    def shown(self) -> bool:
        """As the noise."""
        return self.before.shown

    def expected(self, fit: Fit) -> tuple[Array, Array]:
        """From the repetitions; not less than white noise."""
        found, count = [], np.ones(len(TESTS))
        for number in range(len(self.errors[0])):
            residuals = [
                run.scaled(e[number]) for run, e in zip(fit.problem.data.runs, self.errors, strict=True)
            ]
            power, ordinates, _ = powers(fit, residuals)
            count = np.maximum(ordinates, 0.5)  # any number where there are none
            found.append(power / count)
        level = np.mean(found, axis=0)
        beyond = np.var(found, axis=0, ddof=1) / np.maximum(level, 1e-100) ** 2 - 1.0 / count
        return np.maximum(level, 1.0), np.sqrt(np.maximum(beyond, 0.0))

    def rounded(self, fit: Fit, step: float) -> Noise:
        """The noise with what rounding makes of the residuals of another fit."""
        return self.before.rounded(fit, step)

    def allowed_in(self, data: Data) -> Data:
        """With noise of block means that is not below the errors.

        It is raised where averaging does not reduce the errors as it reduces white noise, at most to that of one
        sample.
        """
        raised = [
            float(np.clip(np.mean(error**2), run.noise.variance, run.noise.variance * run.block))
            for run, error in zip(data.runs, self.errors, strict=True)
        ]
        if all(run.noise.variance == value for run, value in zip(data.runs, raised, strict=True)):
            return data
        runs = [replace(run, noise=WhiteNoise(value)) for run, value in zip(data.runs, raised, strict=True)]
        return data.with_runs(tuple(runs))


@dataclass(frozen=True, eq=False)
class Coloured(Estimated):
    """Noise whose spectrum the records show; its variance used is that of the white noise assumed before.

    Args:
        before: that white noise, rounded or not.
        spectrum: its power relative to that.
    """

    before: Noise
    spectrum: Colour

    @property
    def colour(self) -> Colour:
        """Its spectrum."""
        return self.spectrum

    @property
    def std(self) -> float:
        """Standard deviation of one sample, all power that the records resolve, rad."""
        return float(np.sqrt(self.estimated))

    @property
    def margin(self) -> float:
        """None: the spectrum is that of the records."""
        return 1.0

    def spread(self, frequency: Array) -> float:
        """That of the spectrum."""
        return self.spectrum.spread(frequency)

    def expected(self, fit: Fit) -> tuple[Array, Array]:
        """As before, since the residuals are whitened."""
        return self.before.expected(fit)

    def rounded(self, fit: Fit, step: float) -> Noise:
        """With the colour kept."""
        return replace(self, before=self.before.rounded(fit, step))
