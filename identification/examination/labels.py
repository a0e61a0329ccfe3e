"""Whether the stated springs and wind speeds fit the frequencies, and which two may have been exchanged.

Every run obeys Kr = Izz ωn² + Ka with a common Izz and with Ka proportional to ½ρV². The runs of one spring lie on
a straight line of ωn² against ½ρV², whatever the error of the spring. If the statements contradict the frequencies
beyond chance, and exchanging those of two runs makes them agree, they were exchanged.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, fdtri

from identification.examination.swings import Swing
from identification.policy import (
    LEAST_SPRING_SPREAD,
    LEAST_STIFFNESS_STD,
    MISFIT_RATE,
    REFUSAL_RATE,
    SAME_PRESSURE,
    SPRING_TOLERANCE,
)
from identification.remark import Outcome, Remark
from tunnel_sim.vocabulary.record import Array

_CANDIDATES = 12  # runs that fit worst, each tried against all others
_LEAST_RUNS = 2


@dataclass(frozen=True, eq=False)
class Labels:
    """Stated and measured quantities, run by run.

    Args:
        spring: stated Kr, shape (n,), N m/rad.
        pressure: stated ½ρV², shape (n,), Pa.
        seen: k = ωn², shape (n,), 1/s².
        std: standard deviation of k, shape (n,), 1/s².
    """

    spring: Array
    pressure: Array
    seen: Array
    std: Array

    @classmethod
    def of(cls, swings: Sequence[Swing]) -> Labels:
        """Of runs that all state their spring."""
        runs = [swing.run for swing in swings]
        seen = np.array([swing.stiffness for swing in swings])
        std = np.array([swing.stiffness_std for swing in swings])
        return cls(
            np.array([float(run.spring_stiffness or 0.0) for run in runs]),
            np.array([0.5 * (run.air_density or 0.0) * run.wind_speed**2 for run in runs]),
            seen,
            np.maximum(std, LEAST_STIFFNESS_STD * seen),
        )


@dataclass(frozen=True)
class _Misfit:
    """Weighted sum of squared residuals, and its degrees of freedom."""

    squares: float
    freedom: int

    @property
    def contradicts(self) -> bool:
        """Whether the residuals are beyond chance."""
        return self.freedom > 0 and self.squares > float(chdtri(self.freedom, REFUSAL_RATE))

    @property
    def agrees(self) -> bool:
        """Whether the residuals are within chance."""
        return self.squares <= float(chdtri(self.freedom, MISFIT_RATE))

    def mends(self, before: _Misfit, trials: int) -> bool:
        """Whether the statements now agree, or agree better than before by more than chance."""
        if self.agrees:
            return True
        ratio = before.squares / max(self.squares, 1e-300)
        return ratio > float(fdtri(self.freedom, self.freedom, 1.0 - REFUSAL_RATE / max(trials, 1)))


def exchanged_labels(swings: Sequence[Swing]) -> tuple[Remark, ...]:
    """Refuse springs or wind speeds that are assigned to the wrong runs.

    Args:
        swings: of the runs; those without a stated spring are ignored.

    Returns:
        One remark that refuses the campaign and names the runs; none if the statements may be right.
    """
    known = [swing for swing in swings if swing.run.spring_stiffness is not None]
    if len(known) < _LEAST_RUNS:
        return ()
    labels = Labels.of(known)
    for what, misfit, exchange in (
        ("spring_stiffness", _of_springs, _springs_exchanged),
        ("wind_speed", _of_winds, _winds_exchanged),
    ):
        found = _best_exchanges(labels, misfit, exchange)
        if found:
            return (_remark(what, [tuple(known[i].run.id for i in places) for places in found]),)
    return ()


def other_fits(swings: Sequence[Swing]) -> list[tuple[float, float | None]]:
    """What the springs of the runs may be worth, where their statements contradict the frequencies.

    Args:
        swings: of the runs; those without a stated spring are ignored.

    Returns:
        Izz in kg m² and Ka over ½ρV² in m³/rad (None where it is not determined): without each spring in turn, with
        a stiffness common to all runs, as a tilted axis has, and with the wind speeds of two settings exchanged
        where the statements then agree.
    """
    labels = Labels.of([swing for swing in swings if swing.run.spring_stiffness is not None])
    found = [_fitted(labels, labels.spring != spring) for spring in np.unique(labels.spring)]
    found.append(_fitted(labels, labels.spring > 0.0, common=True))
    for _, exchanged in _speeds_exchanged(labels):
        if _of_springs(exchanged)[0].agrees:
            found.append(_fitted(exchanged, labels.spring > 0.0))
    return [one for one in found if one is not None and one[0] > 0.0]


def _fitted(
    labels: Labels, used: NDArray[np.bool_], *, common: bool = False
) -> tuple[float, float | None] | None:
    """Izz and C of Kr = Izz k + C ½ρV², or beside a common stiffness; None where they cannot be separated."""
    spring, seen, pressure = labels.spring[used], labels.seen[used], labels.pressure[used]
    windy = bool(np.any(pressure > 0.0))
    columns = [seen, *([pressure] * windy), *([np.ones_like(seen)] * common)]
    scaled = np.column_stack(columns) / spring[:, None]  # errors of springs are relative
    lengths = np.linalg.norm(scaled, axis=0)
    if (
        spring.size < lengths.size
        or np.linalg.svd(scaled / lengths, compute_uv=False)[-1] < LEAST_SPRING_SPREAD
    ):
        return None
    solution = np.linalg.lstsq(scaled / lengths, np.ones_like(spring), rcond=None)[0] / lengths
    return float(solution[0]), float(solution[1]) if windy else None


def _remark(what: str, places: Sequence[tuple[str, ...]]) -> Remark:
    ids = tuple(dict.fromkeys(itertools.chain.from_iterable(places)))
    pairs = ", or ".join(" and ".join(pair) for pair in places)
    return Remark(
        Outcome.REFUSED,
        ids,
        f"the stated {what} contradicts the frequencies, but agrees if {pairs} are exchanged",
        f"correct {what} or the file names of these runs",
    )


def _best_exchanges(
    labels: Labels,
    misfit: Callable[[Labels], tuple[_Misfit, Array]],
    exchange: Callable[[Labels, Array], Iterator[tuple[tuple[int, ...], Labels]]],
) -> list[tuple[int, ...]]:
    stated, away = misfit(labels)
    if not stated.contradicts:
        return []
    trials = [(places, misfit(other)[0]) for places, other in exchange(labels, away)]
    mended = [(places, found) for places, found in trials if found.mends(stated, len(trials))]
    if not mended:
        return []
    least = min(found.squares for _, found in mended)
    # Exchanges that fit as well as the best one cannot be distinguished.
    limit = least + float(chdtri(1, MISFIT_RATE))
    return [places for places, found in mended if found.squares <= limit]


def _of_springs(labels: Labels) -> tuple[_Misfit, Array]:
    """Misfit of Kr = Izz k + C ½ρV² to all runs, weighted by their frequencies and the springs' tolerance.

    The runs of one spring share its error, so they count once together.
    """
    columns = labels.seen[:, None]
    if np.any(labels.pressure > 0.0):
        columns = np.column_stack((columns, labels.pressure))
    springs, place, count = np.unique(labels.spring, return_inverse=True, return_counts=True)
    std = labels.spring * np.hypot(SPRING_TOLERANCE, labels.std / labels.seen) * np.sqrt(count[place])
    away = _left(columns / std[:, None], labels.spring / std)
    return _Misfit(float(away @ away), springs.size - 1), np.abs(away)


def _of_winds(labels: Labels) -> tuple[_Misfit, Array]:
    """Misfit of k = k0(spring) - c ½ρV² to all runs."""
    springs, place = np.unique(labels.spring, return_inverse=True)
    columns = np.zeros((labels.seen.size, springs.size + 1))
    columns[np.arange(labels.seen.size), place] = 1.0
    columns[:, -1] = labels.pressure
    freedom = labels.seen.size - int(np.linalg.matrix_rank(columns / np.maximum(columns.max(axis=0), 1e-300)))
    away = _left(columns / labels.std[:, None], labels.seen / labels.std)
    return _Misfit(float(away @ away), freedom), np.abs(away)


def _left(columns: Array, target: Array) -> Array:
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    solution = np.linalg.lstsq(columns / scale, target, rcond=1e-10)[0]
    return np.asarray(target - columns / scale @ solution)


def _springs_exchanged(labels: Labels, away: Array) -> Iterator[tuple[tuple[int, ...], Labels]]:
    """The springs of two runs exchanged, and those of all runs of two springs."""
    for i, j in _pairs(away):
        if labels.spring[i] != labels.spring[j]:
            yield (i, j), replace(labels, spring=_swapped(labels.spring, i, j))
    for a, b in itertools.combinations(np.unique(labels.spring).tolist(), 2):
        places = np.flatnonzero((labels.spring == a) | (labels.spring == b))
        if places.size > 2:
            other = labels.spring.copy()
            other[places] = a + b - other[places]
            yield tuple(places.tolist()), replace(labels, spring=other)


def _winds_exchanged(labels: Labels, away: Array) -> Iterator[tuple[tuple[int, ...], Labels]]:
    for i, j in _pairs(away):
        low, high = sorted((labels.pressure[i], labels.pressure[j]))
        if high - low > SAME_PRESSURE * high:
            yield (i, j), replace(labels, pressure=_swapped(labels.pressure, i, j))
    yield from _speeds_exchanged(labels)


def _speeds_exchanged(labels: Labels) -> Iterator[tuple[tuple[int, ...], Labels]]:
    """The wind speeds of all runs of two settings."""
    order = np.argsort(labels.pressure)
    rises = np.diff(labels.pressure[order]) > SAME_PRESSURE * labels.pressure[order][1:]
    settings = np.split(order, np.flatnonzero(rises) + 1)
    for one, two in itertools.combinations(settings, 2):
        if one.size + two.size == 2:
            continue  # that is an exchange between two runs
        other = labels.pressure.copy()
        other[one], other[two] = other[two].mean(), other[one].mean()
        yield tuple(np.sort(np.concatenate([one, two])).tolist()), replace(labels, pressure=other)


def _pairs(away: Array) -> list[tuple[int, int]]:
    """Pairs of runs, one of which fits badly."""
    worst: NDArray[np.intp] = np.argsort(-away)[:_CANDIDATES]
    return sorted({(min(i, j), max(i, j)) for i in worst.tolist() for j in range(away.size) if i != j})


def _swapped(values: Array, i: int, j: int) -> Array:
    other = values.copy()
    other[[i, j]] = other[[j, i]]
    return other
