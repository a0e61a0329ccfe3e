"""Random moments: a layer of noise under every set of causes, and itself a cause.

A strong random motion misleads least squares: the residuals of the wind-on runs are far from white, so that
instants and weak effects are missed in them. Here sets are grown and fitted to rows in whose noise the rig's
response to the random moment is part. The random moment is estimated from what the best of them leaves, until both
agree.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.attribution.decide import form_floor
from diagnosis.attribution.grow import evidence_of, grow, least_share, sets_with_one_more
from diagnosis.attribution.hypothesis import Hypothesis, restricted
from diagnosis.attribution.innovation_tests import is_steady_noise
from diagnosis.attribution.process_noise import ProcessNoise, random_moments, with_response
from diagnosis.fitting.least_squares import Fit, FitError, fit, fit_at
from diagnosis.fitting.problem import Point, Problem
from diagnosis.fitting.run_data import Data
from diagnosis.fitting.starting_points import starting_points
from diagnosis.policy import NEEDLESS_CHI2, PAIR_SHARE
from tunnel_sim.effects import Effect

#: Drop of χ² that the evidence asks of a further effect where nothing else is left.
_LEAST_GAIN = NEEDLESS_CHI2 * (1.0 / PAIR_SHARE - 1.0)
_ROUNDS = 3  # of estimating the random moment from the residuals, and the effects beside it


@dataclass(frozen=True, eq=False)
class RandomAnswer:
    """A random moment, alone or beside other effects.

    Args:
        kind: of the random moment.
        process: its fit.
        beside: the fitted effects beside it with residuals in the sensor's noise alone, or None.
        share: of the gap left open, a fraction: the innovations' and the wind-off runs' excess over the nominal
            one's.
        rows: sets of effects, fitted to the runs with the response to the random moment as noise, best first; the
            nominal model is among them, as the set of none. Empty where that response cannot be made noise.
    """

    kind: type[Effect]
    process: ProcessNoise
    beside: Hypothesis | None
    share: float
    rows: tuple[Hypothesis, ...] = ()

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects, sorted."""
        return tuple(sorted((self.kind.name, *(() if self.beside is None else self.beside.effects))))


def weigh_random_moments(
    nominal: Fit,
    hypotheses: Sequence[Hypothesis],
    kinds: Sequence[type[Effect]],
) -> list[RandomAnswer]:
    """Try turbulence, and vortices with a wandering phase, under all sets of effects.

    Args:
        nominal: fitted with the sensor's noise alone.
        hypotheses: sets of effects fitted likewise.
        kinds: the vocabulary to answer in.

    Returns:
        The random moment with the best set of effects beside it. It must lower −2 ln L beside the same set by more
        than a needless effect may, and be steady noise, alike in all runs in the wind. Empty where none passes, or
        where no random moment in the wind could leave little enough of the gap.
    """
    allowed = {kind.random: kind for kind in kinds if kind.random}
    best = _best([Hypothesis((), nominal), *hypotheses], nominal)
    if not allowed or not _may_act(best, nominal, allowed):
        return []
    seen, rows = _settled(best, nominal, [kind for kind in kinds if kind.fitted], allowed)
    process = _likeliest([one for one in random_moments(seen.fit, allowed) if is_steady_noise(one)])
    if process is None:
        return []
    kind = allowed["narrow_band" if process.spectrum.strouhal_number > 0.0 else "broad_band"]
    share = (abs(process.excess) + max(wind_off_excess(seen.fit), 0.0)) / nominal.gap
    return [RandomAnswer(kind, process, seen if seen.effects else None, share, rows)]


def _may_act(best: Hypothesis, nominal: Fit, spectra: Collection[str]) -> bool:
    """Whether a random moment may be what the best set leaves.

    It would do as much as a further effect has to if it left nothing in the wind, or what is left is steady noise:
    a strong random motion misleads the fit of the wind-off runs too.
    """
    floor = form_floor(nominal.gap)
    left, still = (max(excess, 0.0) / nominal.gap for excess in (best.fit.excess, wind_off_excess(best.fit)))
    if floor >= PAIR_SHARE * (left + floor):
        return False
    if still + floor < PAIR_SHARE * (left + floor):
        return True
    process = _likeliest(random_moments(best.fit, spectra))
    return process is not None and is_steady_noise(process)


def wind_off_excess(fit: Fit) -> float:
    """Mean squared scaled residual minus one of the wind-off runs; 0 where there are none."""
    off = [
        float(np.mean(residual**2)) - 1.0
        for run, residual in zip(fit.problem.data.runs, fit.residuals, strict=True)
        if not run.wind_on
    ]
    return float(np.mean(off)) if off else 0.0


def _likeliest(tried: Sequence[ProcessNoise]) -> ProcessNoise | None:
    """The random moment that explains residuals best; None where white noise explains them as well."""
    acting = [one for one in tried if one.drop > NEEDLESS_CHI2]
    return min(acting, key=lambda p: p.cost + NEEDLESS_CHI2 * (p.spectrum.centre > 0.0), default=None)


def _best(sets: Sequence[Hypothesis], base: Fit) -> Hypothesis:
    """The set with the highest evidence."""
    least = least_share(sets, base)
    return max(sets, key=lambda h: evidence_of(h, base, least))


def _settled(
    best: Hypothesis, nominal: Fit, kinds: Sequence[type[Effect]], spectra: Collection[str]
) -> tuple[Hypothesis, tuple[Hypothesis, ...]]:
    """Sets of effects grown on rows in whose noise the response to a random moment is part.

    Args:
        best: the set from whose residuals the random moment is estimated first.
        kinds: effects to try.
        spectra: of random moments that may act.

    Returns:
        The best set with residuals in the sensor's noise alone, and all sets as `RandomAnswer` holds them; the set
        given and none where no random moment acts, or its filter does not settle. The random moment is estimated
        from what the best set leaves when it is fitted with the sensor's noise alone: the fit with the response as
        noise lets the motion wander as the response does, and its own residuals overstate it. The rounds end where
        the best set is the one that the random moment was estimated beside.
    """
    data, known = nominal.problem.data, best.fit
    rows: tuple[Hypothesis, ...] = ()
    with suppress(FitError, np.linalg.LinAlgError):
        for _ in range(_ROUNDS):
            process = _likeliest(random_moments(known, spectra))
            noisy = None if process is None else with_response(known, process.spectrum)
            if noisy is None:
                break
            base = fit(Problem(noisy), nominal.point)
            sets = [Hypothesis((), base), *grow(base, kinds)]
            found = list(_with_more_of_the_wind(_sought_again(_best(sets, base)), kinds))[::-1]
            settled = found[0].names == best.names
            best = _seen_in(found[0], data)
            rows = (*found, *(h for h in sets if h.names != found[-1].names))
            if settled:
                break
            known = fit(best.fit.problem, best.fit.point)
    return best, rows


def _with_more_of_the_wind(top: Hypothesis, kinds: Sequence[type[Effect]]) -> Iterator[Hypothesis]:
    """The set, and those with one, two, … more effects of the wind, as long as each is evident in the noise.

    A random moment leaves little of a gap in the wind for the shares of effects to be compared there.
    """
    windy = [kind for kind in kinds if kind.condition == "wind_on" and not kind.line]
    while True:
        yield top
        larger = sets_with_one_more([top], windy, None)
        best = min(larger, key=lambda h: h.fit.total, default=top)
        if top.fit.total - best.fit.total < _LEAST_GAIN:
            return
        top = best


def _sought_again(hypothesis: Hypothesis) -> Hypothesis:
    """The set with instants and phases sought once more; each run keeps those that leave less.

    They were found before the other effects were known.
    """
    known = hypothesis.fit
    for kind in known.problem.effects:
        if kind.skips or kind.line:
            known = _better_in_each_run(known, kind)
    return replace(hypothesis, fit=known)


def _better_in_each_run(known: Fit, kind: type[Effect]) -> Fit:
    """The fit with the instants or phases of one effect sought once more."""
    others = restricted(known, {other.name for other in known.problem.effects} - {kind.name})
    starts = starting_points(fit_at(others.problem, others.point), kind)
    if not starts:
        return known
    sought = fit(starts[0].problem, starts[0].point)
    width = known.point.release.shape[1]
    if sought.point.release.shape[1] != width:  # another number of instants
        return min(known, sought, key=lambda f: f.total)
    release = sought.point.release.copy()
    kept = known.chi2 < sought.chi2
    old, new = (f.problem.own_places(width)[kind.name] for f in (known, sought))
    release[kept, new] = known.point.release[kept, old]
    merged = fit(sought.problem, Point(sought.point.common, release))
    return min(known, sought, merged, key=lambda f: f.total)


def _seen_in(hypothesis: Hypothesis, data: Data) -> Hypothesis:
    """The hypothesis as it stands, with residuals in the noise of other data."""
    problem = replace(hypothesis.fit.problem, data=data)
    return replace(hypothesis, fit=fit_at(problem, hypothesis.fit.point), textbook=None)
