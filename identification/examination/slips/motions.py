"""Frequency and damping of all runs against their stated conditions, at the actual scatter between runs.

Every run has k = ωn² = s − n ½ρV² and 2a = c + m ½ρV: s and c belong to its spring, n and m are common. If the
runs repeat well, a small contradiction is significant; if they scatter, only a large one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification import policy
from identification.examination.self_excited import Swing
from identification.examination.slips.fits import Statements
from tunnel_sim.vocabulary.between_runs import USUAL_SCATTER
from tunnel_sim.vocabulary.quantities import Vector
from tunnel_sim.vocabulary.record import Array

_STEPS = 8  # iterations of Gauss and Newton
_PASSES = 3  # the tolerances scale with the fitted values
_SETTLED = 1e-6  # tolerance of the tried number
_DIFFERENCE = 1e-6  # relative step of the tried number, for its derivative
_LONGEST = 0.25  # maximum step of the tried number
_HALVINGS = 20  # halvings of the interval of the scatter's level
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class RunConditions:
    """Conditions of the runs, as stated or in a trial; each array has the shape (n,).

    Args:
        spring: factor on the stated stiffness.
        speed: wind speed V, m/s.
        density: air density ρ, kg/m³.
        clock: stamped times over true ones.
        moment: factor on the air's stiffness.
        lag: lag of the air's moment, s.
    """

    spring: Array
    speed: Array
    density: Array
    clock: Array
    moment: Array
    lag: Array


@dataclass(frozen=True, eq=False)
class MeasuredMotions:
    """Measured frequency and damping of the runs.

    Args:
        stiffness, stiffness_std: k and its standard deviation, shape (n,), 1/s².
        rate, rate_std: a and its standard deviation, shape (n,), 1/s.
        stated: stated spring stiffness, shape (n,), N m/rad.
        place: index of the run's spring, shape (n,).
        springs: number of springs.
    """

    swings: tuple[Swing, ...]
    stiffness: Array
    stiffness_std: Array
    rate: Array
    rate_std: Array
    stated: Array
    place: NDArray[np.intp]
    springs: int
    conditions: RunConditions

    @classmethod
    def of(cls, swings: Sequence[Swing]) -> MeasuredMotions:
        """The runs, all of which state their spring and decay."""
        labels, ones = Statements.of(swings), np.ones(len(swings))
        values, place = np.unique(labels.spring, return_inverse=True)
        rate = np.array([swing.rate for swing in swings])
        return cls(
            tuple(swings),
            labels.recorded,
            np.maximum([s.stiffness_std for s in swings], policy.LEAST_STIFFNESS_STD * labels.recorded),
            rate,
            np.hypot([s.rate_error for s in swings], policy.LEAST_DAMPING_STD * rate),
            labels.spring,
            np.asarray(place, np.intp),
            values.size,
            RunConditions(
                spring=ones,
                speed=labels.speed,
                density=labels.density,
                clock=labels.clock,
                moment=ones,
                lag=np.zeros(len(swings)),
            ),
        )


@dataclass(frozen=True, eq=False)
class TrialSlip:
    """Conditions that depend on one more number.

    Args:
        change: function from a number to the conditions.
        places: indices of the runs concerned.
        kind: kind of slip; empty for an effect.
        least: minimum size of the number for it to be a slip, not an effect, dimensionless.
        start: starting value of the number, dimensionless.
    """

    change: Callable[[RunConditions, float], RunConditions]
    places: tuple[int, ...]
    kind: str = ""
    least: float = 0.0
    start: float = 0.0


@dataclass(frozen=True, eq=False)
class ConditionsFit:
    """A fit of the runs to conditions.

    Args:
        number: number of the trial; 0 without a trial.
        residuals: residuals of k, a, the springs' stiffness and the springs' damping, shape (2 n + 2 springs,).
        std: standard deviations of the residuals due to noise and the tolerances of the springs.
        chance: standard deviations of the residuals due to the usual scatter between runs.
        freedom: degrees of freedom.
    """

    number: float
    residuals: Vector
    std: Vector
    chance: Vector
    freedom: int

    def squares(self, level: float) -> float:
        """Sum of squared residuals over variances, with ``level`` times the usual scatter of the runs."""
        return float(np.sum(self.residuals**2 / (self.std**2 + (level * self.chance) ** 2)))

    def level(self) -> float:
        """Level of the scatter that explains the residuals, within the bounds of scatter."""
        low, high = policy.LEVELS_OF_SCATTER
        if self.squares(low) <= self.freedom:
            return low
        if self.squares(high) > self.freedom:
            return high
        for _ in range(_HALVINGS):
            middle = float(np.sqrt(low * high))
            low, high = (middle, high) if self.squares(middle) > self.freedom else (low, middle)
        return high


def fitted(motions: MeasuredMotions, trial: TrialSlip | None = None, *, wide: bool = False) -> ConditionsFit:
    """Fit the springs, g, n, c and m to the runs, and the number of a trial.

    Args:
        wide: whether springs may deviate from their statements as far as any effect makes them.
    """
    m, number, step = motions, 0.0 if trial is None else trial.start, 0.0
    target = np.concatenate((m.stiffness, m.rate, np.zeros(2 * m.springs)))
    air, damping, air_damping = 0.0, 2.0 * float(np.median(m.rate)), 0.0
    for sweep in range(_STEPS):
        conditions = m.conditions if trial is None else trial.change(m.conditions, number)
        matrix = _matrix(m, conditions)
        std, chance = _tolerances(m, air, damping, air_damping, wide=wide)
        weight = 1.0 / np.hypot(std, chance)
        solution = _solved(matrix, target, weight)
        left = target - matrix @ solution
        if trial is not None:
            moved = _matrix(m, trial.change(m.conditions, number + _DIFFERENCE))
            slope = (moved @ solution - matrix @ solution) / _DIFFERENCE
            joint = _solved(np.column_stack((matrix, slope)), target, weight)
            step = float(np.clip(joint[-1], -_LONGEST, _LONGEST))
            number += step
        springs = m.springs
        air, air_damping = float(solution[springs + 1]), float(solution[-1])
        damping = float(np.median(solution[springs + 2 : 2 * springs + 2]))
        if sweep >= _PASSES and abs(step) < _SETTLED:
            break
    windy = bool(np.any(m.conditions.speed > 0.0))
    freedom = 2 * (m.stiffness.size - m.springs - int(windy)) - int(trial is not None)
    return ConditionsFit(number, left, std, chance, freedom)


def _matrix(m: MeasuredMotions, c: RunConditions) -> Array:
    """Rows of k and a by the recorded times, then of every spring's relative stiffness and damping.

    The unknowns are s of every spring, g, n, c of every spring, the common c, and m.
    """
    count, springs = m.stiffness.size, m.springs
    matrix, each = np.zeros((2 * (count + springs), 2 * springs + 4)), np.arange(count)
    behind = 1.0 + m.stiffness * c.lag**2
    air = c.moment * 0.5 * c.density * c.speed**2 / behind
    matrix[each, m.place] = c.spring / c.clock**2
    matrix[each, springs + 1] = -air / c.clock**2
    matrix[count + each, springs + 1] = 0.5 * air * c.lag / c.clock
    matrix[count + each, springs + 2 + m.place] = 0.5 / c.clock
    matrix[count + each, -1] = 0.25 * c.density * c.speed / c.clock
    rows, own = 2 * count + np.arange(springs), np.arange(springs)
    matrix[rows, own] = 1.0
    matrix[rows, springs] = -np.unique(m.stated)
    matrix[rows + springs, springs + 2 + own] = 1.0
    matrix[rows + springs, -2] = -1.0
    return matrix


def _tolerances(
    m: MeasuredMotions, air: float, damping: float, air_damping: float, *, wide: bool
) -> tuple[Vector, Vector]:
    """Standard deviations of the rows, due to the noise and the springs, and due to the usual scatter between runs.

    Args:
        air: n, 1/(kg m²) per m³.
        damping: c, 1/s.
        air_damping: m, in 1/s per kg/(m² s).
    """
    usual = float(np.median(m.stiffness / m.stated))
    of_spring = policy.SPRING_DEPARTURE if wide else policy.SPRING_TOLERANCE
    of_damping = policy.DAMPING_DEPARTURE if wide else policy.DAMPING_OF_SPRINGS
    damping = max(damping, policy.LEAST_DAMPING_STD * float(np.median(m.rate)))
    springs = of_spring * usual * np.unique(m.stated)
    std = np.concatenate((m.stiffness_std, m.rate_std, springs, np.full(m.springs, of_damping * damping)))
    flow = 0.5 * m.conditions.density * m.conditions.speed
    scatter = USUAL_SCATTER
    chance = np.concatenate(
        (
            np.hypot(
                scatter["spring_stiffness"] * m.stiffness,
                2.0 * scatter["wind_speed"] * air * flow * m.conditions.speed,
            ),
            0.5
            * np.hypot(scatter["mechanical_damping"] * damping, scatter["wind_speed"] * air_damping * flow),
            np.zeros(2 * m.springs),
        )
    )
    return std, chance


def _solved(matrix: Array, target: Vector, weight: Vector) -> Vector:
    scaled = matrix * weight[:, None]
    sizes = np.maximum(np.linalg.norm(scaled, axis=0), _TINY)
    return np.asarray(np.linalg.lstsq(scaled / sizes, target * weight, rcond=1e-12)[0] / sizes)
