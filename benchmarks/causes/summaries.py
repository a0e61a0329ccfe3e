"""Summary statistics of a campaign for the neural classifier: fixed functions of the records, without any fit of
the project.

They describe the residuals of the nominal model in its weak form (moments.py), for each run by time interval and
harmonic, and for all runs together by cause. Numbers of a large range are compressed by arcsinh or a logarithm.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import savgol_filter

from benchmarks.causes.moments import NAMES, Array, Equations, equations_of, frequency, stiffness
from tunnel_sim.vocabulary.campaign import Campaign, Run

STRETCHES = 8
_HARMONICS = 3
_PER_STRETCH = 3 + 2 * _HARMONICS  # mean, cosine and sine of each harmonic, their residual, the amplitude
_FLOOR = 1e-6


def summaries(campaign: Campaign) -> tuple[Array, Array]:
    """The summary statistics of a campaign.

    Returns:
        Statistics of every run, shape (runs, k), and of all runs together, shape (m,), dimensionless.
    """
    found = equations_of(campaign)
    left, causes = found.residuals()
    springs = np.array([stiffness(run) for run in campaign.runs])
    top = max(max(run.wind_speed for run in campaign.runs), 1e-9)
    resolution = campaign.sensor.resolution or 0.0
    rows = [
        np.concatenate(
            [
                _stretches(found, left, number).ravel(),
                [np.log(springs[number] / np.median(springs)), run.wind_speed / top, float(run.wind_on)],
                _of_reading(run, resolution),
            ]
        )
        for number, run in enumerate(campaign.runs)
    ]
    windy = np.array([run.wind_on for run in campaign.runs])[found.run]
    power = [float(np.mean(left[m] ** 2)) if m.any() else 0.0 for m in (windy, ~windy)]
    circumstances = [
        np.log(float(np.mean(left**2)) + _FLOOR), *np.log1p(power), len(campaign.runs) / 12.0,
        np.unique(springs).size / 3.0, float(np.any(windy)), np.mean(windy),
        float(campaign.sensor.noise_std is not None),
    ]  # fmt: skip
    whole = np.concatenate([circumstances, _by_cause(left, causes)])
    return _finite(np.array(rows)), _finite(whole)


def mirrored(runs: Array) -> Array:
    """The statistics of the runs if the sign of every reading is changed.

    Args:
        runs: statistics from `summaries`, shape (runs, k).
    """
    found = runs.copy()
    sign = np.ones((STRETCHES, _PER_STRETCH))
    sign[:, [0, 3, 4]] = -1.0  # the mean and the second harmonic; half a turn of the phase keeps the others
    found[:, : sign.size] *= sign.ravel()
    found[:, -1] *= -1.0  # the difference of samples at the top and at the bottom
    return found


def _stretches(found: Equations, left: Array, number: int) -> Array:
    """Harmonics of the residual in noise standard deviations by interval of a run, shape (intervals, 9)."""
    own = np.flatnonzero(found.run == number)
    table = np.zeros((STRETCHES, _PER_STRETCH))
    for place, part in enumerate(np.array_split(own, STRETCHES)):
        if part.size < 12:
            continue
        phase, y = found.phase[part], left[part]
        waves = [f(n * phase) for n in range(1, _HARMONICS + 1) for f in (np.cos, np.sin)]
        design = np.column_stack([np.ones(part.size), *waves])
        solved = np.linalg.lstsq(design, y, rcond=1e-6)[0]
        rest = y - design @ solved
        table[place, : solved.size] = np.arcsinh(solved * np.sqrt(0.5 * part.size))
        table[place, -2] = np.log(float(np.mean(rest**2)) + _FLOOR)
        table[place, -1] = float(np.mean(found.level[part]))
    return table


def _of_reading(run: Run, resolution: float) -> Array:
    """Statistics of the reading: lines above the motion and beside it, lattice, ends, time stamps."""
    y, dt = run.record.yaw_rad, run.record.sample_interval
    f0 = frequency(run) / (2.0 * np.pi)
    width = max(2 * round(np.pi * 0.25 / (2.0 * np.pi * f0 * dt)) + 1, 7)
    rough = y - savgol_filter(y, min(width, (y.size - 1) // 2 * 2 + 1), 4)
    noise = max(float(np.std(np.diff(y, 2))) / np.sqrt(6.0), 1e-9)
    high = _line(rough, dt, 4.0 * f0, 1e9)
    low = _line(y - y.mean(), dt, 1.25 * f0, 0.9 / dt)  # beside the motion, its second harmonic included
    levels = np.diff(np.unique(y))
    levels = levels[levels > 2e-7]
    step = float(levels.min()) if levels.size else 0.0
    speed = max(run.wind_speed, 1e-3)
    ends = [float(np.sum(np.abs(y - end) < max(0.6 * step, 1e-7))) for end in (y.max(), y.min())]
    apart = np.diff(run.record.time_s)
    top, bottom = np.log1p(ends)
    return np.array([
        high[0], np.log(high[1] / f0 + 1e-3), np.log(high[1] / 50.0 + 1e-3), low[0], np.log(low[1] / f0 + 1e-3),
        np.log(low[1] / speed + 1e-3) if run.wind_on else 0.0, np.log((step + 1e-7) / (resolution + 1e-7)),
        np.log((step + 1e-7) / noise), np.log(noise / max(float(np.ptp(y)), 1e-9)),
        float(np.std(apart)) / dt, np.log(f0 * dt * y.size), top + bottom, top - bottom,
    ])  # fmt: skip


def _line(values: Array, dt: float, low: float, high: float) -> tuple[float, float]:
    """The largest line between two frequencies, Hz: log of its power over the median, and its frequency, Hz."""
    power = np.abs(np.fft.rfft(values * np.hanning(values.size))) ** 2
    hertz = np.fft.rfftfreq(values.size, dt)
    inside = (hertz > low) & (hertz < high)
    if np.sum(inside) < 8:
        return 0.0, 0.0
    best = int(np.argmax(np.where(inside, power, -1.0)))
    return float(np.log((power[best] + 1e-30) / (np.median(power[inside]) + 1e-30))), float(hertz[best])


def _by_cause(left: Array, causes: dict[str, Array]) -> Array:
    """Shares of the residual that a cause explains alone and beside all others, and both in noise, shape (4 n,)."""
    bases = {}
    for name, columns in causes.items():
        u, size, _ = np.linalg.svd(columns, full_matrices=False)
        bases[name] = u[:, size > 1e-3 * max(float(size[0]), 1e-300)]
    power = float(left @ left) + _FLOOR
    drops = np.zeros((2, len(NAMES)))
    everything = np.column_stack([*bases.values()]) if bases else np.zeros((left.size, 0))
    after = _rest(left, everything)
    owner = np.concatenate([np.full(b.shape[1], NAMES.index(n)) for n, b in bases.items()]) if bases else []
    for place, name in enumerate(NAMES):
        if name in bases:
            drops[0, place] = float(np.sum((bases[name].T @ left) ** 2))
            drops[1, place] = max(_rest(left, everything[:, np.asarray(owner) != place]) - after, 0.0)
    return np.concatenate([np.sqrt(drops / power).ravel(), 0.5 * np.log1p(drops).ravel()])


def _rest(left: Array, columns: Array) -> float:
    """Residual sum of squares after a fit of some columns."""
    rest = left - columns @ np.linalg.lstsq(columns, left, rcond=1e-9)[0] if columns.size else left
    return float(rest @ rest)


def _finite(values: Array) -> Array:
    return np.asarray(np.clip(np.nan_to_num(values, nan=0.0, posinf=50.0, neginf=-50.0), -50.0, 50.0))
