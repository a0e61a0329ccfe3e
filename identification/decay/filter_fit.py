"""Maximum likelihood of a driven decay: decay rate, stiffness and the random moment's intensity, by scoring.

The start is the optimum of output error with the best of a range of intensities. Each step solves Fisher's
information, from central differences of the innovations and of their variance, against the gradient of the
likelihood (Maine & Iliff, SIAM J. Appl. Math. 41 (1981) 558–579, doi 10.1137/0141046).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from identification.decay.damped_oscillation import Decay
from identification.decay.innovations import Driven, Innovations, innovations
from identification.policy import LEAST_CORNER_DROP, LEAST_MOMENT_DROP, MOMENT_DROP_FOR_CORNER
from identification.statistics.information import inverse, scaled_solve
from tunnel_sim.vocabulary.record import Array

_DECADES = np.arange(-7.0, 3.1, 1.0)  # of q over R ω³, the intensity that doubles R within a radian
_CORNERS = (8.0, 3.0, 1.0, 0.3)  # Hz; above these, the moment of a rig of a few Hz looks white
_MAX_STEPS = 25
_SETTLED = 0.01  # standard deviations
_NUDGE = 0.1  # standard deviations of a and k; of ln q outright


@dataclass(frozen=True, eq=False)
class DrivenFit:
    """A driven decay at the maximum of its likelihood.

    Args:
        covariance: of (a, k, ln q), shape (3, 3).
        drop: of −2 ln L against no random moment at all, dimensionless.
    """

    model: Driven
    covariance: Array
    innovations: Innovations
    drop: float


def fit_driven(
    values: Array, interval: float, start: Decay, deviations: Array, noise_variance: float
) -> DrivenFit | None:
    """Fit a driven decay.

    Args:
        values: block means of one run, shape (n,), rad.
        interval: between them, s.
        start: output error's decay.
        deviations: its standard deviations of (a, k), shape (2,), in 1/s and 1/s².
        noise_variance: of one block mean, rad².

    Returns:
        The fit; None where no random moment is needed to explain the run.
    """
    fit = _Fit(values, interval, noise_variance, deviations)
    bare = fit.at(Driven(start, 0.0))
    unit = noise_variance * start.omega_n**3
    best = fit.best(Driven(start, float(unit * 10.0**decade)) for decade in _DECADES)
    if bare is None or best is None:
        return None
    found = fit.maximise(best)
    if found is None or bare.cost - found.innovations.cost < LEAST_MOMENT_DROP:
        return None
    if bare.cost - found.innovations.cost > MOMENT_DROP_FOR_CORNER:
        found = fit.with_corner(found)
    return DrivenFit(found.model, found.covariance, found.innovations, bare.cost - found.innovations.cost)


class _Fit:
    """The likelihood of one run, and its maximisation."""

    def __init__(self, values: Array, interval: float, noise_variance: float, deviations: Array) -> None:
        self.values, self.interval, self.noise_variance = values, interval, noise_variance
        self.nudges = np.append(_NUDGE * deviations, _NUDGE)

    def at(self, model: Driven) -> Innovations | None:
        return innovations(self.values, self.interval, model, self.noise_variance)

    def best(self, models: Iterable[Driven]) -> Driven | None:
        costs = [(found.cost, model) for model in models if (found := self.at(model)) is not None]
        return min(costs, key=lambda item: item[0])[1] if costs else None

    def with_corner(self, white: DrivenFit) -> DrivenFit:
        decay, intensity = white.model.decay, white.model.intensity
        ladder = [
            Driven(decay, intensity * factor, corner)
            for corner in _CORNERS
            for factor in (0.5, 1.0, 2.0, 5.0, 20.0)
        ]
        best = self.best(ladder)
        found = None if best is None else self.maximise(best)
        if found is None or white.innovations.cost - found.innovations.cost < LEAST_CORNER_DROP:
            return white
        return found

    def maximise(self, model: Driven) -> DrivenFit | None:
        here = self.at(model)
        for _ in range(_MAX_STEPS):
            system = None if here is None else self._system(model, here)
            if here is None or system is None:
                return None
            information, gradient = system
            try:
                step = scaled_solve(information, gradient)
                covariance = inverse(information)
            except np.linalg.LinAlgError:
                return None
            step[2] = np.clip(step[2], -2.0, 2.0)
            size = float(np.max(np.abs(step) / np.sqrt(np.diag(covariance))))
            moved = self._search(model, here, step)
            if moved is not None:
                model, here = moved
            if moved is None or size < _SETTLED:
                return DrivenFit(model, covariance, here, 0.0)
        return None

    def _search(self, model: Driven, here: Innovations, step: Array) -> tuple[Driven, Innovations] | None:
        for factor in (1.0, 0.5, 0.25, 0.0625):
            trial = _moved(model, factor * step)
            there = self.at(trial)
            if there is not None and there.cost < here.cost:
                return trial, there
        return None

    def _system(self, model: Driven, here: Innovations) -> tuple[Array, Array] | None:
        # Fisher's information and minus half the gradient of −2 ln L.
        slopes, logs = [], []
        for i, nudge in enumerate(self.nudges):
            away = nudge * np.eye(3)[i]
            ahead, back = self.at(_moved(model, away)), self.at(_moved(model, -away))
            if ahead is None or back is None:
                return None
            slopes.append((ahead.values - back.values) / (2.0 * nudge))
            logs.append(np.log(ahead.variance / back.variance) / (2.0 * nudge))
        slope, log = np.array(slopes), np.array(logs)
        count, power = here.values.size, float(here.values @ here.values) / here.variance
        information = slope @ slope.T / here.variance + 0.5 * count * np.outer(log, log)
        return information, -slope @ here.values / here.variance + 0.5 * (power - count) * log


def _moved(model: Driven, step: Array) -> Driven:
    decay = Decay(model.decay.rate + float(step[0]), model.decay.stiffness + float(step[1]))
    return Driven(decay, model.intensity * float(np.exp(step[2])), model.corner)
