"""Sets of effects beside a random moment, grown with the rig's response to it as part of the noise.

A strong random motion misleads least squares: the residuals of the wind-on runs are far from white, so that
instants and weak effects are missed in them. Here they are weighted by the spectrum that the random moment gives
them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from diagnosis.attribution.grow import Scale, grow, sets_with_one_more
from diagnosis.attribution.hypothesis import Hypothesis, restricted
from diagnosis.attribution.process_noise import (
    ProcessNoise,
    fit_turbulence,
    fit_wandering_shedding,
    with_response,
)
from diagnosis.fitting.channels import misfit
from diagnosis.fitting.least_squares import Fit, FitError, fit, fit_at
from diagnosis.fitting.problem import Point, Problem
from diagnosis.fitting.run_data import Data
from diagnosis.fitting.starting_points import starting_points
from diagnosis.policy import BESIDE_EVIDENCE
from tunnel_sim.effects import Effect

_ROUNDS = 2  # of estimating the random moment from the residuals, and the effects beside it


def grow_beside_random(nominal: Fit, kinds: Sequence[type[Effect]]) -> list[Hypothesis]:
    """Grow sets of effects from the nominal model on, with the response to a random moment as noise.

    Args:
        nominal: fitted with the sensor's noise alone.
        kinds: effects to try.

    Returns:
        The sets, best first, as they were fitted, with residuals in the sensor's noise alone. They are grown in up
        to two rounds. The random moment of the first is what the nominal model leaves, which overstates it so much
        that the runs in the wind hardly count. That of the second is what the best set of the first leaves when it
        is fitted with the sensor's noise alone. There is no second round where that set is empty, and the first
        counts where a fit of the second fails.
    """
    best, data = Hypothesis((), nominal), nominal.problem.data
    found: list[Hypothesis] = []
    with suppress(FitError, np.linalg.LinAlgError):
        for _ in range(_ROUNDS):
            known = fit(best.fit.problem, best.fit.point) if best.effects else nominal
            random = _random_moment(known)
            noisy = None if random is None else with_response(known, random.spectrum)
            if noisy is None:
                break
            base = fit(Problem(noisy), nominal.point)
            grown = grow(base, kinds)
            every = [Hypothesis((), base), *grown]
            top = _sought_again(max(every, key=Scale.of(every, misfit(base)).weight))
            sets = [*grown, *_with_more_of_the_wind(top, kinds)]
            found = [_seen_in(h, data) for h in sorted(sets, key=lambda h: h.fit.total) if h.effects]
            best = _seen_in(sets[-1], data)
            if not best.effects:
                break
    return found


def _with_more_of_the_wind(top: Hypothesis, kinds: Sequence[type[Effect]]) -> Iterator[Hypothesis]:
    """The set, and those with one, two, … more effects of the wind, as long as each is evident in the noise.

    A random moment leaves little of a gap in the wind for the shares of effects to be compared there.
    """
    windy = [kind for kind in kinds if kind.condition == "wind_on" and not kind.line]
    while True:
        yield top
        larger = sets_with_one_more([top], windy, None)
        best = min(larger, key=lambda h: h.fit.total, default=top)
        if top.fit.total - best.fit.total < BESIDE_EVIDENCE:
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


def _random_moment(known: Fit) -> ProcessNoise | None:
    """The random moment that explains the residuals of a fit best."""
    tried = (fit_turbulence(known), fit_turbulence(known, centred=True), fit_wandering_shedding(known))
    return min((one for one in tried if one is not None), key=lambda one: one.cost, default=None)


def _seen_in(hypothesis: Hypothesis, data: Data) -> Hypothesis:
    """The hypothesis as it stands, with residuals in the noise of other data."""
    problem = replace(hypothesis.fit.problem, data=data)
    return replace(hypothesis, fit=fit_at(problem, hypothesis.fit.point), textbook=None)
