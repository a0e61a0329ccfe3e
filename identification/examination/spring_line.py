"""Whether the stated springs agree: with the wind off, Kr/ωn² is the same inertia for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, ndtri

from identification.examination.swings import Swing
from identification.policy import MISFIT_RATE, SPRING_TOLERANCE
from identification.remark import Outcome, Remark
from tunnel_sim.vocabulary.record import Array

_LEAST = 3  # springs needed to say which one is wrong

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
    return (_several(springs) if place is None else _one(springs, place),)


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
