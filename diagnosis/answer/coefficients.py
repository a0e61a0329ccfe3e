"""Coefficients before and after the causes are added: averages over the answers, with intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri

from diagnosis.answer.candidates import meant_coefficient
from diagnosis.answer.hidden import hidden_effects
from diagnosis.answer.linear_theory import (
    Beside,
    alone,
    beside,
    coefficient_gradients,
    coefficient_move,
    coefficients_of,
    starts_beside,
    wind_on_runs,
)
from diagnosis.likelihood.least_squares import Fit
from diagnosis.result import Hidden, ParameterEstimate
from diagnosis.search.study import Answer, Study
from diagnosis.search.weigh import UNKNOWN
from diagnosis.settings import AnswerSettings
from tunnel_sim.effects import Effect
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array

_REACH = 8.5  # standard deviations beyond which a normal distribution has no probability in 64 bits
_MOST_STEPS = 500


@dataclass(frozen=True, eq=False)
class Mixture:
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

    def quantile(self, share: float) -> float:
        """The value below which the mixture has a given probability.

        Args:
            share: the probability, above 0 and below 1.
        """
        stds = np.sqrt(self.variances)
        low, high = float(np.min(self.means - _REACH * stds)), float(np.max(self.means + _REACH * stds))
        low, high = np.nextafter(low, -np.inf), np.nextafter(high, np.inf)  # a value may be certain
        widths = np.maximum(stds, 1e-300)
        precision = max(1e-16 * (high - low), 1e-300)

        def excess(value: float) -> float:
            return float(self.weights @ ndtr((value - self.means) / widths)) - share

        return float(brentq(excess, low, high, xtol=precision, maxiter=_MOST_STEPS))


_SOURCES = (
    "noise", "misfit", "small causes", "hidden effects", "air density", "unseen form", "freed form", "rivals",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Possible:
    """An answer with its fit.

    Args:
        probability: of the answer, a fraction; those of all answers need not sum to 1.
        textbook: the same effects in textbook form, where the fit freed their forms.
        small: the small causes that may act beside them; None: neither these nor a misfit are considered.
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
        hidden: the effects that could hide beside the chosen answer.
    """

    possible: tuple[Possible, ...]
    unknown: float
    nominal: Fit
    hidden: tuple[Hidden, ...] = ()


def possible_answers(study: Study, kinds: Sequence[type[Effect]]) -> Answers:
    """The answers of a study, without the evenly spread part of their probabilities.

    That part represents causes not considered, not an answer that the runs refute.

    Args:
        kinds: the effects that may act unnamed. They are considered beside the chosen answer and every probable
            answer, if there is a gap.
    """
    chosen = study.stated
    even = study.settings.weighing.even_share / max(len(study.answers), 1)
    least = study.settings.answer.small_causes_from
    others, probability_of_answer, unknown = [], 1.0, 0.0
    for place, answer in enumerate(study.answers):
        probability, fit = max(answer.probability - even, 0.0), answer.fit(study.nominal)
        if place == 0:
            probability_of_answer = probability
        elif answer.effects == UNKNOWN:
            unknown = probability
        elif fit is not None and probability > 0.0:
            small = beside(fit, starts_beside(fit, kinds)) if probability >= least else None
            share, alternatives = _by_choice(answer, fit, probability, kinds)
            others += [Possible(probability * share, fit, answer.textbook_of(fit), small), *alternatives]
    answer = study.answer or Answer((), 1.0, 1.0)
    share, alternatives = _by_choice(answer, chosen, probability_of_answer, kinds)
    starts = starts_beside(chosen, kinds)
    small = beside(chosen, starts) if study.causes else None
    hidden = hidden_effects(chosen, starts, None if small is None else small.left)
    first = Possible(probability_of_answer * share, chosen, answer.textbook_of(chosen), small)
    return Answers((first, *alternatives, *others), unknown, study.nominal, hidden)


def _by_choice(
    answer: Answer, fit: Fit, probability: float, kinds: Sequence[type[Effect]]
) -> tuple[float, list[Possible]]:
    """The fit's share among the choices of an answer that the runs cannot exclude, and the other choices."""
    share, others = 1.0, []
    for choice in answer.choices:
        if choice.hypothesis.fit is fit:
            share = choice.probability
        else:
            small = beside(choice.hypothesis.fit, starts_beside(choice.hypothesis.fit, kinds))
            others.append(Possible(probability * choice.probability, choice.hypothesis.fit, None, small))
    return share, others


def coefficients(answers: Answers, campaign: Campaign) -> dict[str, ParameterEstimate]:
    """The coefficients averaged over the answers.

    Args:
        campaign: gives the digits to which the air density is stated.

    Returns:
        By the names of the nominal model's coefficients; ``omega_n`` and ``zeta`` are those of small swings. The
        value is the mean over the answers and over the sets of small causes beside them
        (`diagnosis.answer.linear_theory`), with their probabilities. The variance is the sum of those within and
        between them (the law of total variance).

        The variance within is the sum of

        - the fit's own;
        - the scatter of the runs where it exceeds chance, or half the difference between two halves of the data
          (`coefficient_move`) if that is greater;
        - the rounding of the air density;
        - the part of the causes' forms that no free decay shows;
        - half the change by freeing the forms, since another family of forms may change as much.

        ``unknown`` also adds half the change from the nominal model. The effect that could hide and would move
        the coefficient most (`diagnosis.answer.hidden`) adds the square of half that move, since its largest size
        is two standard deviations. The central interval is given where it is not that of a normal distribution
        (`interval_beside`). No standard deviation is given at a bound, or where the runs do not determine the
        coefficient.
    """
    fit, estimates, chosen = answers.possible[0].fit, {}, answers.nominal.settings.answer
    for name in coefficients_of(fit):
        if _value(fit, name) is None:
            continue  # fixed
        move = max((hidden.moves[name].value for hidden in answers.hidden), default=0.0)
        each = [
            of
            for one in answers.possible
            if (of := _of_answer(one, campaign, name, move / chosen.hidden_stds)) is not None
        ]
        _, first, parts = each[0]
        change = chosen.unknown_std * (first.mean - (_value(answers.nominal, name) or first.mean))
        if answers.unknown > 0.0:
            doubted = Mixture(first.weights, first.means, first.variances + change**2)
            each.append((answers.unknown, doubted, {**parts, "rivals": change**2}))
        probability = np.array([p for p, _, _ in each])
        probability /= probability.sum()
        whole = Mixture(
            np.concatenate([p * m.weights for p, (_, m, _) in zip(probability, each, strict=True)]),
            np.concatenate([m.means for _, m, _ in each]),
            np.concatenate([m.variances for _, m, _ in each]),
        )
        shares = {
            source: float(probability @ [given.get(source, 0.0) for _, _, given in each])
            for source in _SOURCES
            if any(source in given for _, _, given in each)
        }
        between = float(probability @ [(m.mean - whole.mean) ** 2 for _, m, _ in each])
        shares["rivals"] = shares.get("rivals", 0.0) + between
        estimates[name] = _estimate(fit, name, whole.mean, whole.std, shares)
        if estimates[name].std is not None:
            estimates[name] = replace(estimates[name], interval=interval_beside(whole, chosen))
    return estimates


def correlation(answers: Answers, found: Mapping[str, ParameterEstimate]) -> tuple[tuple[float, ...], ...]:
    """The correlation of the coefficients by noise, small causes and rivals; see `Coefficients`.

    Args:
        found: the coefficients averaged over the answers.

    Returns:
        In the order of the coefficients, shape (n, n).
    """
    weights, means, noise = [], [], np.zeros((len(found), len(found)))
    for one in answers.possible:
        values, known = [_value(one.fit, name) for name in found], coefficients_of(one.fit)
        if one.probability <= 0.0 or None in values:
            continue
        small, places = one.small or alone(one.fit), [known.index(name) for name in found]
        gradients = coefficient_gradients(one.fit)[places]
        noise += one.probability * gradients @ one.fit.stated_covariance @ gradients.T
        weights.append(one.probability * small.weights)
        means.append(np.array(values) + small.moves[:, places])
    if not means:
        return ()
    weight, mean = np.concatenate(weights), np.concatenate(means)
    away = mean - weight @ mean / weight.sum()
    shared = (noise + (away.T * weight) @ away) / weight.sum()
    whole = np.maximum([(one.std or 0.0) ** 2 for one in found.values()], np.diag(shared))
    scale = np.sqrt(np.maximum(whole, 1e-300))
    shared = shared / np.outer(scale, scale)
    np.fill_diagonal(shared, 1.0)
    return tuple(tuple(row) for row in shared.tolist())


def interval_beside(whole: Mixture, chosen: AnswerSettings) -> tuple[float, float] | None:
    """The central interval of a mixture to be stated beside its mean and standard deviation.

    Rivals too improbable to reach the interval may still contribute most of the variance, where their means are
    distant. The interval is then shorter than value ± one standard deviation, and depends on whether each rival
    has more or less than half the probability outside it, which is not known that precisely.

    Returns:
        Its ends; None where value and standard deviation give the interval, as for a normal distribution.
    """
    tail = 0.5 * (1.0 - chosen.coefficient_interval)
    low, high = whole.quantile(tail), whole.quantile(1.0 - tail)
    reach = float(ndtri(1.0 - tail)) * whole.std
    skew = max(abs(low - whole.mean + reach), abs(high - whole.mean - reach))
    if skew <= chosen.skewed_from * whole.std or high - low < chosen.interval_from * whole.std:
        return None
    return low, high


def before_the_causes(nominal: Fit, after: Mapping[str, ParameterEstimate]) -> dict[str, ParameterEstimate]:
    """The coefficients of the nominal model.

    Args:
        after: the averages over the answers; their squared difference from the nominal ones is added to the
            variance.
    """
    found = {}
    for place, name in enumerate(coefficients_of(nominal)):
        value, given = _value(nominal, name), after.get(name)
        if value is None or given is None:
            continue
        parts = {"causes": (value - given.value) ** 2} if given.value != value else {}
        if given.std is None:
            parts["noise"] = float(alone(nominal).noise[0, place])
        else:
            parts |= {source: share * given.std**2 for source, share in given.shares.items()}
        found[name] = _estimate(nominal, name, value, math.sqrt(sum(parts.values())), parts)
    return found


def _of_answer(
    answer: Possible, campaign: Campaign, name: str, hidden: float
) -> tuple[float, Mixture, dict[str, float]] | None:
    """Probability, distribution and variances by source of a coefficient under one answer.

    ``hidden`` is its standard deviation due to effects that could hide.
    """
    fit, value = answer.fit, _value(answer.fit, name)
    if value is None:
        return None
    small = alone(fit) if answer.small is None else answer.small
    place = coefficients_of(fit).index(name)
    misfit = float(small.scatter[place])
    if answer.small is not None:
        misfit = max(misfit, coefficient_move(replace(fit, residuals=small.left), name))
    rounding = unseen = 0.0
    if name.startswith("cn_"):
        for run in campaign.runs:
            if run.wind_on and run.air_density:
                exponent = Decimal(repr(float(run.air_density))).as_tuple().exponent
                digits = -exponent if isinstance(exponent, int) else 4
                own = 0.5 * 10.0 ** -min(digits, 8) / math.sqrt(3.0) / run.air_density
                rounding = max(rounding, own)
        runs, which = wind_on_runs(fit), 0 if name == "cn_beta" else 1
        effects = fit.problem.effects_at(fit.point.common)
        unseen = math.hypot(*(effect.unseen_form(fit.value("cn_beta"), runs)[which] for effect in effects))
    form_std = fit.settings.answer.freed_form_std
    unfreed = None if answer.textbook is None else _value(answer.textbook, name)
    common = {
        "misfit": misfit**2,
        "hidden effects": hidden**2,
        "air density": (value * rounding) ** 2,
        "unseen form": unseen**2,
        "freed form": 0.0 if unfreed is None else (form_std * (value - unfreed)) ** 2,
    }
    noise, forms = small.noise[:, place], small.forms[:, place]
    found = Mixture(small.weights, value + small.moves[:, place], noise + forms + sum(common.values()))
    within = {
        "noise": float(small.weights @ noise),
        "small causes": float(small.weights @ forms) + found.between,
    }
    return answer.probability, found, within | common


def _estimate(fit: Fit, name: str, value: float, std: float, parts: Mapping[str, float]) -> ParameterEstimate:
    """A coefficient, marked where the fit ends at a bound or the runs do not determine it."""
    whole = sum(parts.values())
    shares = {source: part / whole for source, part in parts.items()} if whole > 0.0 else {}
    model = fit.problem.data.model
    limiting = model.bounded_by(fit.problem.names, name)
    bound = None if limiting is None else fit.bound(limiting)
    unit = model.coefficient_units[name]
    found = ParameterEstimate(value, None if bound else std, unit, bound, shares=shares)
    return meant_coefficient(found, fit, name)


def _value(fit: Fit, name: str) -> float | None:
    return fit.problem.data.model.coefficient(fit.problem.names, fit.point.common, name)
