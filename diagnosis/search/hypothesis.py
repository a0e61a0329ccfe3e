"""The nominal model with effects added and fitted; their forms are freed where that pays."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, TypeAlias

import numpy as np

from diagnosis.likelihood.least_squares import Fit, scaled_residuals, try_fit
from diagnosis.likelihood.other_minima import deepest
from diagnosis.likelihood.part_of_fit import sought_again
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.residuals import CHANNELS, ChannelMisfit, linear_coefficients, misfit, resonance
from diagnosis.model.data import Data
from diagnosis.model.parameters import Point
from diagnosis.search.process_noise import MomentLayer
from diagnosis.search.weights import FittedSet, least_excess, log_weight, misfit_scale
from diagnosis.settings import WeighingSettings
from tunnel_sim.effects.capabilities import OwnNumbers
from tunnel_sim.vocabulary.record import Array

NEEDLESS_SPRING: Final = 0.05
"""Maximum stiffness of an unstated spring, as a share of its stiffness with gravity, for the rig to have no
spring. Judgement (decision 0007). The set then counts two parameters less: otherwise the spring would have to
soften by chance exactly as much as gravity does."""

FORM_NEEDED: Final = 0.2
"""Minimum rise of χ² without a freed form, as a share of the excess, for the form to be kept. Tuned (decision
0006)."""
FREED_HYPOTHESES: Final = 3
"""Number of sets of one effect whose forms are freed. Judgement (decision 0006). Time against coverage."""
GRAVITY_CANCELS: Final = 0.8
"""Maximum share of an unstated spring that gravity may cancel. Judgement (decision 0029). Beyond this share
spring and gravity together imitate a nonlinear spring. Silverbox is not an independent test."""
PLAUSIBLE_RUNS: Final = 0.5
"""Minimum share of the runs in which an effect must agree with its definition. Convention."""
TURNED_AS_WELL: Final = 1.01
"""Maximum ratio of χ² for a fit with the angle turned by half a turn to explain the readings equally well.
Judgement."""

#: The parameters of a general form, as ``effect.parameter``.
Form: TypeAlias = tuple[str, ...]

_POLISH = 1e-7  # drop of χ², as a share of χ², at which a polished fit has converged
_SAME_READING = 0.2  # noise standard deviations of a block mean


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """The nominal model with effects added, fitted.

    Args:
        effects: names, in the order they were added; without a random moment.
        fit: the fit, in the noise of the sensor.
        textbook: the fit with the textbook form, where forms were freed; else None.
        short: the same set fitted to shorter stretches of the runs, where effects are added there.
        repeating: the same set fitted to runs that repeat exactly; effects are added to it, too.
        plain: a fit with the textbook form, if free forms add no weight to it; None: no such fit is known.
        moment: the random moment beside the effects; None where there is none.
    """

    effects: tuple[str, ...]
    fit: Fit
    textbook: Fit | None = None
    short: Hypothesis | None = None
    repeating: Fit | None = None
    plain: Fit | None = None
    moment: MomentLayer | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the causes, sorted, each listed once even if it acts both steadily and at random."""
        kinds = () if self.moment is None else self.moment.kinds
        return tuple(sorted({*self.effects, *(kind.name for kind in kinds)}))

    @property
    def fit_of_answer(self) -> Fit:
        """The fit that supplies the answer's parameters: beside a random moment, the fit to runs that repeat.

        The random motion is larger than the differences between the runs. Beside it, narrow deviations would
        bias the common parameters.
        """
        return self.fit if self.moment is None else self.repeating or self.fit

    @property
    def forms(self) -> int:
        """Number of freed form parameters."""
        return len(self.fit.problem.free_forms)

    @property
    def further_numbers(self) -> int:
        """Freed form parameters and instants in a run, less two where gravity replaces a spring.

        An instant absorbs any slow phase error, as a form does. Without gravity, a spring would have to soften
        by chance, and by as much as gravity does.
        """
        problem = self.fit.problem
        numbers = self.forms + sum(
            kind.numbers_like_forms(problem.instants)
            for kind in problem.effects
            if issubclass(kind, OwnNumbers)
        )
        spring = self.fit.fitted_spring
        if spring is not None:
            needless = NEEDLESS_SPRING * linear_coefficients(self.fit, 0)[2]
            numbers -= 2 * (spring < needless)
        return numbers

    @property
    def under_load(self) -> bool:
        """Whether the set is one effect that may grow with the moment of an actuator.

        The misfit of its textbook form then says little about its form under load.
        """
        problem = self.fit.problem
        by_load = any(info.of_load for kind in problem.effects for info in kind.parameters())
        return by_load and len(self.effects) == 1 and problem.data.driven and problem.carries_load

    @cached_property
    def excess(self) -> Array:
        """χ² beyond noise of the set, by channel, shape (6,), dimensionless.

        The chance gain of instants is added in the frequency, the chance gain of phases in the harmonics.
        """
        problem = self.fit.problem
        found, gain = misfit(self.fit).excess, self.fit.settings.weighing.own_number_gain
        for kind in problem.effects:
            if issubclass(kind, OwnNumbers):
                count = len(kind.per_run_parameters(problem.instants)) * len(problem.data.runs)
                found[CHANNELS.index(kind.gains_in())] += gain * count
        return found

    @cached_property
    def explains_runs(self) -> bool:
        """Whether every run is explained down to chance, in runs that differ by chance."""
        return bool(self.fit.problem.scatter) and self.leaves_within(np.zeros(len(CHANNELS)))

    def leaves_within(self, error: Array) -> bool:
        """Whether the misfit in every channel is at most chance plus an error.

        Args:
            error: χ² by channel, shape (6,), dimensionless.
        """
        found, weighing = misfit(self.fit), self.fit.settings.weighing
        by_chance = weighing.needless_chi2 + weighing.chance_stds * np.sqrt(2.0 * found.count)
        return bool(np.all(found.excess < by_chance + error))

    def fitted_set(self, nominal: Fit, gap: ChannelMisfit, *, outside: bool = False) -> FittedSet:
        """The set as input of the weighing, with the chance gain of instants and phases added to its misfit.

        Args:
            nominal: the nominal fit; shares refer to its gap.
            gap: the misfit that the set is weighed against.
            outside: as in `FittedSet`.
        """
        if self.moment is not None:
            return self.moment.left
        by_chance = own_gain(self.fit.problem) / self.fit.count
        share = (self.fit.excess + by_chance) / nominal.gap
        cost = self.fit.scatter_cost(gap.deviation_precision)
        between = self.fit.shown_between_runs
        return FittedSet(self.effects, share, self.excess, self.further_numbers, outside, cost, between)


@dataclass(frozen=True, eq=False)
class Scale:
    """The reference for comparing sets: the misfit that needs no cause, and the least misfit of any set.

    Args:
        misfit: χ² by channel, shape (6,).
        least: χ² by channel, shape (6,), 0 or less.
        chosen: how sets are weighed.
        scatter_cost: cost of the nominal model's scatter, as in `ChannelMisfit`, dimensionless.
        deviation_precision: as in `ChannelMisfit`, shape (runs, kinds, kinds).
    """

    misfit: Array
    least: Array
    chosen: WeighingSettings
    scatter_cost: float
    deviation_precision: Array

    @classmethod
    def of(cls, sets: Sequence[Hypothesis], gap: ChannelMisfit, chosen: WeighingSettings) -> Scale:
        """The scale of some sets, from the misfit of the nominal model."""
        least = least_excess([h.excess for h in sets])
        return cls(misfit_scale(gap, chosen), least, chosen, gap.scatter_cost, gap.deviation_precision)

    def weight(self, hypothesis: Hypothesis) -> float:
        """Logarithm of the weight of a set."""
        cost = hypothesis.fit.scatter_cost(self.deviation_precision)
        return self._log_weight(hypothesis.excess - self.least, hypothesis, scatter_cost=cost)

    def weight_of(self, given: FittedSet) -> float:
        """Logarithm of the weight of a set with known misfit."""
        costs, left = (given.scatter_cost, self.scatter_cost), given.excess - self.least
        return log_weight(
            left, self.misfit, len(given.effects), given.numbers, self.chosen, costs, given.shown_between_runs
        )

    def greatest(self, hypothesis: Hypothesis, *, repeating: bool = True) -> float:
        """Logarithm of the weight of the set with one more effect and no residual.

        Args:
            repeating: whether the runs then repeat; else they differ by chance as before.
        """
        cost = 0.0 if repeating else hypothesis.fit.scatter_cost(self.deviation_precision)
        return self._log_weight(np.zeros(6), hypothesis, effects=1, scatter_cost=cost)

    def with_form(self, hypothesis: Hypothesis) -> float:
        """Logarithm of the weight of the set with one more form and no residual.

        Deviations of the runs may be as wide as they are because they follow the error of the textbook form.
        """
        cost = min(hypothesis.fit.scatter_cost(self.deviation_precision), self.scatter_cost)
        return self._log_weight(np.zeros(6), hypothesis, numbers=1, scatter_cost=cost)

    def _log_weight(
        self, left: Array, of: Hypothesis, *, effects: int = 0, numbers: int = 0, scatter_cost: float = 0.0
    ) -> float:
        """Logarithm of the weight of a set with a misfit ``left`` and further effects and parameters."""
        count, further = len(of.effects) + effects, of.further_numbers + numbers
        costs = scatter_cost, self.scatter_cost
        return log_weight(left, self.misfit, count, further, self.chosen, costs, of.fit.shown_between_runs)


def of_more_weight(one: Hypothesis | None, other: Hypothesis, gap: ChannelMisfit) -> Hypothesis:
    """The set of more weight, given the misfit of the nominal model; the first if they are equal."""
    if one is None:
        return other
    return max(one, other, key=Scale.of((one, other), gap, other.fit.settings.weighing).weight)


def own_gain(problem: Problem) -> float:
    """Drop of χ² by chance due to the instants and phases of single runs."""
    gain = problem.data.settings.weighing.own_number_gain
    return float(gain * problem.parameters.of_effects * len(problem.data.runs))


def is_plausible(fitted: Fit) -> bool:
    """Whether, in enough of the runs, every effect of a fit still has the meaning of its name.

    Gravity that cancels most of an unstated spring fails: it imitates a nonlinear spring. A power law fails if
    its free exponent ends at a bound, and friction if its rate does: the readings ask for another law.
    """
    problem, effects = fitted.problem, fitted.problem.effects_at(fitted.point.common)
    spring, gravity = fitted.fitted_spring, sum(effect.stiffness_at_rest for effect in effects)
    if spring is not None and -gravity > GRAVITY_CANCELS * spring:
        return False
    inside = [
        f"{kind.name}.{info.name}" for kind in problem.effects for info in kind.parameters() if info.inside
    ]
    if any(name in problem.names and fitted.bound(name) for name in inside):
        return False
    runs = problem.data.runs
    motions = [(2.0 * np.pi * resonance(fitted, place), run.duration) for place, run in enumerate(runs)]
    readings = extremes(problem.data)
    return all(
        np.mean([effect.plausible(*motion, readings) for motion in motions]) >= PLAUSIBLE_RUNS
        for effect in effects
    )


def extremes(data: Data) -> tuple[float, float]:
    """The least and the greatest reading of a campaign."""
    least, greatest = zip(*((run.reading.min(), run.reading.max()) for run in data.runs), strict=True)
    return float(min(least)), float(max(greatest))


def turned_back(fitted: Fit) -> Fit:
    """The fit with the sensor's zero within the readings.

    Gravity of the opposite sign, half a turn away, moves the body alike, so fits of large swings may end there.

    Returns:
        If the zero is outside the readings, the fit that starts half a turn nearer, provided that it explains
        them as well; else the given fit.
    """
    problem = fitted.problem
    least, greatest = extremes(problem.data)
    signs = [f"{kind.name}.{kind.turns}" for kind in problem.effects if kind.turns]
    if not signs or "zero" not in problem.names or least <= fitted.value("zero") <= greatest:
        return fitted
    turn = np.pi if fitted.value("zero") < least else -np.pi
    common, release = fitted.point.common.copy(), fitted.point.per_run.copy()
    common[problem.names.index("zero")] += turn
    common[[problem.names.index(name) for name in signs]] *= -1.0
    release[:, 0] -= turn
    turned = try_fit(problem, Point(common, release))
    greatest = TURNED_AS_WELL * fitted.total
    return fitted if turned is None or turned.total >= greatest else turned


def with_forms(
    found: Sequence[Hypothesis], gap: ChannelMisfit, least: float, count: int = FREED_HYPOTHESES
) -> list[Hypothesis]:
    """Free the forms of the best hypotheses where the textbook form leaves a large residual and they gain weight.

    A hypothesis is not tried if it would weigh less than the best one even without a residual. The deepest
    minimum of the textbook form is sought first: a rod fitted at a wrong ringing frequency does not need a
    form.

    Args:
        gap: misfit of the nominal model.
        least: minimum excess of a textbook form for it to be freed, in noise variances.
        count: number of best hypotheses tried with free forms, in addition to effects that may act under load.

    Returns:
        All hypotheses, best first.
    """
    ranked = sorted(found, key=lambda h: h.fit.total)
    for place, hypothesis in enumerate(ranked):
        textbook = hypothesis.fit
        if place >= count and not hypothesis.under_load:
            continue
        scale = Scale.of(ranked, gap, textbook.settings.weighing)
        needless = textbook is hypothesis.plain or textbook.excess <= least
        if needless or scale.with_form(hypothesis) <= max(map(scale.weight, ranked)):
            continue
        textbook = deepest(textbook)
        ranked[place] = hypothesis = dataclasses.replace(hypothesis, fit=textbook)
        tried: dict[tuple[Form, ...], Fit | None] = {}
        for forms in _choices(textbook):
            parts = [fit for part, fit in tried.items() if _within(part, forms)]
            if parts and parts[0] is None:
                continue  # a combination: its first form must gain alone, and may hide the gain of the others
            gained = (fit for fit in parts if fit is not None)
            start = min(gained, key=lambda fit: fit.total, default=textbook)
            tried[forms] = freed = _free_forms(start, forms)
            if freed is None or (parts and not _explains_more(freed, start)):
                continue
            needed = _needed(freed, forms, FORM_NEEDED * textbook.excess * textbook.count)
            if needed and needed != forms:
                freed = _free_forms(textbook, needed) or freed
            ranked[place] = of_more_weight(
                ranked[place], dataclasses.replace(hypothesis, fit=freed, textbook=textbook), gap
            )
        if ranked[place] is hypothesis:
            ranked[place] = dataclasses.replace(hypothesis, plain=textbook)
    return sorted(ranked, key=lambda h: h.fit.total)


def _choices(fitted: Fit) -> Iterator[tuple[Form, ...]]:
    """All combinations of one form of every effect."""
    by_effect = _forms_by_effect(fitted)
    return itertools.product(*by_effect) if by_effect else iter(())


def _within(part: Sequence[Form], forms: Sequence[Form]) -> bool:
    """Whether the form of every effect contains the other choice's form."""
    return all(set(one) <= set(other) for one, other in zip(part, forms, strict=True))


def _forms_by_effect(fitted: Fit) -> list[list[Form]]:
    """The forms of every effect that the runs can show; if some are free already, the largest of those only."""
    free, load_varies = fitted.problem.free_forms, fitted.problem.carries_load
    by_effect = [
        [tuple(f"{kind.name}.{name}" for name in form) for form in kind.shown_forms(load_varies=load_varies)]
        for kind in fitted.problem.effects
    ]
    known = ([form for form in forms if set(form) <= set(free)] for forms in by_effect)
    return [
        [max(kept, key=len)] if kept else forms for kept, forms in zip(known, by_effect, strict=True) if forms
    ]


def _needed(freed: Fit, forms: Collection[Form], rise: float) -> tuple[Form, ...]:
    """The forms that would raise χ² by more than a given amount in the textbook form."""
    infos = {f"{k.name}.{i.name}": i for k in freed.problem.effects for i in k.parameters()}

    def pull(name: str) -> float:
        std = freed.std(name)  # 0 for an undetermined form
        return (freed.value(name) - infos[name].default) / std if std > 0.0 else 0.0

    return tuple(form for form in forms if max(pull(name) ** 2 for name in form) > rise)


def converged(fitted: Fit) -> Fit:
    """The fit continued to convergence; the given fit where that fails."""
    return try_fit(fitted.problem, fitted.point, tolerance=_POLISH) or fitted


def polish(chosen: Hypothesis) -> Hypothesis:
    """The hypothesis fitted to convergence with its forms free, so that its covariance includes the forms.

    Returns:
        The effects stay the same, and χ² does not rise, except by resolving the rod's ringing. The hypothesis
        is unchanged where the fit fails.
    """
    first = chosen.fit
    problem = dataclasses.replace(first.problem, resolve_rod_mode=True)
    followed = zip(scaled_residuals(problem, first.point), first.residuals, strict=True)
    if max(float(np.max(np.abs(one - other))) for one, other in followed) >= _SAME_READING:
        # adding the ringing to the slow motion is not exact enough; the confirmation states the error
        first = try_fit(problem, first.point) or first
    forms = _first_forms(first) if chosen.plain is chosen.fit else _likeliest_forms(first)
    better = _free_forms(first, forms, tolerance=_POLISH) or try_fit(
        first.problem, first.point, tolerance=_POLISH
    )
    if better is None or better.total > first.total:
        better = first
    better = deepest(better, tolerance=_POLISH)
    textbook = None
    if better.problem.free_forms and not first.problem.free_forms:
        textbook = first
    elif better.problem.free_forms:
        problem = dataclasses.replace(better.problem, free_forms=())
        values = dict(zip(better.problem.names, better.point.common.tolist(), strict=True))
        start = Point(np.array([values[name] for name in problem.names]), better.point.per_run)
        textbook = try_fit(problem, start)
    return Hypothesis(chosen.effects, better, textbook)


def _first_forms(fitted: Fit) -> tuple[Form, ...]:
    """The first form of every effect."""
    return tuple(forms[0] for forms in _forms_by_effect(fitted))


def _likeliest_forms(fitted: Fit) -> tuple[Form, ...]:
    """The first form of every effect, or another that explains much of the residual, beyond chance.

    Where the noise is overestimated, even a wrong form may leave less than the noise.
    """
    by_effect, best = _forms_by_effect(fitted), _first_forms(fitted)

    def total(forms: tuple[Form, ...]) -> float:
        freed = _free_forms(fitted, forms)
        return fitted.total if freed is None else freed.total

    if all(len(forms) == 1 for forms in by_effect):
        return best
    least = total(best)
    for place, forms in enumerate(by_effect):
        for form in forms[1:]:
            tried = (*best[:place], form, *best[place + 1 :])
            if (left := total(tried)) < _worth_a_form(fitted, least):
                best, least = tried, left
    return best


def _worth_a_form(fitted: Fit, least: float) -> float:
    """Maximum χ² of another form that explains much of the residual, beyond chance, dimensionless.

    Args:
        least: χ² with the forms so far.
    """
    gain = FORM_NEEDED * (least - fitted.count)
    return least - max(gain, fitted.settings.weighing.needless_chi2)


def _explains_more(together: Fit, alone: Fit) -> bool:
    """Whether forms together explain more than the part of them that gains most."""
    return together.total < _worth_a_form(alone, alone.total)


def _free_forms(fitted: Fit, forms: Collection[Form], tolerance: float = 1e-4) -> Fit | None:
    """The same effects with only some forms free; None if no form is free, or there is no gain.

    Instants and phases are sought again: beside the textbook form they may follow its error.
    """
    problem = fitted.problem
    if not forms:
        return None
    freed = dataclasses.replace(problem, free_forms=tuple(name for form in forms for name in form))
    values = dict(zip(problem.names, fitted.point.common.tolist(), strict=True))
    defaults = {f"{k.name}.{i.name}": i.form_start for k in problem.effects for i in k.parameters() if i.form}
    start = Point(np.array([(defaults | values)[name] for name in freed.names]), fitted.point.per_run)
    found = try_fit(freed, start, tolerance=tolerance)
    found = None if found is None else sought_again(found)
    if found is None or not any(found.std(name) > 0.0 for name in freed.names if name not in values):
        return None  # also if the runs determine no form
    return found if found.total < fitted.total and is_plausible(found) else None
