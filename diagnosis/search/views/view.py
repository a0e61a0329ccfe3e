"""A view of the runs: when it applies, and the sets of causes found in it. Your own view is one file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from diagnosis.search.clock import StepClock
from diagnosis.search.grow import grow
from diagnosis.search.prepared import Prepared
from diagnosis.search.runs_in_view import RunsInView
from diagnosis.search.sets import Sets


@dataclass(frozen=True, eq=False)
class View(RunsInView):
    """A form of the runs in which sets of causes are found; base class of all views."""

    @classmethod
    def after(cls, prepared: Prepared, known: Sets | None, clock: StepClock) -> Self | None:
        """The view of a campaign; None where it does not apply.

        Args:
            known: the sets of the previous view; None: this is the first view that applies.
        """
        raise NotImplementedError

    def sets(self, clock: StepClock) -> Sets:
        """The sets found in the view."""
        with clock.step("effects"):
            return Sets(self, tuple(grow(self, clock.progress)))
