"""Whether the stated springs agree: with the wind off, Kr/ωn² is the same inertia for all, and the stated one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, ndtri

from identification.examination.labels import other_fits
from identification.examination.swings import Swing
from identification.policy import INERTIA_FACTOR, MISFIT_RATE, SPRING_TOLERANCE
from identification.remark import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array

_LEAST = 3  # springs needed to say which one is wrong

#: What Kr/ωn² over the stated inertia is where a value is in another unit.
_SLIPS = {
    1e3: "spring_stiffness in N mm/rad",
    1e2: "spring_stiffness in N cm/rad",
    np.pi / 180.0: "spring_stiffness in N m/deg",
    1.0 / 9.81: "spring_stiffness in kgf m/rad",
    8.85: "spring_stiffness in lbf in/rad",
    1e6: "time_s in milliseconds",
    1.0 / 3600.0: "time_s in minutes",
    1e-3: "yaw_inertia in g m2",
    1e-4: "yaw_inertia in kg cm2",
    1e-6: "yaw_inertia in kg mm2",
    1e-7: "yaw_inertia in g cm2",
}

_REMEDY = "calibrate that spring again; a tilted axis or a flexible rod looks similar, run the diagnosis"


@dataclass(frozen=True, eq=False)
class _Springs:
    """Wind-off, by spring: Kr, ids of the runs, ln(Kr/ωn²) and its standard deviation, shape (springs,)."""

    stiffness: Array
    runs: tuple[tuple[str, ...], ...]
    inertia: Array
    std: Array

    @classmethod
    def of(cls, swings: Sequence[Swing]) -> _Springs:
        stiffness = sorted({float(s.run.spring_stiffness or 0.0) for s in swings})
        groups = [[s for s in swings if s.run.spring_stiffness == value] for value in stiffness]
        seen = [np.mean([np.log(s.stiffness) for s in group]) for group in groups]
        std = [np.hypot(SPRING_TOLERANCE, _relative_std(group)) for group in groups]
        return cls(
            np.array(stiffness),
            tuple(tuple(s.run.id for s in group) for group in groups),
            np.log(stiffness) - np.array(seen),
            np.array(std, dtype=np.float64),
        )

    def without(self, place: int) -> _Springs:
        keep = [i for i in range(self.stiffness.size) if i != place]
        return _Springs(
            self.stiffness[keep], tuple(self.runs[i] for i in keep), self.inertia[keep], self.std[keep]
        )

    def mean(self) -> tuple[float, float]:
        """Weighted mean of ln(Kr/ωn²), and its standard deviation."""
        weights = 1.0 / self.std**2
        return float(weights @ self.inertia / weights.sum()), float(weights.sum() ** -0.5)

    def disagree(self) -> bool:
        """Whether the springs' inertias differ beyond chance."""
        away = (self.inertia - self.mean()[0]) / self.std
        return float(away @ away) > float(chdtri(self.stiffness.size - 1, MISFIT_RATE))


def springs_off_the_line(swings: Sequence[Swing]) -> tuple[Remark, ...]:
    """Note springs whose stated stiffness does not fit the wind-off frequencies.

    Args:
        swings: of the runs; only those with the wind off and a stated spring count.

    Returns:
        One remark: on the spring that is wrong if three or more show which one it is, else on all of them. None
        if the springs agree within their tolerance.
    """
    still = [s for s in swings if not s.run.wind_on and s.run.spring_stiffness is not None]
    if len({s.run.spring_stiffness for s in still}) < 2:
        return ()
    springs = _Springs.of(still)
    if not springs.disagree():
        return ()
    place = _the_one(springs) if springs.stiffness.size >= _LEAST else None
    remark = _several(springs) if place is None else _one(springs, place)
    fits = other_fits(swings)
    figures = {"inertias_kg_m2": [one for one, _ in fits], "air_stiffnesses_m3": [air for _, air in fits]}
    return (replace(remark, figures=figures),)


def inertia_off_the_springs(swings: Sequence[Swing], campaign: Campaign) -> tuple[Remark, ...]:
    """Note a stated inertia that the springs contradict by more than a nominal inertia is off.

    Args:
        swings: of the runs; only those with the wind off and a stated spring count.
        campaign: states the inertia.

    Returns:
        One remark, which names the slip of units that it looks like; none where the campaign states no inertia, or
        ``plausible = false``.
    """
    still = [s for s in swings if not s.run.wind_on and s.run.spring_stiffness is not None]
    stated = campaign.rig.yaw_inertia
    if stated is None or not still or campaign.sensor.plausible is False:
        return ()
    found = float(np.exp(_Springs.of(still).mean()[0]))
    off = {ratio: abs(np.log(found / stated / ratio)) for ratio in (1.0, *_SLIPS)}
    if off[1.0] <= np.log(INERTIA_FACTOR):
        return ()
    nearest = min(_SLIPS, key=off.__getitem__)
    slip = f": it looks like {_SLIPS[nearest]}" if off[nearest] <= np.log(INERTIA_FACTOR) else ""
    return (
        Remark(
            Outcome.NOTED,
            tuple(s.run.id for s in still),
            f"with the wind off Kr/omega_n^2 is {found:.4g} kg m2, {found / stated:.4g} times the stated "
            f"yaw_inertia of {stated:.4g} kg m2{slip}",
            "correct the stiffness, the inertia or the times, or state plausible = false under [sensor]",
            {"inertias_kg_m2": [stated], "air_stiffnesses_m3": [None]},
        ),
    )


def _relative_std(group: Sequence[Swing]) -> float:
    """Of the mean of ln k: the effect of the amplitude on k is common to the runs of a spring."""
    return float(np.mean([s.stiffness_std / s.stiffness for s in group]))


def _the_one(springs: _Springs) -> int | None:
    """The spring that differs beyond chance while the others agree; None if there is no single one."""
    scores = []
    for place in range(springs.stiffness.size):
        rest = springs.without(place)
        mean, std = rest.mean()
        score = abs(springs.inertia[place] - mean) / float(np.hypot(std, springs.std[place]))
        scores.append(-1.0 if rest.disagree() else score)
    best = int(np.argmax(scores))
    beyond = float(-ndtri(0.5 * MISFIT_RATE / springs.stiffness.size))
    return best if scores[best] > beyond else None


def _one(springs: _Springs, place: int) -> Remark:
    percent = 100.0 * np.expm1(springs.without(place).mean()[0] - springs.inertia[place])
    said = f"{abs(percent):.0f} % {'stiffer' if percent > 0.0 else 'softer'}"
    return Remark(
        Outcome.NOTED,
        springs.runs[place],
        f"their spring appears {said} than the stated {springs.stiffness[place]:g} N m/rad, judged by the "
        f"frequencies of the other springs",
        _REMEDY,
    )


def _several(springs: _Springs) -> Remark:
    spread = 100.0 * np.expm1(float(np.ptp(springs.inertia)))
    return Remark(
        Outcome.NOTED,
        tuple(name for group in springs.runs for name in group),
        f"with the wind off Kr/omega_n^2 differs by {spread:.0f} % between the stated springs; which one is wrong "
        f"cannot be determined",
        "calibrate the springs again; a tilted axis or a flexible rod looks similar, run the diagnosis",
    )
