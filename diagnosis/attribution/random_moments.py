"""Random moments, weighed last: they absorb almost any gap, so they must pass tests of their own."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from diagnosis.attribution.decide import form_floor
from diagnosis.attribution.grow_beside_random import grow_beside_random
from diagnosis.attribution.hypothesis import Hypothesis, own_gain
from diagnosis.attribution.innovation_tests import is_steady_noise
from diagnosis.attribution.process_noise import (
    ProcessNoise,
    Spectrum,
    fit_turbulence,
    fit_wandering_shedding,
    with_response,
)
from diagnosis.fitting.least_squares import Fit, FitError, fit
from diagnosis.policy import (
    BESIDE_EVIDENCE,
    LEFT_IN_THE_WIND,
    RANDOM_PARTNERS,
    RIVAL_EVIDENCE,
    WIND_OFF_LEAST,
    WIND_OFF_SHARE,
)
from tunnel_sim.effects import Effect, the_effect


@dataclass(frozen=True, eq=False)
class RandomAnswer:
    """A random moment, alone or beside other effects.

    Args:
        kind: of the random moment.
        process: its fit.
        beside: the fitted effects beside it, or None.
        share: of the gap left open, a fraction: the innovations' and the wind-off runs' excess over the nominal
            one's.
    """

    kind: type[Effect]
    process: ProcessNoise
    beside: Hypothesis | None
    share: float

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects, sorted."""
        return tuple(sorted((self.kind.name, *(() if self.beside is None else self.beside.effects))))


def weigh_random_moments(
    nominal: Fit,
    hypotheses: Sequence[Hypothesis],
    kinds: Sequence[type[Effect]],
) -> list[RandomAnswer]:
    """Try turbulence, and vortices with a wandering phase, alone and beside effects.

    Args:
        hypotheses: fitted sets of effects, best first.
        kinds: the vocabulary to answer in.

    Returns:
        The most likely answer of each kind that passes, with as few effects beside it as the evidence asks for.
        To pass, the random moment must be steady noise, alike in all runs in the wind, and the wind-off runs must
        be free of a gap once the response is part of the noise. Empty where none passes, or where deterministic
        effects close the gap.

        A strong random motion misleads the fit of the effects beside it. Where most of what is left is in the wind,
        sets are therefore grown once more, with the response to the random moment as noise, and only these count.
    """
    allowed = {kind.name for kind in kinds}
    if any(
        max(hypothesis.fit.excess, 0.0) < form_floor(nominal.gap) * nominal.gap for hypothesis in hypotheses
    ):
        return []
    fitted = [kind for kind in kinds if kind.fitted]
    grown: list[Hypothesis] = []
    if fitted and _left_in_the_wind([nominal, *(hypothesis.fit for hypothesis in hypotheses)]):
        grown = grow_beside_random(nominal, fitted)
    answers = _passing(nominal, grown or hypotheses, allowed)
    least = min((answer.process.cost for answer in answers), default=0.0)
    return [answer for answer in answers if answer.process.cost < least + RIVAL_EVIDENCE]


def _in_its_noise(known: Fit, spectrum: Spectrum) -> Fit:
    """A fit made again with the response to a random moment as noise.

    Where the filter forgets too slowly or the fit fails, the fit is the one given: the limit is then hard on it.
    """
    with suppress(FitError, np.linalg.LinAlgError):
        noisy = with_response(known, spectrum)
        return known if noisy is None else fit(replace(known.problem, data=noisy), known.point)
    return known


def _left_in_the_wind(fits: Sequence[Fit]) -> bool:
    """Whether most of what the best fit leaves is in the runs in the wind."""
    best = min(fits, key=lambda one: one.total)
    return wind_off_excess(best) < LEFT_IN_THE_WIND * best.excess


def _cost(answer: RandomAnswer) -> float:
    """−2 ln L, with what further freedom gains by chance."""
    found = answer.process.cost + BESIDE_EVIDENCE * len(answer.effects)
    if answer.process.spectrum.centre > 0.0:
        found += RIVAL_EVIDENCE
    if answer.beside is not None:
        found += own_gain(answer.beside.fit.problem, answer.beside.fit.point)
    return found


def _passing(nominal: Fit, hypotheses: Sequence[Hypothesis], allowed: Collection[str]) -> list[RandomAnswer]:
    """The most likely answer of each kind that passes."""
    kinds: tuple[tuple[str, tuple[_Kind, ...]], ...] = (
        ("broad_band", (fit_turbulence, partial(fit_turbulence, centred=True))),
        ("narrow_band", (fit_wandering_shedding,)),
    )
    known = [(the_effect(random=random), fits) for random, fits in kinds]
    tried = [_likeliest(kind, fits, nominal, hypotheses) for kind, fits in known if kind.name in allowed]
    return [answer for answer in tried if answer is not None]


_Kind = Callable[[Fit], ProcessNoise | None]


def _likeliest(
    kind: type[Effect], fits: Sequence[_Kind], nominal: Fit, hypotheses: Sequence[Hypothesis]
) -> RandomAnswer | None:
    sets = [(nominal, None), *((h.fit, h) for h in _partners(kind, hypotheses))]
    tried = [_try(kind, explain, one, beside, nominal) for one, beside in sets for explain in fits]
    return min((answer for answer in tried if answer is not None), key=_cost, default=None)


def _partners(kind: type[Effect], hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The best single effects, and the best set of every larger size."""
    able = [h for h in hypotheses if kind.name not in h.effects]
    sizes = sorted({len(h.effects) for h in able} - {1})
    larger = [next(h for h in able if len(h.effects) == size) for size in sizes]
    return [*[h for h in able if len(h.effects) == 1][:RANDOM_PARTNERS], *larger]


def _try(
    kind: type[Effect], explain: _Kind, fit: Fit, beside: Hypothesis | None, nominal: Fit
) -> RandomAnswer | None:
    if _still_open(fit, nominal):
        return None
    process = explain(fit)
    if process is None or process.drop <= 0.0 or not is_steady_noise(process):
        return None
    if wind_off_excess(_in_its_noise(fit, process.spectrum)) > _no_gap(nominal):
        return None
    share = (abs(process.excess) + max(wind_off_excess(fit), 0.0)) / nominal.gap
    return RandomAnswer(kind, process, beside, share)


def _still_open(fit: Fit, nominal: Fit) -> bool:
    """Whether the wind-off runs show a gap, which no random moment of the wind explains."""
    return wind_off_excess(fit) > max(WIND_OFF_SHARE * fit.excess, _no_gap(nominal))


def _no_gap(nominal: Fit) -> float:
    """Excess of the wind-off runs that is no gap."""
    still = max(wind_off_excess(nominal), 0.0)
    return max(form_floor(nominal.gap) * still, WIND_OFF_LEAST)


def wind_off_excess(fit: Fit) -> float:
    """Mean squared scaled residual minus one of the wind-off runs; 0 where there are none."""
    off = [
        float(np.mean(residual**2)) - 1.0
        for run, residual in zip(fit.problem.data.runs, fit.residuals, strict=True)
        if not run.wind_on
    ]
    return float(np.mean(off)) if off else 0.0
