"""Causes from outside the vocabulary, weighed together with its effects, one file each."""

from __future__ import annotations

from diagnosis.search.rivals.friction_by_direction import FrictionByDirection
from diagnosis.search.rivals.inertia_by_spring import InertiaBySpring
from diagnosis.search.rivals.rival import Rival
from diagnosis.search.rivals.second_inertia import TwoInertias
from diagnosis.search.rivals.two_springs import TwoSprings

#: The rivals of a diagnosis, unless others are given.
RIVALS: tuple[Rival, ...] = (TwoSprings(), TwoInertias(), InertiaBySpring(), FrictionByDirection())
