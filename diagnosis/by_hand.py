"""Causes chosen by hand: the share of the gap that they close, and the run that distinguishes two sets of them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.answer.held_out import both_ends, excess_base, one_more, share_closed
from diagnosis.diagnosable import comparable_runs, diagnosable
from diagnosis.findings.candidates import candidates
from diagnosis.findings.next_run import NextRun
from diagnosis.likelihood.least_squares import Fit, FitError, fit
from diagnosis.likelihood.part_of_fit import restricted
from diagnosis.search.answer import Answer
from diagnosis.search.hypothesis import Hypothesis, polish
from diagnosis.search.investigate import nominal_study
from diagnosis.settings import Settings
from identification.show.numbers import plain
from identification.show.quantity import Quantity
from tunnel_sim.effects import effect_class, known_effects
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError

_ITERATIONS = 6  # of a fit that starts from one with more effects


@dataclass(frozen=True)
class Closure:
    """The gap with causes chosen by hand.

    Args:
        before: excess of the nominal model on held-out readings, in noise variances of a sample.
        after: excess with the effects on the same readings, in noise variances of a sample.
        parameters: of the effects, by name; ``effect.parameter`` for several effects.
    """

    effects: tuple[str, ...]
    before: float
    after: float
    held_out: str
    parameters: Mapping[str, Quantity]

    @property
    def closed(self) -> float:
        """Explained share of the gap, 0 to 1."""
        return share_closed(self.before, self.after)


class ByHand:
    """A campaign with its nominal model fitted, to which effects are added by hand.

    Raises:
        TunnelError: when the examination refuses the records, or the nominal model cannot be fitted.
    """

    def __init__(self, campaign: Campaign, settings: Settings = Settings()) -> None:
        comparable, _ = comparable_runs(diagnosable(campaign).campaign)
        self._study = nominal_study(comparable, known_effects(), settings)
        self._base = excess_base(self._study)
        self._fits: dict[frozenset[str], Fit] = {frozenset(): self._study.nominal}
        self._whole = {frozenset[str](): self._study.nominal}

    def closure(self, effects: Collection[str], *, converged: bool = False) -> Closure:
        """Fit effects to the runs, and predict the runs held out of that fit.

        Args:
            effects: names of effects that a fit can find; none: the nominal model.
            converged: whether the forms of the effects are freed and the fit continues to convergence, as for the
                answer of a diagnosis; that takes ten times as long.

        Returns:
            The excess before and after, and the parameters. Every set is fitted once; a set close to an earlier
            one starts from it.

        Raises:
            TunnelError: when an effect cannot be fitted to these runs.
        """
        names = frozenset(effects)
        fitted = self._fit(names)
        if converged:
            if names not in self._whole:
                self._whole[names] = polish(Hypothesis(tuple(sorted(names)), fitted)).fit
            fitted = self._whole[names]
        known = Hypothesis(tuple(sorted(names)), fitted)
        # Only the parameters of the one candidate are used: its share and its probability do not matter.
        study = replace(self._study, answers=(Answer(known.names, 0.0, 1.0, known, known),) if names else ())
        ends = both_ends(study, self._base)
        parameters = candidates(study, self._base)[0].parameters if names else {}
        before, after = (step.excess for step in ends.steps)
        return Closure(tuple(sorted(names)), before, after, ends.held_out, parameters)

    def next_run(self, first: Collection[str], second: Collection[str]) -> NextRun | None:
        """The run that would distinguish two sets of effects.

        Args:
            first: names of effects.
            second: names of its rivals.

        Returns:
            None in normalised form.

        Raises:
            TunnelError: when an effect cannot be fitted to these runs.
        """
        found = NextRun.between(self._fit(frozenset(first)), self._fit(frozenset(second)))
        return None if found is None else found.own(self._study.similarity)

    def _fit(self, names: frozenset[str]) -> Fit:
        """Started from the smallest fitted set with more effects, or from the largest with fewer."""
        larger = [known for known in self._fits if known > names]
        if names not in self._fits and larger:
            start = restricted(self._fits[min(larger, key=len)], names)
            with suppress(FitError, np.linalg.LinAlgError):
                self._fits[names] = fit(
                    start.problem, start.point, base=start, tolerance=1e-3, max_iterations=_ITERATIONS
                )
        if names not in self._fits:
            known = max((known for known in self._fits if known < names), key=len)
            for name in sorted(names - known):
                found = one_more(self._fits[known], effect_class(name))
                if found is None:
                    raise TunnelError(
                        f"{plain(name)} cannot be fitted to these runs", remedy="choose another effect"
                    )
                known |= {name}
                self._fits[known] = found
        return self._fits[names]
