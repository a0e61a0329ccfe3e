"""A study with causes that the held-out readings confirm, and what the runs say of them one by one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from diagnosis.answer.sizes_by_run import SizeByRun, study_sizes
from diagnosis.findings.closing import Closing, confirmed
from diagnosis.findings.repeatability import RunRepeatability
from diagnosis.search.answer import UNKNOWN
from diagnosis.search.study import Study


@dataclass(frozen=True, eq=False)
class Confirmed:
    """A study with causes that the held-out readings confirm.

    Args:
        repeats: repeatability of the runs, in the units of the similar campaign; None for a single run, or a body
            without a spring.
    """

    study: Study
    closes: Closing
    repeats: RunRepeatability | None

    @cached_property
    def sizes(self) -> tuple[SizeByRun, ...]:
        """Sizes of the fitted causes in every run, in the units of the similar campaign."""
        return study_sizes(self.study)

    @classmethod
    def of(cls, study: Study) -> Confirmed:
        """The study without the causes that do not reduce the held-out residual."""
        study, closes = confirmed(study)
        # with an unknown cause, the runs may still differ in a way that no effect of the vocabulary describes
        fitted = study.chosen if study.causes != UNKNOWN else study.between_runs or study.chosen
        return cls(study, closes, RunRepeatability.find(fitted))
