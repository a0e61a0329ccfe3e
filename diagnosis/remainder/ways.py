"""How laws of what an answer leaves are sought: the way follows from how the runs are excited and held."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from diagnosis.facts.remainder import Closable
from diagnosis.remainder.driven import closable_driven
from diagnosis.remainder.explain import closable
from diagnosis.search.study import Study


class Way:
    """A way in which laws of what an answer leaves are sought."""

    #: What is said where nothing is sought, by its key among the cautions; empty: nothing.
    caution: ClassVar[str] = ""

    def takes(self, study: Study) -> bool:
        """Whether the runs of a study are such as it is for."""
        raise NotImplementedError

    def closable(self, study: Study, *, significant: bool, decided: bool) -> Closable | None:
        """What could be closed of what the answer leaves; None where nothing is sought or found.

        Args:
            significant: whether what remains is beyond chance; of an undecided answer the whole gap remains.
            decided: whether the answer is.

        Raises:
            LinAlgError: when its equations cannot be solved.
        """
        raise NotImplementedError


class NotSought(Way):
    """Of a driven body that nothing holds: every small error of a moment adds up in its angle."""

    caution = "remainder not sought"

    def takes(self, study: Study) -> bool:
        """Driven runs of a body that nothing restores."""
        return study.campaign.driven and not study.model.restored

    def closable(self, study: Study, *, significant: bool, decided: bool) -> Closable | None:
        """Nothing."""
        del study, significant, decided
        return None


class ListedLaws(Way):
    """Of driven runs: laws of a short list, integrated with the motion."""

    def takes(self, study: Study) -> bool:
        """Driven runs."""
        return study.campaign.driven

    def closable(self, study: Study, *, significant: bool, decided: bool) -> Closable | None:
        """The law of the list that predicts held-out data best."""
        return closable_driven(study, significant=significant and decided)


class AnyLaw(Way):
    """Of free decays: any smooth moment or error of the reading, from linear responses."""

    def takes(self, study: Study) -> bool:
        """All runs."""
        del study
        return True

    def closable(self, study: Study, *, significant: bool, decided: bool) -> Closable | None:
        """The share of each kind of law, and the simplest that closes about as much as any."""
        return closable(study, significant=significant, decided=decided)


WAYS: Sequence[Way] = (NotSought(), ListedLaws(), AnyLaw())
"""All ways, in the order in which they are asked whether they take the runs."""


def way_for(study: Study) -> Way:
    """The way for the runs of a study."""
    return next(way for way in WAYS if way.takes(study))
