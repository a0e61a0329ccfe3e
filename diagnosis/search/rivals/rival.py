"""A rival: a cause from outside the vocabulary that is weighed beside its sets. One of one's own is one file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from diagnosis.facts.found import Fact
from diagnosis.likelihood.least_squares import Fit
from diagnosis.model.similarity import Similarity
from diagnosis.search.hypothesis import Hypothesis


class Rival:
    """What would explain a gap and is no effect of the vocabulary: its probability is that of ``unknown``."""

    def hypotheses(
        self, likely: Sequence[Hypothesis], known: Sequence[Hypothesis], nominal: Fit
    ) -> list[Hypothesis]:
        """The fitted hypotheses that are weighed like sets of the vocabulary.

        Args:
            likely: the sets that may be the answer, the most probable first.
            known: all fitted sets, at which fits may start.
            nominal: the nominal model, fitted to the same runs.

        Returns:
            Each with names of its own, which no set of the vocabulary has; none where the rival does not apply.
        """
        raise NotImplementedError

    def fact(self, best: Hypothesis, similarity: Similarity) -> Fact | None:
        """What is said where it would explain a gap whose cause is not known; None: nothing.

        A sentence of its own is `diagnosis.facts.found.as_stated` of it.

        Args:
            best: the likeliest of its hypotheses.
            similarity: how the campaign was made similar.
        """
        del best, similarity
        return None


@dataclass(frozen=True, eq=False)
class FoundRival:
    """A rival with what was fitted of it.

    Args:
        rival: the rival.
        hypotheses: its fitted hypotheses, one or more.
    """

    rival: Rival
    hypotheses: tuple[Hypothesis, ...]

    def fact(self, nominal: Fit, similarity: Similarity) -> Fact | None:
        """What is said of it; None where its likeliest hypothesis does not close most of the gap."""
        best = min(self.hypotheses, key=lambda one: one.fit.total)
        least = nominal.settings.words.rival_explains
        return None if best.fit.excess > (1.0 - least) * nominal.excess else self.rival.fact(best, similarity)
