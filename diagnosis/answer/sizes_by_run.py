"""The size of a cause in every run, by linear theory from the fit to all runs.

A correct law gives the same size in every run. If the size differs from run to run by more than its errors, the
law is wrong, or one run differs from the others.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from diagnosis.likelihood.least_squares import Fit, fit_at, scaled_residuals
from diagnosis.likelihood.normal_equations import Products, by_run
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.sensitivities import Jacobian, sensitivities
from diagnosis.model.parameters import Point
from diagnosis.search.process_noise import with_response
from diagnosis.search.scatter import with_own_linear_terms
from diagnosis.search.study import Study
from identification.show.quantity import Quantity
from tunnel_sim.effects import Effect
from tunnel_sim.vocabulary.record import Array

AGREE_RATE: Final = 0.001
"""False-alarm rate of the test that the runs agree on the size of a cause. Convention. One cause in 1000."""
SHOWN_SIZE: Final = 1.0
"""Maximum standard deviation of a size in one run, as a share of the common size, for the run to show it.
Convention. A wider interval says nothing."""
OWN_SHARE: Final = 0.001
"""Minimum share of a run's information on a size that is independent of its spring and damping, in the median
run, for runs to show the size by themselves. Judgement. The share is 0 for an offset of the wind speed, and
0.005 for dry friction in a short run."""

_ACTS = 1e-9  # minimum information of a run, as a share of all runs', for the cause to act in it


@dataclass(frozen=True)
class SizeByRun:
    """The size of a cause in every run.

    Args:
        effect: name of the effect.
        parameter: name of its severity.
        common: the size fitted to all runs.
        runs: the size by run id, from the readings of one run; without the runs that cannot show it.
        silent: ids of the runs in which the cause acts without showing its size.
        alone: whether stiffness and damping are free in each run; else all other parameters are common to the
            runs.
        p_value: probability of such differences between the sizes, if there is one size.
        spread: standard deviation of the sizes beyond their errors, as a share of the common size.
    """

    effect: str
    parameter: str
    common: Quantity
    runs: Mapping[str, Quantity]
    silent: tuple[str, ...]
    alone: bool
    p_value: float
    spread: float

    @property
    def agrees(self) -> bool:
        """Whether the runs agree on it within chance."""
        return self.p_value >= AGREE_RATE

    @property
    def differs_by(self) -> float:
        """Standard deviation of the sizes beyond their errors, as a share of the size; 0 if the runs agree."""
        return 0.0 if self.agrees else self.spread

    @property
    def form_std(self) -> float:
        """Standard deviation of the common size by the differences beyond chance, in its unit; 0 without any."""
        if self.agrees:
            return 0.0
        weights = np.array([size.known_std**-2.0 for size in self.runs.values()])
        share = self.spread * math.sqrt(float(weights @ weights)) / float(weights.sum())
        return share * abs(self.common.value)

    @property
    def farthest(self) -> str:
        """The run with the size farthest from the common one, in standard deviations."""
        away = {
            name: abs(size.value - self.common.value) / size.known_std for name, size in self.runs.items()
        }
        return max(away, key=away.__getitem__)


def units_of(fit: Fit) -> dict[str, str]:
    """Units of the fitted parameters of effects, by full name."""
    infos = {f"{kind.name}.{info.name}": info for kind in fit.problem.effects for info in kind.parameters()}
    return {name: infos[name].unit for name in fit.problem.names if name in infos}


def study_sizes(study: Study) -> tuple[SizeByRun, ...]:
    """The size of each effect of a study's answer in every run; empty where none is fitted to two runs."""
    fit = None if not study.named or study.chosen is study.nominal else in_its_noise(study)
    return () if fit is None else tuple(sizes(fit, study.prepared.kinds))


def in_its_noise(study: Study) -> Fit | None:
    """The fit of the answer, with the response to its random moment in the noise of the runs.

    This motion differs from run to run, so the sizes would differ by more than the errors of the sensor's noise.

    Returns:
        None where the filter of the response does not settle.
    """
    fit = study.chosen
    if study.moment is None:
        return fit
    noisy = with_response(fit, study.moment.process.spectrum)
    return None if noisy is None else fit_at(replace(fit.problem, data=noisy), fit.point)


def sizes(fit: Fit, kinds: Sequence[type[Effect]]) -> Iterator[SizeByRun]:
    """The size of each effect in every run, by a Gauss–Newton step from a fit to all runs.

    "The size in a run" has two meanings. Where single runs show an effect, stiffness and damping are free in
    each run. Where only the comparison of runs shows it, all other parameters are common to the runs.

    Args:
        kinds: the effects that may be named.

    Returns:
        Sizes of the effects with a severity inside its bounds that at least two runs show. The errors include
        the misfit of the run. Cochran's Q tests whether the sizes are equal; their spread is the moment
        estimate of DerSimonian and Laird, Controlled Clinical Trials 7 (1986) 177.
    """
    names, (held, slopes) = fit.problem.names, _by_run(fit.problem, fit.point, fit.residuals, fit.jacobian)
    free, free_slopes = _beside_own_terms(fit, kinds) or (np.zeros_like(held), slopes)
    filled = np.array([run.filled for run in fit.problem.data.runs], np.float64)
    noise = np.maximum(fit.chi2 / np.maximum(filled, 1.0), 1.0)
    for kind in fit.problem.effects:
        name = f"{kind.name}.{kind.parameters()[0].name}"
        if name not in names or fit.bound(name) is not None:
            continue
        place = names.index(name)
        acts = held[:, place] > _ACTS * held[:, place].sum()
        alone = bool(acts.any() and np.median(free[acts, place] / held[acts, place]) > OWN_SHARE)
        information, slope = (free, free_slopes) if alone else (held, slopes)
        yield from _in_runs(name, fit, alone, (acts, information[:, place], slope[:, place], noise))


def _by_run(
    problem: Problem, point: Point, residuals: list[Array], jacobian: Jacobian
) -> tuple[Array, Array]:
    """Information of every run on each common parameter alone, and its gradient, both of shape (runs, common)."""
    precision = problem.parameters.precision
    pull = problem.parameters.pull(point) if precision.any() else None
    matrices, gradients, _ = by_run(jacobian, residuals, products=Products.of(jacobian, precision), pull=pull)
    return np.diagonal(matrices, axis1=1, axis2=2), gradients


def _beside_own_terms(fit: Fit, kinds: Sequence[type[Effect]]) -> tuple[Array, Array] | None:
    """As `_by_run`, with a stiffness and a damping free in each run; None where the runs may not differ."""
    widest = with_own_linear_terms(fit, kinds)
    if widest is None:
        return None
    jacobian = sensitivities(*widest)
    if not all(np.all(np.isfinite(common)) and np.all(np.isfinite(own)) for common, own in jacobian):
        return None
    return _by_run(*widest, scaled_residuals(*widest), jacobian)


def _in_runs(
    name: str, fit: Fit, alone: bool, shown: tuple[NDArray[np.bool_], Array, Array, Array]
) -> Iterator[SizeByRun]:
    """The size of an effect in single runs; None unless two runs show it.

    Args:
        name: full name of the severity, ``effect.parameter``.
        shown: whether the effect acts, information, gradient and misfit by run, each of shape (runs,).
    """
    size, unit, ids = fit.value(name), units_of(fit)[name], [run.id for run in fit.problem.data.runs]
    acts, information, slope, noise = shown
    with np.errstate(divide="ignore", invalid="ignore"):
        values, stds = size + slope / information, np.sqrt(noise / information)
    able = acts & (stds <= SHOWN_SIZE * abs(size))
    places = np.flatnonzero(able)
    if places.size < 2:
        return
    weights = stds[places] ** -2.0
    mean = float(weights @ values[places] / weights.sum())
    total = float(weights @ (values[places] - mean) ** 2)
    beyond = (total - places.size + 1) / (weights.sum() - weights @ weights / weights.sum())
    effect, _, parameter = name.partition(".")
    yield SizeByRun(
        effect,
        parameter,
        Quantity(size, fit.std(name), unit),
        {ids[run]: Quantity(float(values[run]), float(stds[run]), unit) for run in places},
        tuple(ids[run] for run in np.flatnonzero(acts & ~able)),
        alone,
        float(chdtrc(places.size - 1.0, total)),
        float(np.sqrt(max(beyond, 0.0))) / abs(size),
    )
