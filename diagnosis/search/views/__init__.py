"""The views of the runs in which sets of causes are found, one file each."""

from __future__ import annotations

from diagnosis.search.views.beginnings import AfterBeginnings, Beginnings
from diagnosis.search.views.by_moment import ByMoment
from diagnosis.search.views.stretches import InStretches
from diagnosis.search.views.view import View
from diagnosis.search.views.whole_runs import WholeRuns

#: In order of preference; each view gets the results of the previous one.
VIEWS: tuple[type[View], ...] = (InStretches, Beginnings, AfterBeginnings, WholeRuns, ByMoment)
