"""Coefficients before and after the causes are added: averages over the answers, with intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri

from diagnosis.answer.linear_theory import (
    Beside,
    alone,
    beside,
    coefficient_gradients,
    coefficient_move,
    coefficients_of,
    influences,
    starts_beside,
    wind_on_runs,
)
from diagnosis.findings.candidates import meant_coefficient
from diagnosis.findings.hidden import Hidden, hidden_effects
from diagnosis.likelihood.least_squares import Fit
from diagnosis.model.similarity import Similarity
from diagnosis.search.answer import UNKNOWN, Answer
from diagnosis.search.rivals.rival import explaining
from diagnosis.search.study import Study
from diagnosis.settings import AnswerSettings
from identification.estimate import Estimate
from identification.show.quantity import Quantity
from identification.statistics import density_rounding
from tunnel_sim.effects import Effect
from tunnel_sim.effects.capabilities import OutOfPhase
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.freedom import unit_of_frequency
from tunnel_sim.vocabulary.record import Array

SKEWED_FROM: Final = 0.1
"""Least deviation of an interval's ends from a normal distribution's ends for the interval to be stated, in
standard deviations. Judgement."""
HELD_WITHIN: Final = 0.02
"""Least departure of the probability within a normal distribution's ends from the stated probability for the
interval to be stated, a fraction. Judgement. Of two narrow answers far apart, a small shift of an end loses
much."""
SMALL_CAUSES_FROM: Final = 0.05
"""Minimum probability of an answer for small causes to be considered beside it. Judgement."""

_REACH = 8.5  # standard deviations beyond which a normal distribution has no probability in 64 bits
_MOST_STEPS = 500


@dataclass(frozen=True, eq=False)
class NormalMixture:
    """A mixture of normal distributions.

    Args:
        weights: their probabilities, which sum to 1, shape (n,).
        means: in the quantity's unit, shape (n,).
        variances: about their means, in the unit squared, shape (n,).
    """

    weights: Array
    means: Array
    variances: Array

    @property
    def mean(self) -> float:
        """Mean of the mixture."""
        return float(self.weights @ self.means)

    @property
    def between(self) -> float:
        """Variance of the means."""
        return float(self.weights @ (self.means - self.mean) ** 2)

    @property
    def std(self) -> float:
        """Standard deviation, by the law of total variance: within and between the distributions."""
        return math.sqrt(float(self.weights @ self.variances) + self.between)

    def mean_between(self, low: float, high: float) -> float:
        """Mean of the part of the mixture between two values, in the quantity's unit."""
        stds = np.maximum(np.sqrt(self.variances), 1e-300)
        ends = [(end - self.means) / stds for end in (low, high)]
        inside = self.weights * (ndtr(ends[1]) - ndtr(ends[0]))
        densities = [np.exp(-0.5 * end**2) / math.sqrt(2.0 * math.pi) for end in ends]
        moments = self.means * inside - self.weights * stds * (densities[1] - densities[0])
        return float(moments.sum() / inside.sum()) if inside.sum() > 0.0 else self.mean

    def held(self, low: float, high: float) -> float:
        """The probability between two values."""
        stds = np.maximum(np.sqrt(self.variances), 1e-300)
        return float(self.weights @ (ndtr((high - self.means) / stds) - ndtr((low - self.means) / stds)))

    def quantile(self, share: float) -> float:
        """The value below which the mixture has a given probability.

        Args:
            share: the probability, above 0 and below 1.
        """
        stds = np.sqrt(self.variances)
        low, high = float(np.min(self.means - _REACH * stds)), float(np.max(self.means + _REACH * stds))
        # a probability of 0 or 1: the value is certain
        low, high = np.nextafter(low, -np.inf), np.nextafter(high, np.inf)
        widths = np.maximum(stds, 1e-300)
        precision = max(1e-16 * (high - low), 1e-300)

        def excess(value: float) -> float:
            return float(self.weights @ ndtr((value - self.means) / widths)) - share

        return float(brentq(excess, low, high, xtol=precision, maxiter=_MOST_STEPS))


_SOURCES = (
    "noise", "scatter", "misfit", "small causes", "air density", "unseen form", "freed form", "rivals",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Possible:
    """An answer with its fit.

    Args:
        probability: of the answer, a fraction; over all answers they need not sum to 1.
        textbook: the same effects in textbook form, where the fit freed their forms.
        small: the small causes that may act beside the answer; None: neither they nor a misfit are considered.
    """

    probability: float
    fit: Fit
    textbook: Fit | None = None
    small: Beside | None = None


@dataclass(frozen=True, eq=False)
class Answers:
    """The answers over which coefficients are averaged.

    Args:
        unknown: probability (a fraction) of ``unknown`` where an answer with named effects is chosen.
        hidden: upper limits on the effects that were not detected beside the chosen answer.
    """

    possible: tuple[Possible, ...]
    unknown: float
    nominal: Fit
    hidden: tuple[Hidden, ...] = ()


def possible_answers(study: Study, kinds: Sequence[type[Effect]]) -> Answers:
    """The answers of a study, without the evenly spread part of their probabilities.

    That part represents causes not considered, not an answer that the runs refute. An unknown cause may be each of
    the causes from outside the vocabulary that explain the gap, or none of them: it is divided evenly.

    Args:
        kinds: the effects that may act unnamed. They are considered beside the chosen answer and every probable
            answer, if there is a gap.
    """
    chosen = study.stated
    even = study.settings.weighing.even_share / max(len(study.answers), 1)
    others, probability_of_answer, unknown = [], 1.0, 0.0
    for place, answer in enumerate(study.answers):
        probability, fit = max(answer.probability - even, 0.0), answer.fit
        if place == 0:
            probability_of_answer = probability
        elif answer.effects == UNKNOWN:
            unknown = probability
        elif fit is not None and probability > 0.0:
            small = beside(fit, starts_beside(fit, kinds)) if probability >= SMALL_CAUSES_FROM else None
            share, alternatives = _by_choice(answer, fit, probability, kinds)
            others += [Possible(probability * share, fit, answer.textbook_of(fit), small), *alternatives]
    answer = study.answer or Answer((), 1.0, 1.0)
    share, alternatives = _by_choice(answer, chosen, probability_of_answer, kinds)
    if answer.effects == UNKNOWN:
        outside = [one.best.fit for one in explaining(study.rivals, study.nominal)]
        share = 1.0 / (1 + len(outside))
        alternatives = [Possible(probability_of_answer * share, fit) for fit in outside]
    starts = starts_beside(chosen, kinds)
    small = beside(chosen, starts) if study.causes else None
    hidden = hidden_effects(chosen, starts, None if small is None else small.residuals)
    first = Possible(probability_of_answer * share, chosen, answer.textbook_of(chosen), small)
    return Answers((first, *alternatives, *others), unknown, study.nominal, hidden)


def _by_choice(
    answer: Answer, fit: Fit, probability: float, kinds: Sequence[type[Effect]]
) -> tuple[float, list[Possible]]:
    """The share of the fit among the choices that the runs cannot exclude, and the other choices."""
    share, others = 1.0, []
    for choice in answer.choices:
        if choice.hypothesis.fit is fit:
            share = choice.probability
        else:
            small = beside(choice.hypothesis.fit, starts_beside(choice.hypothesis.fit, kinds))
            others.append(Possible(probability * choice.probability, choice.hypothesis.fit, None, small))
    return share, others


def coefficients(answers: Answers, campaign: Campaign) -> dict[str, Quantity]:
    """The coefficients averaged over the answers.

    Args:
        campaign: gives the digits to which the air density is stated.

    Returns:
        The coefficients, by their names in the nominal model; ``omega_n`` and ``zeta`` hold for small swings.
        Their distribution is a mixture over the answers and over the sets of small causes beside them
        (`diagnosis.answer.linear_theory`), with their probabilities; value and deviation describe its centre
        (`Central`).

        The variance within an answer is the sum of

        - the variance of the fit;
        - the scatter of the runs where it exceeds chance, or half the difference between two halves of the data
          (`coefficient_move`) if that is greater;
        - the rounding of the air density;
        - the part of the causes' forms that no free decay shows;
        - half the change by freeing the forms, since another family of forms may change as much.

        ``unknown`` also adds half the change from the nominal model. No standard deviation is given at a bound, or
        where the runs do not determine the coefficient. An effect that is too small to be detected adds nothing:
        its upper limit stands beside the coefficients (`diagnosis.findings.hidden`).
    """
    fit, estimates, chosen = answers.possible[0].fit, {}, answers.nominal.settings.answer
    for name in coefficients_of(fit):
        if _value(fit, name) is None:
            continue  # fixed
        each = [of for one in answers.possible if (of := _of_answer(one, campaign, name)) is not None]
        _, first, parts = each[0]
        change = chosen.unknown_std * (first.mean - (_value(answers.nominal, name) or first.mean))
        if answers.unknown > 0.0:
            doubted = NormalMixture(first.weights, first.means, first.variances + change**2)
            each.append((answers.unknown, doubted, {**parts, "rivals": change**2}))
        probability = np.array([p for p, _, _ in each])
        probability /= probability.sum()
        whole = NormalMixture(
            np.concatenate([p * m.weights for p, (_, m, _) in zip(probability, each, strict=True)]),
            np.concatenate([m.means for _, m, _ in each]),
            np.concatenate([m.variances for _, m, _ in each]),
        )
        centre = Central.of(whole, chosen)
        shares = _budget(parts, centre.std**2)
        estimates[name] = _estimate(fit, name, centre.value, centre.std, shares)
        if estimates[name].std is not None:
            estimates[name] = replace(estimates[name], interval=centre.interval)
    return estimates


def correlation(answers: Answers, averaged: Mapping[str, Quantity]) -> tuple[tuple[float, ...], ...]:
    """The correlation of the coefficients by noise, small causes and rivals; see `Coefficients`.

    Args:
        averaged: the coefficients averaged over the answers.

    Returns:
        In the order of the coefficients, shape (n, n).
    """
    weights, means, noise = [], [], np.zeros((len(averaged), len(averaged)))
    for answer in answers.possible:
        values, known = [_value(answer.fit, name) for name in averaged], coefficients_of(answer.fit)
        if answer.probability <= 0.0 or None in values:
            continue
        small, places = answer.small or alone(answer.fit), [known.index(name) for name in averaged]
        gradients = coefficient_gradients(answer.fit)[places]
        noise += answer.probability * gradients @ answer.fit.stated_covariance @ gradients.T
        weights.append(answer.probability * small.weights)
        means.append(np.array(values) + small.moves[:, places])
    if not means:
        return ()
    weight, mean = np.concatenate(weights), np.concatenate(means)
    away = mean - weight @ mean / weight.sum()
    shared = (noise + (away.T * weight) @ away) / weight.sum()
    whole = np.maximum([(quantity.std or 0.0) ** 2 for quantity in averaged.values()], np.diag(shared))
    scale = np.sqrt(np.maximum(whole, 1e-300))
    shared = shared / np.outer(scale, scale)
    np.fill_diagonal(shared, 1.0)
    return tuple(tuple(row) for row in shared.tolist())


def as_identified(
    averaged: Mapping[str, Quantity], estimate: Estimate, campaign: Campaign, similarity: Similarity
) -> dict[str, Quantity]:
    """The coefficients with the values and deviations of an estimate of the same runs, in the similar campaign.

    Without a cause both fit the same model to the same readings, so there is one number for each coefficient. A
    coefficient that the estimate does not state is unchanged; ωn and ζ come from a campaign of one run.
    """
    runs = estimate.runs if len(estimate.runs) == 1 else ()
    repeatability, same = estimate.repeatability, dict(averaged)
    for name in averaged:
        given = next((one for of in (estimate, *runs) if (one := getattr(of, name, None)) is not None), None)
        if not isinstance(given, Quantity) or given.known_std <= 0.0:
            continue
        parts = {"scatter": 0.0, "air density": 0.0}
        if name in estimate.parameters and repeatability is not None:
            place = estimate.parameters.index(name)
            parts["scatter"] = sum(one[place][place] for one in repeatability.covariances)
        if name.startswith("cn_"):
            parts["air density"] = (given.value * density_rounding(campaign.runs)) ** 2
        shares = {source: min(part / given.known_std**2, 1.0) for source, part in parts.items()}
        shares = {"noise": max(1.0 - sum(shares.values()), 0.0), **shares}
        unit = unit_of_frequency(name, given.unit)
        value, std = (similarity.similar(one, unit) for one in (given.value, given.known_std))
        ends = given.interval and tuple(similarity.similar(end, unit) for end in given.interval)
        interval = (ends[0], ends[1]) if ends else None
        same[name] = Quantity(value, std, given.unit, shares=shares, interval=interval)
    return same


_STEP = 1e-3  # of a parameter, in standard deviations, for the derivatives of the coefficients in phase


def in_phase(fit: Fit) -> tuple[dict[str, Quantity], tuple[tuple[float, ...], ...]]:
    """Cnβ and Cnr in phase with angle and rate (decision 0004), and the covariance of all four coefficients.

    No free decay shows one part of an effect's form. That part moves Cnr along the effect's contribution in
    phase, so it adds nothing to the coefficients in phase.

    Returns:
        By name, and the covariance of Cnβ and Cnr of the fitted law and of both in phase, shape (4, 4); both empty
        where no effect of the fit has a part in phase.
    """
    names = fit.problem.names
    if not {"cn_beta", "cn_r"} <= set(names):
        return {}, ()
    runs, own = wind_on_runs(fit), [names.index("cn_beta"), names.index("cn_r")]

    def both(common: Array) -> Array:
        beta, rate = (float(common[place]) for place in own)
        found = beta, rate
        for effect in fit.problem.effects_at(common):
            found = effect.in_phase(*found, runs) if isinstance(effect, OutOfPhase) else found
        return np.array([beta, rate, *found])

    here = both(fit.point.common)
    if np.array_equal(here[:2], here[2:]):
        return {}, ()
    covariance, slopes = fit.stated_covariance, []
    ends = np.array(fit.problem.bounds)
    for place, std in enumerate(np.sqrt(np.maximum(np.diag(covariance), 0.0))):
        low, high = fit.point.common.copy(), fit.point.common.copy()
        # an undetermined parameter has a deviation far beyond its range
        reach = np.clip(
            fit.point.common[place] + _STEP * (std or 1.0) * np.array([-1.0, 1.0]), *ends[:, place]
        )
        low[place], high[place] = reach
        slopes.append((both(high) - both(low)) / (high[place] - low[place]))
    jacobian = np.array(slopes).T
    matrix = jacobian @ covariance @ jacobian.T
    for effect in fit.problem.effects_at(fit.point.common):
        unseen = np.array([*effect.unseen_form(here[0], runs), 0.0, 0.0])
        matrix += np.diag(unseen**2)
    estimates = {
        name: Quantity(float(here[i]), math.sqrt(max(float(matrix[i, i]), 0.0)), "1/rad")
        for i, name in ((2, "cn_beta"), (3, "cn_r"))
    }
    return estimates, tuple(map(tuple, matrix.tolist()))


@dataclass(frozen=True)
class Central:
    """The centre of a mixture, and its spread about it.

    An improbable rival with a distant mean may contribute most of the variance, and move the mean by more than
    the deviation of the answer. The central interval contains the rival only if its probability is large
    enough.

    Args:
        value: mean of the part within the central interval.
        std: half the length of the central interval, over a standard normal distribution's half length.
        interval: the ends of the interval where it differs from a normal distribution's; else None.
    """

    value: float
    std: float
    interval: tuple[float, float] | None

    @classmethod
    def of(cls, whole: NormalMixture, chosen: AnswerSettings) -> Central:
        """The centre of a mixture, in its unit."""
        tail = 0.5 * (1.0 - chosen.coefficient_interval)
        low, high = whole.quantile(tail), whole.quantile(1.0 - tail)
        middle = whole.mean_between(low, high)
        reach = 0.5 * (high - low)
        std = reach / float(ndtri(1.0 - tail))
        skew = max(abs(low - middle + reach), abs(high - middle - reach))
        held = whole.held(middle - reach, middle + reach)
        differs = skew > SKEWED_FROM * std or abs(held - chosen.coefficient_interval) > HELD_WITHIN
        return cls(middle, std, (low, high) if differs else None)


def before_the_causes(nominal: Fit, after: Mapping[str, Quantity]) -> dict[str, Quantity]:
    """The coefficients of the nominal model.

    Args:
        after: the averages over the answers; the squared difference from them is added to the variance.
    """
    before = {}
    for place, name in enumerate(coefficients_of(nominal)):
        value, given = _value(nominal, name), after.get(name)
        if value is None or given is None:
            continue
        parts = {"causes": (value - given.value) ** 2} if given.value != value else {}
        if given.std is None:
            parts["noise"] = float(alone(nominal).noise[0, place])
        else:
            parts |= {source: share * given.std**2 for source, share in given.shares.items()}
        before[name] = _estimate(nominal, name, value, math.sqrt(sum(parts.values())), parts)
    return before


def _budget(parts: Mapping[str, float], variance: float) -> dict[str, float]:
    """Variances by source: the sources within the answer, and the rest from the other answers.

    The answer's own variances are scaled where another answer narrows the interval.
    """
    within = sum(parts.values())
    scale = min(1.0, variance / within) if within > 0.0 else 0.0
    shares = {source: scale * parts.get(source, 0.0) for source in _SOURCES if source in parts}
    return {**shares, "rivals": max(variance - scale * within, 0.0)}


def _of_answer(
    answer: Possible, campaign: Campaign, name: str
) -> tuple[float, NormalMixture, dict[str, float]] | None:
    """Probability, distribution and variances by source of a coefficient under one answer."""
    fit, value = answer.fit, _value(answer.fit, name)
    if value is None:
        return None
    small = alone(fit) if answer.small is None else answer.small
    place = coefficients_of(fit).index(name)
    misfit = float(small.scatter[place])
    if answer.small is not None:
        misfit = max(misfit, coefficient_move(replace(fit, residuals=small.residuals), name))
    rounding = unseen = 0.0
    if name.startswith("cn_"):
        rounding = density_rounding(campaign.runs)
        runs, which = wind_on_runs(fit), 0 if name == "cn_beta" else 1
        effects = fit.problem.effects_at(fit.point.common)
        unseen = math.hypot(*(effect.unseen_form(fit.value("cn_beta"), runs)[which] for effect in effects))
    form_std = fit.settings.answer.freed_form_std
    unfreed = None if answer.textbook is None else _value(answer.textbook, name)
    common = {
        "misfit": misfit**2,
        "air density": (value * rounding) ** 2,
        "unseen form": unseen**2,
        "freed form": 0.0 if unfreed is None else (form_std * (value - unfreed)) ** 2,
    }
    noise, forms = small.noise[:, place], small.forms[:, place]
    mixture = NormalMixture(
        small.weights, value + small.moves[:, place], noise + forms + sum(common.values())
    )
    formal = float(small.weights @ noise)
    by_scatter = _by_scatter(fit, place) * formal
    within = {
        "noise": formal - by_scatter,
        "scatter": by_scatter,
        "small causes": float(small.weights @ forms) + mixture.between,
    }
    return answer.probability, mixture, within | common


def _by_scatter(fit: Fit, place: int) -> float:
    """The share of a coefficient's formal variance that is due to chance differences between the runs.

    The rest follows from the noise, by the coefficient's derivatives with respect to the readings.
    """
    if not fit.problem.scatter:
        return 0.0
    gradient = coefficient_gradients(fit)[place]
    whole = float(gradient @ fit.stated_covariance @ gradient)
    both = float(gradient @ fit.covariance @ gradient)
    noise = sum(float(part[:, place] @ part[:, place]) for part in influences(fit))
    return max(both - noise, 0.0) / whole if whole > 0.0 else 0.0


def _estimate(fit: Fit, name: str, value: float, std: float, parts: Mapping[str, float]) -> Quantity:
    """A coefficient, marked where the fit ends at a bound or the runs do not determine it."""
    whole = sum(parts.values())
    shares = {source: part / whole for source, part in parts.items()} if whole > 0.0 else {}
    model = fit.problem.data.model
    limiting = model.bounded_by(fit.problem.names, name)
    bound = None if limiting is None else fit.bound(limiting)
    unit = model.coefficient_units[name]
    found = Quantity(value, None if bound else std, unit, bound=bound, shares=shares)
    return meant_coefficient(found, fit, name)


def _value(fit: Fit, name: str) -> float | None:
    return fit.problem.data.model.coefficient(fit.problem.names, fit.point.common, name)
