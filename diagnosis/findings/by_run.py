"""Whether the runs agree on the size of a cause: its size in every run beside the common one.

A correct law gives the same size in every run. If the size differs from run to run by more than its errors, the
law is wrong, or one run differs from the others.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from diagnosis.findings.finding import Answered, Finding, Judged, Picture
from diagnosis.findings.units import own_parameters
from diagnosis.likelihood.least_squares import Fit, fit_at, scaled_residuals
from diagnosis.likelihood.normal_equations import Products, by_run
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.sensitivities import Jacobian, sensitivities
from diagnosis.model.parameters import Point
from diagnosis.search.process_noise import with_response
from diagnosis.search.scatter import with_own_linear_terms
from diagnosis.search.study import Study
from identification.show.blocks import Detail, Paragraph, Section, TextTable
from identification.show.drawing import AFTER, NARROW, NOISE, SOFT
from identification.show.numbers import (
    for_people,
    p_text,
    percent_of,
    plain,
    sentence_case,
    unit_mark,
)
from identification.show.numbers import with_std as sized
from identification.show.quantity import INTERVAL, Quantity
from identification.show.style import figure, grid, styled
from tunnel_sim.effects import Effect, effect_class
from tunnel_sim.vocabulary.errors import counted
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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

    @property
    def words(self) -> str:
        """Whether the runs agree on it, in sentences."""
        size, runs = self.common, f"the {counted(len(self.runs), 'run')} that show it"
        text = f"{sentence_case(plain(self.effect))}: "
        if self.agrees:
            text += (
                f"{runs} agree on {for_people(size.value, size.std, size.unit)} (p {p_text(self.p_value)})."
            )
        else:  # the noise alone is not the error of a size on which the runs differ
            text += (
                f"{for_people(size.value, None, size.unit)} fits all runs best, but {runs} differ by "
                f"{percent_of(self.spread)} beyond their errors (p {p_text(self.p_value)}), {self.farthest} the "
                "most: its law has another form, or a run is odd."
            )
        if self.silent:
            text += f" {sentence_case(counted(len(self.silent), 'run'))} cannot show it."
        return text


@dataclass(frozen=True)
class CausesByRun(Finding):
    """The size of every fitted cause in every run.

    Args:
        causes: the causes with a size that at least two runs show.
    """

    after: ClassVar[str] = "found"

    causes: tuple[SizeByRun, ...]

    @classmethod
    def find(cls, answered: Answered) -> CausesByRun | None:
        """The sizes by linear theory from the fit of the answer; None where no cause is fitted to two runs."""
        study = answered.study
        if not study.named or study.chosen is study.nominal:
            return None

        fit = in_its_noise(study)
        if fit is None:
            return None
        units = _units(fit)
        free = {name: Quantity(fit.value(name), None, units[name]) for name in units}

        def own(cause: SizeByRun, given: Quantity) -> Quantity:
            name = f"{cause.effect}.{cause.parameter}"  # the unit of the information depends on the exponents
            return own_parameters({**free, name: given}, answered.campaign, study.similarity, study.model)[
                name
            ]

        causes = tuple(
            replace(
                cause,
                common=own(cause, cause.common),
                runs={run: own(cause, of) for run, of in cause.runs.items()},
            )
            for cause in sizes(fit, study.prepared.kinds)
        )
        return cls(causes) if causes else None

    def section(self, judged: Judged) -> Section:
        """The causes on which the runs differ, the figure, and in detail the others with the table."""
        heads = tuple(f"{plain(cause.effect)} [{unit_mark(cause.common.unit)}]" for cause in self.causes)
        ids = dict.fromkeys(name for cause in self.causes for name in cause.runs)
        rows = tuple((name, *(_shown(cause.runs.get(name)) for cause in self.causes)) for name in ids)
        table = TextTable("Size of each cause in every run, ± one standard deviation", ("run", *heads), rows,
                          right=heads)  # fmt: skip
        agree, differ = (
            tuple(Paragraph(cause.words, "Run by run") for cause in self.causes if cause.agrees is agrees)
            for agrees in (True, False)
        )
        drawn = (picture.block for picture in self.pictures(judged))
        detail = Detail((*agree, table, Paragraph(self._how, kind="small")))
        return Section("by-run", "Whether the runs agree", (*differ, *drawn, detail))

    @property
    def _how(self) -> str:
        """How the sizes are computed, with the causes to which each method applies."""
        ways = {
            True: "fitted to each run with a stiffness and a damping of its own",
            False: "the size that suits one run, with every other number as in all runs",
        }
        clauses = []
        for alone, way in ways.items():
            names = [cause.effect for cause in self.causes if cause.alone is alone]
            if names:
                clauses.append(f"{plain(*names)}: {way}")
        return f"{sentence_case('; '.join(clauses))}."

    def pictures(self, judged: Judged) -> tuple[Picture, ...]:
        """The size of each cause by run, a panel each."""
        del judged
        caption = "Size of each cause in every run, with 95 % intervals. The band is the size in all runs."
        description = "A forest plot: by run, the size of a cause with its interval, beside the common size."
        return (Picture("by-run", caption, description, partial(forest_figure, self.causes)),)


def _shown(given: Quantity | None) -> str:
    return "–" if given is None else sized(given.value, given.std)


def _units(fit: Fit) -> dict[str, str]:
    """Units of the fitted parameters of effects, by full name."""
    infos = {f"{kind.name}.{info.name}": info for kind in fit.problem.effects for info in kind.parameters()}
    return {name: infos[name].unit for name in fit.problem.names if name in infos}


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
    size, unit, ids = fit.value(name), _units(fit)[name], [run.id for run in fit.problem.data.runs]
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


@styled
def forest_figure(causes: Sequence[SizeByRun]) -> Figure:
    """The size of each cause in every run with its interval, and the common one as a band."""
    tall = [0.8 + 0.2 * len(cause.runs) for cause in causes]
    fig = figure(NARROW, sum(tall))
    for axes, cause in zip(
        fig.subplots(len(causes), 1, squeeze=False, height_ratios=tall)[:, 0], causes, strict=True
    ):
        low, high = cause.common.ends
        axes.axvspan(low, high, color=NOISE, zorder=0)
        axes.axvline(cause.common.value, color=SOFT, lw=1.0)
        rows = np.arange(len(cause.runs))
        values = [given.value for given in cause.runs.values()]
        reach = [INTERVAL * given.known_std for given in cause.runs.values()]
        axes.errorbar(values, rows, xerr=reach, fmt="o", ms=4, color=AFTER, capsize=2)
        axes.set_yticks(rows, list(cause.runs))
        axes.set(ylim=(len(rows) - 0.4, -0.6))
        symbol = next(
            info.symbol for info in effect_class(cause.effect).parameters() if info.name == cause.parameter
        )
        axes.set_xlabel(f"{plain(cause.effect)} {symbol} [{unit_mark(cause.common.unit)}]")
        axes.locator_params(axis="x", nbins=5)
        grid(axes)
    return fig
