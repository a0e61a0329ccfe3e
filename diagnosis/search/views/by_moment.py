"""Sets of causes of a body without a spring, weighed by the residual moment instead of the residual angle."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import ClassVar, Final, Self

import numpy as np

from diagnosis.likelihood.least_squares import Fit, FitError, fit, try_fit
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.residuals import linear_coefficients
from diagnosis.model.data import Data
from diagnosis.model.run_noise import NoiseWithMoment
from diagnosis.search.answer import UNKNOWN
from diagnosis.search.clock import StepClock
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.prepared import Prepared
from diagnosis.search.sets import Sets
from diagnosis.search.views.view import View

MOMENT_NOISE_FROM: Final = 0.05
"""Minimum probability of a set for its residual random moment to be modelled as noise. Judgement."""
MOMENT_LEFT: Final = 0.25
"""Maximum power of a set's residual random moment, as a share of the missing moment, for a body without a
spring. Judgement. Half its size: a cause explains most of the gap. The EMPS axis (0.115) is not an independent
test."""
MOMENT_CHANCE: Final = 1.0
"""Maximum relative standard deviation of the best set's residual for sets to be compared by the moment.
Convention. The standard deviation then equals the residual."""

# powers of a random moment's response per interval, in variances of white noise
_POWERS = np.geomspace(1e-12, 1e12, 49)


@dataclass(frozen=True, eq=False)
class ByMoment(View):
    """Whole runs in noise that includes a random moment.

    Every small error of the moment displaces such a body permanently, so its angle drifts ever further away.
    The residual random moment therefore counts as noise: it is the residual moment of the most likely set, if
    this is small beside the moment missing from the nominal model.

    Args:
        known: the sets found by the angle.
    """

    known: Sets

    states_parameters: ClassVar[bool] = True
    caution: ClassVar[str] = "by moment"

    @classmethod
    def after(cls, prepared: Prepared, known: Sets | None, clock: StepClock) -> Self | None:
        """The view of a body without a restoring moment, if a set's share of the angle exceeds chance.

        Also None if no set explains the angle and no set leaves a small moment.
        """
        del clock
        best = None if known is None or prepared.nominal.problem.data.model.restored else known.best
        if known is None or best is None or best.fit.chance >= MOMENT_CHANCE:
            return None
        prepared = known.view.prepared
        # refit the nominal model with the residual noise of each probable set
        bases: list[Fit] = []
        for answer in known.weighed:
            left = known.fitted(answer.effects)
            if left is None or (bases and answer.probability < MOMENT_NOISE_FROM):
                continue
            with suppress(FitError, np.linalg.LinAlgError):
                bases.append(fit(Problem(by_moment(left.fit)), prepared.nominal.point))
        small = [base for base in bases if MOMENT_LEFT * (1.0 + base.excess) >= 1.0]
        if not bases or (not small and known.weighed[0].effects == UNKNOWN):
            return None
        return cls(prepared, (small or bases)[0], known)

    def sets(self, clock: StepClock) -> Sets:
        """The sets found here, with the sets from the angle, which are not grown again."""
        return replace(super().sets(clock), random=self.known.random, refused=self.known.refused)

    def whole(self, hypothesis: Hypothesis) -> Hypothesis | None:
        """The set fitted to the angle."""
        problem = replace(hypothesis.fit.problem, data=self.prepared.nominal.problem.data)
        fitted = try_fit(problem, hypothesis.fit.point)
        return None if fitted is None else replace(hypothesis, fit=fitted)


def by_moment(fit: Fit) -> Data:
    """The runs of a fit, in noise that includes a random moment beside the white noise.

    Per interval, a body without a spring turns a random moment into 1/((1 − B)(1 − φ B)) times the moment, with
    the backward shift B and φ = exp(−C h/Izz). With white noise added, (1 − B)(1 − φ B) times the reading is a
    moving average of order two; its inverse whitens it (Box and Jenkins, Time Series Analysis). The power of
    the moment is the most likely one for the fit's residuals.
    """
    from scipy.signal import lfilter  # imported here because it is slow to load

    inertia, damping, _ = linear_coefficients(fit, 0)
    runs = []
    for run, residual in zip(fit.problem.data.runs, fit.residuals, strict=True):
        shape = np.polymul([1.0, -1.0], [1.0, -np.exp(-damping * run.interval / inertia)])
        left = np.convolve(residual, shape, "valid")
        likeliest, least = run, np.inf
        for power in _POWERS:
            # the invertible factor of a spectrum: the spectrum of the shape, plus a constant
            roots = np.roots(np.polyadd(np.convolve(shape, shape[::-1]), [power, 0.0, 0.0]))
            inside = roots[np.argsort(np.abs(roots))][:2]
            average = np.asarray(np.real(np.poly(inside)), np.float64)
            # scale of the innovations: the products' last coefficients are equal
            variance = shape[2] / average[2]
            cost = float(np.mean(lfilter([1.0], average, left) ** 2) / variance + np.log(variance))
            if cost < least:
                noise = NoiseWithMoment(run.noise.variance * variance, run.noise, shape, average)
                likeliest, least = replace(run, noise=noise), cost
        runs.append(likeliest)
    return fit.problem.data.with_runs(tuple(runs))
