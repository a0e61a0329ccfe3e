"""Straight lines through runs with right labels, with tolerances that only a slip exceeds.

Every run has k = ωn² = g Kr (1 + d) − n ½ρV² with g = 1/Izz: n is common, and d is the deviation of a spring,
due to its calibration, gravity, a flexible rod or a nonlinearity. A slip is a discrete change of Kr or V. Two
things distinguish it from an effect: it exceeds tolerances that include every effect, and another value agrees
where the stated one is grossly wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from identification import policy
from identification.examination.self_excited import Swing
from tunnel_sim.vocabulary.campaign import Run
from tunnel_sim.vocabulary.record import Array

_PASSES = 4
# standard deviation of the air's stiffness over the total: more is less likely, but not excluded
_MOST_AIR = 3.0
_TINY = 1e-150  # relative size of a column below which it has no effect
_LEAST = 1e-3  # share of the usual g: lower bound of a fit to wrong labels


@dataclass(frozen=True, eq=False)
class Statements:
    """Stated conditions and measured frequencies, run by run.

    Args:
        spring: Kr, shape (n,), N m/rad.
        speed: V, shape (n,), m/s.
        density: ρ, shape (n,), kg/m³; for runs that state none the median of the others, or 1.2 if no run
            states any.
        clock: stamped times over true ones, shape (n,); 1 as stated.
        recorded: k = ωn² by the stamped times, shape (n,), 1/s².
        std: relative standard deviation of k, including its change along the run, shape (n,).
    """

    runs: tuple[Run, ...]
    spring: Array
    speed: Array
    density: Array
    clock: Array
    recorded: Array
    std: Array

    @classmethod
    def of(cls, swings: Sequence[Swing]) -> Statements:
        """Statements of the runs with a stated spring; if there are none, all runs have one spring of 1 N m/rad."""
        known = [s for s in swings if s.run.spring_stiffness] or list(swings)
        runs = tuple(s.run for s in known)
        stated = [run.air_density for run in runs if run.air_density is not None]
        usual = float(np.median(stated)) if stated else 1.2
        return cls(
            runs,
            np.array([run.spring_stiffness or 1.0 for run in runs]),
            np.array([run.wind_speed for run in runs]),
            np.array([usual if run.air_density is None else run.air_density for run in runs]),
            np.ones(len(known)),
            np.array([s.stiffness for s in known]),
            np.array([s.stiffness_std / s.stiffness for s in known]),
        )

    @property
    def stiffness(self) -> Array:
        """The stiffness K by the true times, shape (n,), 1/s²."""
        return np.asarray(self.recorded * self.clock**2)

    @property
    def pressure(self) -> Array:
        """½ρV², shape (n,), Pa."""
        return np.asarray(0.5 * self.density * self.speed**2)


@dataclass(frozen=True, eq=False)
class Agreement:
    """The agreement of statements and frequencies.

    Args:
        squares: sum of squared residuals over tolerances, dimensionless.
        away: residual of each run, in tolerances, shape (n,).
        inverse_inertia: g, 1/(kg m²).
        air: n, the air's part of k, 1/(kg m²) per m³.
        columns: columns of g and n in the last fit, shape (rows, 2).
    """

    squares: float
    freedom: int
    away: Array
    inverse_inertia: float
    air: float
    columns: Array

    @property
    def air_std(self) -> float:
        """Standard deviation of n, 1/(kg m²) per m³; 0 without wind."""
        sizes = np.maximum(np.linalg.norm(self.columns, axis=0), _TINY)
        unit = self.columns / sizes
        return float(np.sqrt(np.linalg.pinv(unit.T @ unit, rcond=1e-14, hermitian=True)[1, 1]) / sizes[1])

    @property
    def gross(self) -> bool:
        """Whether the statements contradict the frequencies beyond chance and beyond every effect."""
        return self.freedom > 0 and self.squares > float(chdtri(self.freedom, policy.REFUSAL_RATE))

    @property
    def good(self) -> bool:
        """Whether the statements agree well: right labels have small residuals in such wide tolerances."""
        return self.squares <= float(chdtri(max(self.freedom, 1), policy.SLIP_AGREES))


def agreement(
    labels: Statements,
    *,
    departure: float = policy.SPRING_DEPARTURE,
    of_speed: float = policy.SPEED_DEPARTURE,
) -> Agreement:
    """Fit g, n and the stiffness of each spring to statements.

    Args:
        departure: relative tolerance of a spring, dimensionless.
        of_speed: relative tolerance of a wind speed, dimensionless.
    """
    settings, place = _settings(labels.spring)
    seen, pressure, springs = labels.stiffness, labels.pressure, settings.size
    count, windy = seen.size, bool(np.any(labels.speed > 0.0))
    usual = float(np.median(seen / labels.spring))
    least = np.full(springs, np.inf)
    np.minimum.at(least, place, seen)
    # rows of the runs, of the springs, and of n; columns g and n. The stiffness of each spring per unit inertia,
    # the third kind of unknown, is eliminated.
    group = np.concatenate((place, np.arange(springs), [springs]))
    members = np.zeros((springs + 1, group.size))
    members[group, np.arange(group.size)] = 1.0
    alone = members[:, -1]
    of_spring = np.concatenate((np.ones(count), -np.ones(springs), [0.0]))
    block = np.zeros((group.size, 3))  # the columns behind the target
    block[:count, 0] = seen
    block[:count, 2] = -pressure
    block[count:-1, 1] = settings
    block[-1, 2] = pressure.max() / (_MOST_AIR * float(np.median(seen)))
    scatter = (labels.std**2 + policy.SCATTER_OF_STIFFNESS**2) * seen**2
    inverse_inertia, air, stiffness, std = usual, 0.0, least, np.ones(group.size)
    for _ in range(_PASSES):  # the tolerances scale with the fitted values
        std[:count] = np.sqrt(scatter + (2.0 * of_speed * air * pressure) ** 2)
        std[count:-1] = departure * np.minimum(max(inverse_inertia, _LEAST * usual) * settings, stiffness)
        indicator = of_spring / std
        shares = members * indicator
        scaled = block / std[:, None]
        on_springs = shares @ scaled / (shares @ indicator + alone)[:, None]
        scaled -= indicator[:, None] * on_springs[group]
        target, columns = scaled[:, 0], scaled[:, 1:]
        sizes = np.maximum(np.linalg.norm(columns, axis=0), _TINY)
        solution = np.linalg.lstsq(columns / sizes, target, rcond=1e-12)[0] / sizes
        away = target - columns @ solution
        inverse_inertia, air = (float(value) for value in solution)
        stiffness = np.maximum((on_springs[:, 0] - on_springs[:, 1:] @ solution)[:springs], least)
    return Agreement(
        squares=float(away @ away),
        freedom=count - 1 - int(windy),
        away=np.abs(away[:count]),
        inverse_inertia=inverse_inertia,
        air=air,
        columns=columns,
    )


def _settings(values: Array) -> tuple[Array, NDArray[np.intp]]:
    """The distinct values, which differ by more than two springs may, and for each run the index of its value."""
    order = np.argsort(values)
    new = np.diff(values[order]) > policy.LEAST_SPRING_SPREAD * values[order][1:]
    group = np.concatenate(([0], np.cumsum(new)))
    place = np.empty(values.size, dtype=np.intp)
    place[order] = group
    return np.array([values[place == i].mean() for i in range(int(group[-1]) + 1)]), place
