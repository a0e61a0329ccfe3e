"""Sets of effects beside turbulence, fitted with the rig's response to it as part of the noise.

A strong random motion misleads least squares: the residuals of the wind-on runs are far from white, so that
instants and weak effects are missed in them. Here they are weighted by the spectrum that turbulence gives them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from diagnosis.attribution.grow import evidence_of, grow, prune
from diagnosis.attribution.hypothesis import Hypothesis, restricted
from diagnosis.attribution.process_noise import fit_turbulence, with_response
from diagnosis.fitting.least_squares import Fit, FitError, fit, fit_at
from diagnosis.fitting.problem import Point, Problem
from diagnosis.fitting.run_data import Data
from diagnosis.fitting.starting_points import starting_points
from diagnosis.policy import BESIDE_EVIDENCE
from tunnel_sim.effects import Effect

_ROUNDS = 3  # of estimating the turbulence from the residuals, and the effects beside it


def beside_turbulence(best: Hypothesis, data: Data) -> list[Hypothesis]:
    """Fit a set of effects again, and the smaller sets it holds, with turbulence as noise.

    Args:
        best: fitted with the sensor's noise alone.
        data: the runs with the sensor's noise alone.

    Returns:
        The sets, largest first; none where no run is in the wind or a fit fails. Their residuals hold the response
        to the turbulence.
    """
    with suppress(FitError, np.linalg.LinAlgError):
        for _ in range(_ROUNDS):
            process = fit_turbulence(best.fit)
            noisy = None if process is None else with_response(best.fit, process.spectrum)
            if noisy is None:
                return []
            fitted = replace(best, fit=_again(best.fit, noisy), textbook=None)
            best = _seen_in(fitted, data)
        return [_seen_in(one, data) for one in _smaller(fitted)]
    return []


def grown_beside_turbulence(
    nominal: Fit, kinds: Sequence[type[Effect]]
) -> Iterator[tuple[Hypothesis, Hypothesis]]:
    """Grow sets of effects from the nominal model on, with turbulence as noise.

    Args:
        nominal: fitted with the sensor's noise alone.
        kinds: effects to try.

    Yields:
        Round by round the best set, with residuals that hold the response to the turbulence: as it was fitted, and
        fitted again with the sensor's noise alone. The latter's residuals give the turbulence of the next round.
        In the first round the nominal model's do: they overstate it so much that the runs in the wind hardly count.
        The rounds end where no effect is found, or a fit fails.
    """
    best, data = Hypothesis((), nominal), nominal.problem.data
    with suppress(FitError, np.linalg.LinAlgError):
        for _ in range(_ROUNDS):
            process = fit_turbulence(best.fit)
            noisy = None if process is None else with_response(best.fit, process.spectrum)
            if noisy is None:
                return
            base = fit(Problem(noisy), nominal.point)
            grown = max([Hypothesis((), base), *grow(base, kinds)], key=lambda h: evidence_of(h, base))
            if not grown.effects:
                return
            seen = _seen_in(grown, data)
            best = replace(seen, fit=fit(seen.fit.problem, seen.fit.point), textbook=None)
            yield seen, best


def _again(known: Fit, data: Data) -> Fit:
    """The same effects fitted to the runs with other noise; numbers of their own are sought once more."""
    found = fit(replace(known.problem, data=data), known.point)
    for kind in known.problem.effects:
        if kind.skips or kind.line:
            found = _sought_again(found, kind)
    return found


def _sought_again(known: Fit, kind: type[Effect]) -> Fit:
    """The fit with an effect's own numbers sought again; each run keeps those that leave less."""
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


def _smaller(whole: Hypothesis) -> list[Hypothesis]:
    """The set, and the sets that are left as the effect that matters least is taken out of each."""
    found = [whole]
    while len(found[-1].effects) > 1 and (smaller := prune(found[-1], ())):
        found.append(min(smaller, key=lambda h: h.fit.total))
        if found[-1].fit.total > found[-2].fit.total + BESIDE_EVIDENCE:
            break
    return found


def _seen_in(hypothesis: Hypothesis, data: Data) -> Hypothesis:
    """The hypothesis as it stands, with residuals in the noise of other data."""
    problem = replace(hypothesis.fit.problem, data=data)
    return replace(hypothesis, fit=fit_at(problem, hypothesis.fit.point), textbook=None)
