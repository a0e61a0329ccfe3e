"""A steady line in what is left: one frequency in all runs, with an amplitude and a phase of each run's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import chdtrc

from diagnosis.closable import Ceiling
from diagnosis.fitting.spectra import Spectrum, block_gain, resonance, smooth_spectra
from diagnosis.law.ceiling import GAPS, Evidence, Rest, gaps
from diagnosis.law.curve import LISTED
from diagnosis.law.paths import Path
from diagnosis.law.ridge import ratio
from diagnosis.localisation.lines import away_from_motion
from diagnosis.policy import LINE_CONTRAST, LINE_STEADY, PLACE_FALSE_ALARM_RATE
from tunnel_sim.vocabulary.record import Array

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
        events: by run, the largest part first, as `diagnosis.law.curve.events`.
    """

    frequency: float
    frequency_std: float
    amplitude: float
    amplitude_std: float
    evidence: Evidence
    events: tuple[Mapping[str, Any], ...]


def steady_line(rest: Rest) -> SteadyLine | None:
    """The strongest line at one frequency in what a fit leaves, away from the motion and its harmonics.

    Args:
        rest: what is left.

    Returns:
        In the units of the fit; None where chance may explain it, at a rate of `PLACE_FALSE_ALARM_RATE` for all
        frequencies together, and where it is the skirt of something broader or does not keep its phase in a run.
    """
    start, floor = _strongest(rest)
    if start is None:
        return None
    runs = [path.run for path in rest.paths]
    width = 1.0 / max(run.duration for run in runs)
    frequency = float(
        minimize_scalar(
            lambda f: -_drops(rest, f).sum(), bounds=(start - width, start + width), method="bounded"
        ).x
    )
    if _steadiness(rest, frequency, floor) < LINE_STEADY:
        return None
    drops = _drops(rest, frequency)
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
        _evidence(rest, frequency), _events(rest, drops),
    )  # fmt: skip


def _strongest(rest: Rest) -> tuple[float | None, float]:
    """Frequency of the least likely line, Hz, and the power beside it over that of the noise."""
    spectra = smooth_spectra(rest.fit)
    longest = max(spectra, key=lambda one: one.duration)
    top = _NYQUIST / max(path.run.interval for path in rest.paths)
    grid = longest.frequency[(longest.frequency > 0.0) & (longest.frequency < top)]
    power, count, floors = np.zeros(grid.size), np.zeros(grid.size), np.zeros(grid.size)
    for index, spectrum in enumerate(spectra):
        floor = np.interp(grid, *_floor(spectrum))
        seen = away_from_motion(grid / resonance(rest.fit, index))
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


def _floor(spectrum: Spectrum) -> tuple[Array, Array]:
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


def _drops(rest: Rest, frequency: float) -> Array:
    """Drop of χ² when the line is removed, by run, shape (runs,)."""
    found = []
    for path in rest.paths:
        waves, residual = _waves(path, frequency), rest.fit.residuals[path.index]
        seen = waves.T @ residual
        found.append(float(seen @ np.linalg.solve(waves.T @ waves, seen)))
    return np.array(found)


def _steadiness(rest: Rest, frequency: float, floor: float) -> float:
    """Share of the line in a half of a run that the other half predicts; 1 where phase and amplitude are kept."""
    predicted, fitted = 0.0, 0.0
    for path in rest.paths:
        waves, residual = _waves(path, frequency), rest.fit.residuals[path.index]
        first = np.arange(residual.size) < residual.size // 2
        ways = [np.linalg.lstsq(waves[own], residual[own], rcond=None)[0] for own in (first, ~first)]
        for own, mine, other in ((first, *ways), (~first, *ways[::-1])):
            before = float(residual[own] @ residual[own])
            predicted += before - float(np.sum((residual[own] - waves[own] @ other) ** 2)) + 2.0 * floor
            fitted += before - float(np.sum((residual[own] - waves[own] @ mine) ** 2)) - 2.0 * floor
    return predicted / max(fitted, 1e-300)  # chance lowers the one by 2 in every half, and raises the other


def _evidence(rest: Rest, frequency: float) -> Evidence:
    """Short gaps are predicted from the line around them, as for every kind that differs from run to run."""
    drops, left = [], []
    for path in rest.paths:
        waves, residual = _waves(path, frequency), rest.fit.residuals[path.index]
        turn = gaps(residual.size, path.group)
        after = 0.0
        for out in (turn == t for t in np.unique(turn)):
            size = np.linalg.lstsq(waves[~out], residual[~out], rcond=None)[0]
            after += float(np.sum((residual[out] - waves[out] @ size) ** 2))
        power = float(residual @ residual)
        drops.append(power - after)
        left.append(power - residual.size)
    return Evidence(Ceiling("line", *ratio(np.array(drops), np.array(left)), GAPS), sum(drops), 0.0)


def _events(rest: Rest, drops: Array) -> tuple[Mapping[str, Any], ...]:
    """The runs that show it, over their whole time, the largest part first."""
    found = []
    for path, drop in sorted(zip(rest.paths, drops.tolist(), strict=True), key=lambda one: -one[1]):
        if drop > LISTED * drops.max():
            first, last = path.time[[0, -1]] + path.run.start
            share = drop / float(drops.sum())
            found.append({"run": path.run.id, "share": share, "from_s": float(first), "to_s": float(last)})
    return tuple(found)
