"""A rival: a cause from outside the vocabulary, weighed with the sets of effects. Your own rival is one file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from scipy.special import chdtri

from diagnosis.likelihood.least_squares import Fit
from diagnosis.model.fact import Fact
from diagnosis.model.similarity import Similarity
from diagnosis.search.hypothesis import Hypothesis

RIVAL_EXPLAINS: Final = 0.8
"""Minimum share of a gap that an explanation outside the vocabulary must explain to be mentioned.
Judgement."""

RIVAL_RATE: Final = 1e-3
"""Rate at which chance alone makes a rival explain more than every set of effects. Convention."""
RIVAL_NEAR: Final = 20.0
"""Maximum χ² of a rival above the best rival's, in the dispersion of the misfit, for it to be mentioned as well.
Judgement. Two parameters lower χ² by more than 20 by chance once in 22,000."""


def explains_more(fitted: Fit, least: float) -> bool:
    """Whether a fit lowers χ² below the least of all sets by more than chance, whatever both leave."""
    drop = (least - fitted.total) / (1.0 + max(fitted.excess, 0.0))
    return drop > float(chdtri(len(fitted.problem.names), RIVAL_RATE))


def explains_all(fitted: Fit) -> bool:
    """Whether a fit explains the readings so well that a rival would explain no more than chance."""
    return fitted.total - fitted.count < float(chdtri(len(fitted.problem.names), RIVAL_RATE))


class Rival:
    """A possible cause that is not an effect of the vocabulary: its probability is added to ``unknown``."""

    def hypotheses(
        self, likely: Sequence[Hypothesis], known: Sequence[Hypothesis], nominal: Fit
    ) -> list[Hypothesis]:
        """The fitted hypotheses that are weighed like sets of the vocabulary.

        Args:
            likely: the sets that may be the answer, the most probable first.
            known: all fitted sets, at which fits may start.
            nominal: the nominal model, fitted to the same runs.

        Returns:
            Each with names that no set of the vocabulary has; empty where the rival does not apply.
        """
        raise NotImplementedError

    def fact(self, best: Hypothesis, similarity: Similarity) -> Fact | None:
        """The fact to state if the rival would explain a gap of unknown cause; None: nothing.

        Return your own sentence by `diagnosis.model.fact.as_stated`.

        Args:
            best: the most likely of the rival's hypotheses.
            similarity: the conversion from the measured campaign.
        """
        del best, similarity
        return None


@dataclass(frozen=True, eq=False)
class FoundRival:
    """A rival with its fits.

    Args:
        rival: the rival.
        hypotheses: its fitted hypotheses, one or more.
    """

    rival: Rival
    hypotheses: tuple[Hypothesis, ...]

    @property
    def best(self) -> Hypothesis:
        """Its hypothesis of least χ²."""
        return min(self.hypotheses, key=lambda one: one.fit.total)


def explaining(found: Sequence[FoundRival], nominal: Fit) -> list[FoundRival]:
    """The rivals that explain most of the gap, and nearly as much as the best of them."""
    best = min((one.best.fit for one in found), key=lambda fit: fit.total, default=nominal)
    return [
        one
        for one in found
        if one.best.fit.excess <= (1.0 - RIVAL_EXPLAINS) * nominal.excess
        and one.best.fit.total - best.total <= RIVAL_NEAR * (1.0 + max(best.excess, 0.0))
    ]


def rival_facts(found: Sequence[FoundRival], nominal: Fit, similarity: Similarity) -> list[Fact]:
    """The facts of the rivals that explain the gap."""
    facts = (one.rival.fact(one.best, similarity) for one in explaining(found, nominal))
    return [fact for fact in facts if fact is not None]
