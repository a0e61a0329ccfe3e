"""Statements whose unit is wrong in all runs, known by the size of their consequences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification import policy
from identification.examination.slips.base import SlipEvidence, StatementSlip
from identification.examination.slips.fits import Statements, agreement
from identification.status import WITHHOLDS, Outcome, Remark

_KEEP = "or state plausible = false under [sensor]"
_SLENDER = 12.0  # Izz of a uniform rod of mass m and length l is m l²/12

#: Apparent density over the true one where a value is in another unit.
_OF_DENSITY = {
    "spring_stiffness in N mm/rad": 1e3,
    "spring_stiffness in N cm/rad": 1e2,
    "spring_stiffness in N m/deg": np.pi / 180.0,
    "time_s in minutes": 1.0 / 3600.0,
    "time_s in milliseconds": 1e6,
    "frontal_area in cm2": 1e-4,
    "frontal_area in mm2": 1e-6,
    "reference_length in cm": 1e-6,
    "reference_length in mm": 1e-9,
}


@dataclass(frozen=True)
class YawMomentTooLarge(StatementSlip):
    """|Cnβ| too large for any body: a stiffness, a speed or a size in a wrong unit. Asked about."""

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """Compare Cnβ of the runs with the greatest."""
        area, length = seen.campaign.rig.frontal_area, seen.campaign.rig.reference_length
        swings = [s for s in seen.swings if s.run.spring_stiffness]
        windy = [s.run.id for s in swings if s.run.wind_on]
        if not windy or area is None or length is None or not _judged(seen):
            return ()
        found = agreement(Statements.of(swings))
        if found.freedom < 0 or not found.inverse_inertia > 0.0:
            return ()
        # a stated inertia that contradicts the springs has its own remark
        inertia = min(seen.campaign.rig.yaw_inertia or np.inf, 1.0 / found.inverse_inertia)
        scale = area * length / inertia
        value, std = found.air / scale, found.air_std / scale
        if abs(value) - policy.MISFIT_DEVIATIONS * std <= policy.GREATEST_YAW_MOMENT:
            return ()
        what = (
            f"the frequencies give Cn_beta = {value:.3g} 1/rad, and no body has more than "
            f"{policy.GREATEST_YAW_MOMENT:g}: a value is in a wrong unit (spring_stiffness in N mm/rad or N cm/rad"
            ", wind_speed, air_density or a size)"
        )
        remedy = f"give them in SI units, {_KEEP}"
        return (Remark(Outcome.NOTED, tuple(windy), what, remedy, {WITHHOLDS: True}),)


@dataclass(frozen=True)
class InertiaOfNoBody(StatementSlip):
    """An inertia, by the springs, that a body of the stated sizes cannot have. Asked about, with the likely slips.

    A stated inertia is compared instead where there is one: it is closer.
    """

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """Compare 12 Izz/(A l³), the density of a uniform rod of these sizes, with those of bodies."""
        area, length = seen.campaign.rig.frontal_area, seen.campaign.rig.reference_length
        still = [s for s in seen.swings if s.run.spring_stiffness and not s.run.wind_on]
        stated = seen.campaign.rig.yaw_inertia is not None
        if stated or not still or area is None or length is None or not _judged(seen):
            return ()
        inertia = float(np.median([(s.run.spring_stiffness or 0.0) / s.stiffness for s in still]))
        density = _SLENDER * inertia / (area * length**3)
        low, high = policy.BODY_DENSITIES
        if low <= density <= high:
            return ()
        likely = [words for words, factor in _OF_DENSITY.items() if low <= density / factor <= high]
        looks = f"; it looks like {' or '.join(likely)}" if likely else ""
        what = (
            f"the frequencies give Izz = {inertia:.3g} kg m2, which a body of the stated frontal_area and "
            f"reference_length has at a density of {density:.2g} kg/m3{looks}"
        )
        remedy = f"check the units of spring_stiffness, time_s, frontal_area and reference_length, {_KEEP}"
        return (Remark(Outcome.NOTED, tuple(s.run.id for s in still), what, remedy, {WITHHOLDS: True}),)


def _judged(seen: SlipEvidence) -> bool:
    """Whether sizes are judged: not where the campaign states that they are right, or the joint slides."""
    return seen.campaign.sensor.plausible is not False and seen.campaign.law is None
