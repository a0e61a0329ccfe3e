"""Ways to find laws of an answer's residual; the way depends on how the runs are excited and supported."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from diagnosis.remainder.closable import Closable
from diagnosis.remainder.driven import closable_driven
from diagnosis.remainder.explain import closable
from diagnosis.search.study import Study


class Way:
    """A way to find laws of an answer's residual."""

    #: Key of the caution if nothing is sought; empty: none.
    caution: ClassVar[str] = ""

    def takes(self, study: Study) -> bool:
        """Whether the way applies to the runs of a study."""
        raise NotImplementedError

    def closable(self, study: Study, *, significant: bool, decided: bool) -> Closable | None:
        """The explainable part of the answer's residual; None if nothing is sought or found.

        Args:
            significant: whether the residual exceeds chance; for an undecided answer it is the whole gap.
            decided: whether the answer is decided.

        Raises:
            LinAlgError: when the equations of the way cannot be solved.
        """
        raise NotImplementedError


class NotSought(Way):
    """For a driven body without a spring: every small error of a moment adds up in its angle."""

    caution = "remainder not sought"

    def takes(self, study: Study) -> bool:
        """Whether the runs are driven and the body has no restoring moment."""
        return study.campaign.driven and not study.model.restored

    def closable(self, study: Study, *, significant: bool, decided: bool) -> Closable | None:
        """None: nothing is sought."""
        del study, significant, decided
        return None


class ListedLaws(Way):
    """For driven runs: laws of a short list, integrated with the motion."""

    def takes(self, study: Study) -> bool:
        """Driven runs."""
        return study.campaign.driven

    def closable(self, study: Study, *, significant: bool, decided: bool) -> Closable | None:
        """The law of the list that predicts held-out data best."""
        return closable_driven(study, significant=significant and decided)


class AnyLaw(Way):
    """For free decays: any smooth moment or error of the reading, from linear responses."""

    def takes(self, study: Study) -> bool:
        """All runs."""
        del study
        return True

    def closable(self, study: Study, *, significant: bool, decided: bool) -> Closable | None:
        """The share of each kind of law, and the simplest that explains about as much as any."""
        return closable(study, significant=significant, decided=decided)


WAYS: Sequence[Way] = (NotSought(), ListedLaws(), AnyLaw())
"""All ways, in order of preference."""


def way_for(study: Study) -> Way:
    """The way for the runs of a study."""
    return next(way for way in WAYS if way.takes(study))
