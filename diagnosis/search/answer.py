"""Answers: sets of causes with their probabilities and fits."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.likelihood.least_squares import Fit
from diagnosis.search.choices import Choice
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.process_noise import MomentLayer

UNKNOWN = ("unknown",)


@dataclass(frozen=True, eq=False)
class Answer:
    """An answer, its probability and its fits.

    Args:
        effects: names, sorted; ``("unknown",)`` for a gap that no effect explains.
        share: unexplained share of the gap, at least 0.
        probability: among all answers weighed, a fraction.
        hypothesis: the set of causes. It is fitted to whole runs if it is the answer of the study or a part of
            it, else in the view in which it was weighed. None where it is not a set of causes, or its fit to
            whole runs fails.
        stated: the hypothesis with its parameters as stated, in the noise of the view, if sets are weighed in
            it.
        choices: choices of the set that the runs cannot exclude.
    """

    effects: tuple[str, ...]
    share: float
    probability: float
    hypothesis: Hypothesis | None = None
    stated: Hypothesis | None = None
    choices: tuple[Choice, ...] = ()

    @property
    def fit(self) -> Fit | None:
        """The fit of the answer's effects; None where it has none."""
        return None if self.hypothesis is None else self.hypothesis.fit_of_answer

    @property
    def moment(self) -> MomentLayer | None:
        """The random moment among the causes; None if there is none."""
        return None if self.hypothesis is None else self.hypothesis.moment

    def textbook_of(self, fit: Fit) -> Fit | None:
        """The fit with textbook forms, if the given fit has free forms; else None."""
        own = self.hypothesis
        return own.textbook if own is not None and own.moment is None and own.fit is fit else None
