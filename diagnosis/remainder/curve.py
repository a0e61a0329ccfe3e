"""The missing moment, or error of the reading, as a curve or map with a band; single events, and a steady line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import chdtrc

from diagnosis.closure import Ceiling, Curve
from diagnosis.likelihood.residuals import ResidualSpectrum, block_gain, resonance, smooth_spectra
from diagnosis.policy import LINE_CONTRAST, LINE_STEADY, PLACE_FALSE_ALARM_RATE
from diagnosis.remainder import bases
from diagnosis.remainder.ceiling import GAPS, Evidence, Unexplained, Unit, gaps
from diagnosis.remainder.paths import Path
from diagnosis.remainder.ridge import Normal, Ridge, Rows, normal, ratio
from diagnosis.where.excess import away_from_motion
from tunnel_sim.vocabulary.record import Array

_POINTS, _MAP = 41, 13
LISTED = 0.1
"""Share of the largest run's part from which a run is among the events."""

_INSIDE = 0.8  # of an event's energy lies within the times given

_OVER: Mapping[str, tuple[str, ...]] = {
    "angle": ("angle",), "rate": ("rate",), "state": ("angle", "rate"), "wind": ("angle", "rate"),
    "time": ("time",), "reading": ("angle",),
}  # fmt: skip


def curve(unexplained: Unexplained, found: Evidence) -> Curve | None:
    """The law of a kind without a formula.

    Args:
        unexplained: what is left.
        found: of the kind.

    Returns:
        In the units of the fit, for the median spring, and the greatest wind speed where it is of the wind; a
        moment in time is that at the greatest angle, without rate. None where the kind has no common law.
    """
    kind = found.ceiling.kind
    if found.solution is None or kind not in _OVER:
        return None
    r = unexplained.ranges
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
    unit = "rad" if kind in bases.OF_READING else _moment_unit(unexplained)
    return Curve(_OVER[kind], places, tuple(values.tolist()), tuple(std.tolist()), unit)


def _moment_unit(unexplained: Unexplained) -> str:
    return "rad/s2" if unexplained.fit.problem.data.normalised else "N m"


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


def events(unexplained: Unexplained, kind: str, precision: float) -> list[dict[str, Any]]:
    """The runs that show what differs from run to run, and when.

    Args:
        unexplained: what is left.
        kind: of `diagnosis.remainder.bases.SINGLE`.
        precision: one over the variance of a coefficient in the prior, in the basis' units.

    Returns:
        By run, largest first: ``run``, its ``share`` of what is closed, and ``from_s`` and ``to_s`` since the start
        of the record, between which four fifths of it lie, in the units of the fit.
    """
    found = []
    for path, columns in zip(unexplained.paths, unexplained.columns(kind), strict=True):
        unit = Unit(path, slice(None))
        part: Normal = normal(
            Rows(np.zeros((path.residual.size, 0)), unit.left(columns), unit.left(path.residual))
        )
        solution = Ridge(part, precision).solution
        energy = (bases.SINGLE[kind](path, unexplained.ranges) @ solution) ** 2
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


_AROUND = 61  # frequencies whose median is the floor beside a line
_MEDIAN = 2.0 * np.log(2.0)  # of χ² with two degrees of freedom
_NYQUIST = 0.45  # of the sample rate: lines above may be images


@dataclass(frozen=True)
class SteadyLine:
    """A line that stands out of the residuals of all runs together.

    Args:
        frequency: Hz.
        frequency_std: its standard deviation, Hz.
        amplitude: in the unit of the reading, root mean square over the runs.
        amplitude_std: its standard deviation, in the same unit.
        evidence: of the kind ``line``.
        events: by run, the largest part first, as `diagnosis.remainder.curve.events`.
    """

    frequency: float
    frequency_std: float
    amplitude: float
    amplitude_std: float
    evidence: Evidence
    events: tuple[Mapping[str, Any], ...]


def steady_line(unexplained: Unexplained) -> SteadyLine | None:
    """The strongest line at one frequency in what a fit leaves, away from the motion and its harmonics.

    Args:
        unexplained: what is left.

    Returns:
        In the units of the fit; None where chance may explain it, at a rate of `PLACE_FALSE_ALARM_RATE` for all
        frequencies together, and where it is the skirt of something broader or does not keep its phase in a run.
    """
    start, floor = _strongest(unexplained)
    if start is None:
        return None
    runs = [path.run for path in unexplained.paths]
    width = 1.0 / max(run.duration for run in runs)
    frequency = float(
        minimize_scalar(
            lambda f: -_drops(unexplained, f).sum(), bounds=(start - width, start + width), method="bounded"
        ).x
    )
    if _steadiness(unexplained, frequency, floor) < LINE_STEADY:
        return None
    drops = _drops(unexplained, frequency)
    whole = float(drops.sum())
    # Cramér–Rao bounds of sinusoids of unknown phase, in the noise beside the line
    sharpness = float(drops @ np.array([run.duration**2 for run in runs]))
    frequency_std = float(np.sqrt(12.0 * floor / sharpness) / (2.0 * np.pi))
    noise = np.array([float(run.noise_at(frequency) / block_gain(frequency, run)) for run in runs])
    sizes = np.array([run.reading.size for run in runs])
    squares = 2.0 * np.maximum(drops - 2.0, 0.0) / sizes * noise**2  # two of the drop are chance
    amplitude = float(np.sqrt(np.mean(squares)))
    return SteadyLine(
        frequency, frequency_std, amplitude, amplitude * float(np.sqrt(floor / whole)),
        _evidence(unexplained, frequency), _events(unexplained, drops),
    )  # fmt: skip


def _strongest(unexplained: Unexplained) -> tuple[float | None, float]:
    """Frequency of the least likely line, Hz, and the power beside it over that of the noise."""
    spectra = smooth_spectra(unexplained.fit)
    longest = max(spectra, key=lambda one: one.duration)
    top = _NYQUIST / max(path.run.interval for path in unexplained.paths)
    grid = longest.frequency[(longest.frequency > 0.0) & (longest.frequency < top)]
    power, count, floors = np.zeros(grid.size), np.zeros(grid.size), np.zeros(grid.size)
    for index, spectrum in enumerate(spectra):
        floor = np.interp(grid, *_floor(spectrum))
        seen = away_from_motion(grid / resonance(unexplained.fit, index))
        power += np.where(seen, spectrum.power(grid) / floor, 0.0)
        count += seen
        floors += np.where(seen, floor, 0.0)
    with np.errstate(divide="ignore"):
        chance = np.where(count > 0, np.log(chdtrc(2.0 * np.maximum(count, 1.0), power)), 0.0)
    best = int(np.argmin(chance))
    clear = power[best] >= LINE_CONTRAST * 2.0 * count[best]
    if not clear or chance[best] + np.log(grid.size) > np.log(PLACE_FALSE_ALARM_RATE):
        return None, 1.0
    return float(grid[best]), float(floors[best] / count[best])


def _floor(spectrum: ResidualSpectrum) -> tuple[Array, Array]:
    """Frequencies, and the median power around each over that of white noise, at least 1."""
    from scipy.ndimage import median_filter  # only here: slow to load

    step = max(1, round(1.0 / (spectrum.duration * spectrum.frequency[1])))  # the padding
    frequency = spectrum.frequency[::step]
    around = median_filter(spectrum.power(frequency), _AROUND, mode="nearest")
    return frequency, np.maximum(around / _MEDIAN, 1.0)


def _waves(path: Path, frequency: float) -> Array:
    """Sine and cosine at the residuals' times, shape (n, 2)."""
    phase = 2.0 * np.pi * frequency * path.time
    return np.column_stack([np.sin(phase), np.cos(phase)])


def _drops(unexplained: Unexplained, frequency: float) -> Array:
    """Drop of χ² when the line is removed, by run, shape (runs,)."""
    found = []
    for path in unexplained.paths:
        waves, residual = _waves(path, frequency), unexplained.fit.residuals[path.index]
        seen = waves.T @ residual
        found.append(float(seen @ np.linalg.solve(waves.T @ waves, seen)))
    return np.array(found)


def _steadiness(unexplained: Unexplained, frequency: float, floor: float) -> float:
    """Share of the line in a half of a run that the other half predicts; 1 where phase and amplitude are kept."""
    predicted, fitted = 0.0, 0.0
    for path in unexplained.paths:
        waves, residual = _waves(path, frequency), unexplained.fit.residuals[path.index]
        first = np.arange(residual.size) < residual.size // 2
        ways = [np.linalg.lstsq(waves[own], residual[own], rcond=None)[0] for own in (first, ~first)]
        for own, mine, other in ((first, *ways), (~first, *ways[::-1])):
            before = float(residual[own] @ residual[own])
            predicted += before - float(np.sum((residual[own] - waves[own] @ other) ** 2)) + 2.0 * floor
            fitted += before - float(np.sum((residual[own] - waves[own] @ mine) ** 2)) - 2.0 * floor
    return predicted / max(fitted, 1e-300)  # chance lowers the one by 2 in every half, and raises the other


def _evidence(unexplained: Unexplained, frequency: float) -> Evidence:
    """Short gaps are predicted from the line around them, as for every kind that differs from run to run."""
    drops, left = [], []
    for path in unexplained.paths:
        waves, residual = _waves(path, frequency), unexplained.fit.residuals[path.index]
        turn = gaps(residual.size, path.group)
        after = 0.0
        for out in (turn == t for t in np.unique(turn)):
            size = np.linalg.lstsq(waves[~out], residual[~out], rcond=None)[0]
            after += float(np.sum((residual[out] - waves[out] @ size) ** 2))
        power = float(residual @ residual)
        drops.append(power - after)
        left.append(power - residual.size)
    return Evidence(Ceiling("line", *ratio(np.array(drops), np.array(left)), GAPS), sum(drops), 0.0)


def _events(unexplained: Unexplained, drops: Array) -> tuple[Mapping[str, Any], ...]:
    """The runs that show it, over their whole time, the largest part first."""
    found = []
    for path, drop in sorted(zip(unexplained.paths, drops.tolist(), strict=True), key=lambda one: -one[1]):
        if drop > LISTED * drops.max():
            first, last = path.time[[0, -1]] + path.run.start
            share = drop / float(drops.sum())
            found.append({"run": path.run.id, "share": share, "from_s": float(first), "to_s": float(last)})
    return tuple(found)
