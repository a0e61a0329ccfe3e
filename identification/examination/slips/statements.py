"""Statements of several runs against their motions: growth, equal statements, wind, and units of all runs."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from identification import policy
from identification.examination.self_excited import Swing
from identification.examination.slips.base import STIFFNESS_UNITS, SlipEvidence
from identification.examination.slips.fits import Statements, agreement
from identification.status import WITHHOLDS, Outcome, Remark
from tunnel_sim.vocabulary.campaign import speed_groups


def motion_grows(evidence: SlipEvidence) -> Remark | None:
    """Wind-off runs grow: their decay rate is negative beyond chance, and their swings become larger. Refused.

    A blow in mid-record does not show both.
    """
    ids = []
    for swing in evidence.swings:
        if swing.run.wind_on or swing.rate + policy.REFUSAL_DEVIATIONS * swing.rate_std >= 0.0:
            continue
        quarters = [float(part @ part) / max(part.size, 1) for part in np.array_split(swing.motion, 4)]
        if quarters[3] > quarters[2] > max(quarters[0], quarters[1]):
            ids.append(swing.run.id)
    what = "the motion grows with the wind off, which is impossible on a passive rig"
    remedy = "check whether time runs backwards in the file, state the wind speed, or remove the run"
    return Remark(Outcome.REFUSED, tuple(ids), what, remedy) if ids else None


def equal_statements_differ(evidence: SlipEvidence) -> Remark | None:
    """Runs of equal spring, wind and swing differ in frequency or damping more than under one condition. Refused.

    This includes labels copied from run to run. The values with which the runs would agree are not known.
    """
    groups: dict[tuple[float | None, ...], list[Swing]] = defaultdict(list)
    setting = speed_groups(swing.run.wind_speed for swing in evidence.swings)
    for swing in evidence.swings:
        run = swing.run
        if run.spring_stiffness and swing.rate > 0.0:
            speed = setting[run.wind_speed]
            groups[run.spring_stiffness, speed, run.air_density if run.wind_on else None].append(swing)
    ids: list[str] = []
    largest = 0.0, 0.0
    for group in groups.values():
        low, high = min(group, key=lambda s: s.stiffness), max(group, key=lambda s: s.stiffness)
        stiffness, damping = _apart(low, high)
        if stiffness > np.log(policy.OTHER_SPRING) or (
            stiffness > np.log(policy.OTHER_WIND[0]) and damping > np.log(policy.OTHER_WIND[1])
        ):
            ids += [swing.run.id for swing in group]
            largest = max(largest, (stiffness, damping))
    if not ids:
        return None
    what = (
        f"they state equal springs and winds, and differ by {100.0 * np.expm1(largest[0]):.2g} % or more in "
        f"omega_n^2 and {100.0 * np.expm1(largest[1]):.2g} % or more in damping"
    )
    remedy = "correct spring_stiffness or wind_speed of these runs, which may be copied from one another"
    return Remark(Outcome.REFUSED, tuple(ids), what, remedy)


def _apart(low: Swing, high: Swing) -> tuple[float, float]:
    """Least differences of stiffness and damping of two runs, in logarithms; 0 if their swings are unlike."""
    sizes = sorted((low.amplitude, high.amplitude))
    if low is high or sizes[0] < policy.EQUAL_SWINGS * sizes[1]:
        return 0.0, 0.0
    found = []
    for one, other, stds in (
        (
            high.stiffness,
            low.stiffness,
            (high.stiffness_std / high.stiffness, low.stiffness_std / low.stiffness),
        ),
        (high.rate, low.rate, (high.rate_std / high.rate, low.rate_std / low.rate)),
    ):
        found.append(max(abs(np.log(one / other)) - policy.REFUSAL_DEVIATIONS * float(np.hypot(*stds)), 0.0))
    return found[0], found[1]


@dataclass(frozen=True, eq=False)
class _Change:
    """Changes by the wind in a run, relative to the wind-off runs of its spring."""

    swing: Swing
    stiffness: float
    stiffness_std: float
    damping: float
    damping_std: float


def _changes(swings: tuple[Swing, ...]) -> list[_Change]:
    changes = []
    for swing in swings:
        same = [
            s for s in swings if not s.run.wind_on and s.run.spring_stiffness == swing.run.spring_stiffness
        ]
        if not swing.run.wind_on or not same:
            continue
        k, a = np.mean([s.stiffness for s in same]), np.mean([s.rate for s in same])
        k_std, a_std = (
            np.linalg.norm(v) / len(same)
            for v in ([s.stiffness_std for s in same], [s.rate_std for s in same])
        )
        if not a > 0.0:
            continue
        changes.append(
            _Change(
                swing,
                stiffness=float(swing.stiffness / k - 1.0),
                stiffness_std=float(np.hypot(swing.stiffness_std, k_std) / k),
                damping=float(swing.rate / a - 1.0),
                damping_std=float(np.hypot(swing.rate_std, a_std) / a),
            )
        )
    return changes


def wind_not_seen(evidence: SlipEvidence) -> Remark | None:
    """No wind-on run differs in frequency or decay rate from the wind-off runs of its spring. Asked about.

    Nothing is asked where the records would not show a difference.
    """
    changes = _changes(evidence.swings)
    if not changes:
        return None
    for change in changes:
        damping_std = float(np.hypot(change.damping_std, policy.SCATTER_OF_DAMPING))
        if abs(change.stiffness) + policy.MISFIT_DEVIATIONS * change.stiffness_std > policy.LEAST_OF_WIND:
            return None
        if abs(change.damping) > policy.MISFIT_DEVIATIONS * damping_std:
            return None
        if policy.MISFIT_DEVIATIONS * damping_std > policy.LEAST_DAMPING_OF_WIND:
            return None
    largest = (
        max(abs(change.stiffness) for change in changes),
        max(abs(change.damping) for change in changes),
    )
    what = (
        f"with the wind on, frequency and damping equal those with the wind off within {50.0 * largest[0]:.2g} "
        f"% and {100.0 * largest[1]:.2g} %: no body has so small an aerodynamic moment"
    )
    ids = tuple(change.swing.run.id for change in changes)
    return Remark(Outcome.NOTED, ids, what, "check whether the fan was on, and wind_speed")


def wind_exchanged(evidence: SlipEvidence) -> Remark | None:
    """All labels of wind on and off are exchanged: the wind seems to reduce the damping, and the springs disagree.

    Refused where the springs agree after an exchange: either sign alone may be an effect.

    It is sought where all wind-on runs have one speed.
    """
    swings = tuple(s for s in evidence.swings if s.run.spring_stiffness)
    speeds = set(speed_groups(s.run.wind_speed for s in swings if s.run.wind_on).values())
    changes = _changes(swings)
    if len(speeds) != 1 or len({c.swing.run.spring_stiffness for c in changes}) == 1:
        return None
    less = [-c.damping / float(np.hypot(c.damping_std, policy.SCATTER_OF_DAMPING)) for c in changes]
    if min(less, default=0.0) < policy.REFUSAL_DEVIATIONS:
        return None
    labels = Statements.of(swings)
    tight = {"departure": policy.SPRING_TOLERANCE, "of_speed": policy.SPRING_TOLERANCE}
    stated = agreement(labels, **tight)
    exchanged = agreement(replace(labels, speed=speeds.pop() - labels.speed), **tight)
    gain = stated.squares - exchanged.squares
    if gain <= float(chdtri(1, policy.MISFIT_RATE)) or not exchanged.good:
        return None
    what = (
        "as stated the wind reduces the damping and the springs disagree; they agree if the wind speeds of "
        "the runs with the wind on and off are exchanged"
    )
    ids = tuple(swing.run.id for swing in swings)
    return Remark(Outcome.REFUSED, ids, what, "correct wind_speed or the file names of these runs")


_KEEP = "or state plausible = false under [sensor]"
_SLENDER = 12.0  # Izz of a uniform rod of mass m and length l is m l²/12

#: Ratios of apparent to true density for a value in another unit.
_OF_DENSITY = {
    **{f"spring_stiffness in {unit}": STIFFNESS_UNITS[unit] for unit in ("N mm/rad", "N cm/rad", "N m/deg")},
    "time_s in minutes": 1.0 / 3600.0,
    "time_s in milliseconds": 1e6,
    "frontal_area in cm2": 1e-4,
    "frontal_area in mm2": 1e-6,
    "reference_length in cm": 1e-6,
    "reference_length in mm": 1e-9,
}


def yaw_moment_too_large(evidence: SlipEvidence) -> Remark | None:
    """|Cnβ| too large for any body: a stiffness, a speed or a size in a wrong unit. Asked about."""
    area, length = evidence.campaign.rig.frontal_area, evidence.campaign.rig.reference_length
    swings = [s for s in evidence.swings if s.run.spring_stiffness]
    windy = [s.run.id for s in swings if s.run.wind_on]
    if not windy or area is None or length is None or not _judged(evidence):
        return None
    found = agreement(Statements.of(swings))
    if found.freedom < 0 or not found.inverse_inertia > 0.0:
        return None
    # a stated inertia that contradicts the springs has its own remark
    inertia = min(evidence.campaign.rig.yaw_inertia or np.inf, 1.0 / found.inverse_inertia)
    scale = area * length / inertia
    value, std = found.air / scale, found.air_std / scale
    if abs(value) - policy.MISFIT_DEVIATIONS * std <= policy.GREATEST_YAW_MOMENT:
        return None
    what = (
        f"the frequencies give Cn_beta = {value:.3g} 1/rad, and no body has more than "
        f"{policy.GREATEST_YAW_MOMENT:g}: a value is in a wrong unit (spring_stiffness in N mm/rad or N cm/rad"
        ", wind_speed, air_density or a size)"
    )
    remedy = f"give them in SI units, {_KEEP}"
    return Remark(Outcome.NOTED, tuple(windy), what, remedy, {WITHHOLDS: True})


def inertia_of_no_body(evidence: SlipEvidence) -> Remark | None:
    """An inertia, by the springs, that no body of the stated sizes can have. Asked about, with the likely slips.

    If an inertia is stated, it is compared instead: it is more accurate.

    12 Izz/(A l³), the density of a uniform rod of these sizes, is compared with the densities of bodies.
    """
    area, length = evidence.campaign.rig.frontal_area, evidence.campaign.rig.reference_length
    still = [s for s in evidence.swings if s.run.spring_stiffness and not s.run.wind_on]
    stated = evidence.campaign.rig.yaw_inertia is not None
    if stated or not still or area is None or length is None or not _judged(evidence):
        return None
    inertia = float(np.median([(s.run.spring_stiffness or 0.0) / s.stiffness for s in still]))
    density = _SLENDER * inertia / (area * length**3)
    low, high = policy.BODY_DENSITIES
    if low <= density <= high:
        return None
    likely = [words for words, factor in _OF_DENSITY.items() if low <= density / factor <= high]
    looks = f"; it looks like {' or '.join(likely)}" if likely else ""
    what = (
        f"the frequencies give Izz = {inertia:.3g} kg m2, which a body of the stated frontal_area and "
        f"reference_length has at a density of {density:.2g} kg/m3{looks}"
    )
    remedy = f"check the units of spring_stiffness, time_s, frontal_area and reference_length, {_KEEP}"
    return Remark(Outcome.NOTED, tuple(s.run.id for s in still), what, remedy, {WITHHOLDS: True})


def _judged(evidence: SlipEvidence) -> bool:
    """Whether sizes are judged: not if the campaign states that they are right, or the joint slides."""
    return evidence.campaign.sensor.plausible is not False and evidence.campaign.law is None
