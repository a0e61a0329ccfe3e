"""The missing moment, or error of the reading, as a curve or a map with a band; and where single runs show it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from diagnosis.closable import Curve
from diagnosis.law import bases
from diagnosis.law.ceiling import Evidence, Rest, Unit
from diagnosis.law.ridge import Normal, Ridge, Rows, normal
from tunnel_sim.vocabulary.record import Array

_POINTS, _MAP = 41, 13
LISTED = 0.1
"""Share of the largest run's part from which a run is among the events."""

_INSIDE = 0.8  # of an event's energy lies within the times given

_OVER: Mapping[str, tuple[str, ...]] = {
    "angle": ("angle",), "rate": ("rate",), "state": ("angle", "rate"), "wind": ("angle", "rate"),
    "time": ("time",), "reading": ("angle",),
}  # fmt: skip


def curve(rest: Rest, found: Evidence) -> Curve | None:
    """The law of a kind without a formula.

    Args:
        rest: what is left.
        found: of the kind.

    Returns:
        In the units of the fit, for the median spring, and the greatest wind speed where it is of the wind; a
        moment in time is that at the greatest angle, without rate. None where the kind has no common law.
    """
    kind = found.ceiling.kind
    if found.solution is None or kind not in _OVER:
        return None
    r = rest.ranges
    count = _MAP if len(_OVER[kind]) > 1 else _POINTS
    reach = {
        "angle": np.linspace(-r.angle, r.angle, count),
        "rate": np.linspace(-r.rate, r.rate, count),
        "time": np.linspace(0.0, r.time, count),
    }
    axes = [reach[name] for name in _OVER[kind]]
    grid = dict(zip(_OVER[kind], (g.ravel() for g in np.meshgrid(*axes, indexing="ij")), strict=True))
    size = next(iter(grid.values())).size
    still = {
        "angle": np.full(size, r.angle if kind == "time" else 0.0),
        "rate": np.zeros(size),
        "time": np.zeros(size),
    }
    at = bases.Places(**{**still, **grid}, stiffness=r.stiffness, speed=r.speed if kind == "wind" else 0.0)
    values, std = _with_band(bases.COMMON[kind](at, r), found.solution, _own_line(kind, grid))
    if kind in bases.OF_READING:
        values, std = values * r.angle, std * r.angle
    places = tuple(tuple(axis.tolist()) for axis in axes)
    unit = "rad" if kind in bases.OF_READING else _moment_unit(rest)
    return Curve(_OVER[kind], places, tuple(values.tolist()), tuple(std.tolist()), unit)


def _moment_unit(rest: Rest) -> str:
    return "rad/s2" if rest.fit.problem.data.normalised else "N m"


def _own_line(kind: str, grid: Mapping[str, Array]) -> Array:
    """What the model's own coefficients and its zero absorb, at the places, shape (n, k)."""
    size = next(iter(grid.values())).size
    lines = [] if kind == "time" else [values for name, values in grid.items() if name != "time"]
    return np.column_stack([np.ones(size), *lines])


def _with_band(basis: Array, solution: Ridge, line: Array) -> tuple[Array, Array]:
    """Values and standard deviations, without the line."""
    own = np.linalg.qr(line)[0]
    free = solution.whole.free
    rows = basis - own @ (own.T @ basis)
    variance = np.einsum("ij,jk,ik->i", rows, solution.covariance[free:, free:], rows)
    return rows @ solution.solution[free:], np.sqrt(np.maximum(variance, 0.0))


def events(rest: Rest, kind: str, precision: float) -> list[dict[str, Any]]:
    """The runs that show what differs from run to run, and when.

    Args:
        rest: what is left.
        kind: of `diagnosis.law.bases.SINGLE`.
        precision: one over the variance of a coefficient in the prior, in the basis' units.

    Returns:
        By run, largest first: ``run``, its ``share`` of what is closed, and ``from_s`` and ``to_s`` since the start
        of the record, between which four fifths of it lie, in the units of the fit.
    """
    found = []
    for path, columns in zip(rest.paths, rest.columns(kind), strict=True):
        unit = Unit(path, slice(None))
        part: Normal = normal(
            Rows(np.zeros((path.residual.size, 0)), unit.left(columns), unit.left(path.residual))
        )
        solution = Ridge(part, precision).solution
        energy = (bases.SINGLE[kind](path, rest.ranges) @ solution) ** 2
        found.append((path, max(part.power - part.cost(solution), 0.0), energy))
    whole = max(sum(drop for _, drop, _ in found), 1e-300)
    largest = max(drop for _, drop, _ in found)
    return [
        {"run": path.run.id, "share": drop / whole, **_interval(energy, path.time + path.run.start)}
        for path, drop, energy in sorted(found, key=lambda one: -one[1])
        if drop > LISTED * largest
    ]


def _interval(energy: Array, time: Array) -> dict[str, float]:
    """The shortest interval of time with most of the energy."""
    sums = np.concatenate([[0.0], np.cumsum(energy)])
    ends = np.minimum(np.searchsorted(sums, sums[:-1] + _INSIDE * sums[-1]), sums.size)
    inside = ends < sums.size
    lengths = np.where(inside, ends - np.arange(energy.size), energy.size + 1)
    first = int(np.argmin(lengths))
    last = min(int(ends[first]), energy.size) - 1
    return {"from_s": float(time[first]), "to_s": float(time[last])}
