"""The causes from outside the vocabulary that are weighed with it, one file each."""

from __future__ import annotations

from diagnosis.search.rivals.inertia_by_spring import InertiaBySpring
from diagnosis.search.rivals.rival import Rival
from diagnosis.search.rivals.second_inertia import TwoInertias
from diagnosis.search.rivals.two_springs import TwoSprings

#: Weighed where a diagnosis is not given others.
RIVALS: tuple[Rival, ...] = (TwoSprings(), TwoInertias(), InertiaBySpring())
