"""What the network sees of a record or a campaign: its rivals and its runs, without units.

Shifts of the quantities are in standard deviations of the nominal fit, amplitudes in units of the noise, times in
periods. Numbers that range over decades are compressed by asinh or the logarithm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.campaign.derivatives import Design, derivatives
from identification.estimate import PARAMETERS
from identification.neural.posterior.demodulated import Demodulated
from identification.neural.posterior.rivals import (
    Mask,
    RivalConditions,
    Rivals,
    RivalWindows,
    campaign_columns,
    fit_rivals,
    record_columns,
)
from tunnel_sim.vocabulary.campaign import Run
from tunnel_sim.vocabulary.record import Array

RECORD_NAMES = ("zeta", "omega_n")
CAMPAIGN_NAMES = PARAMETERS
LEVEL = 2
"""Column of a rival's features: the logarithm of its χ² over the freedom, and a little."""
OWN = 20
"""Features of a run besides the significance of its rivals."""


@dataclass(frozen=True, eq=False)
class Features:
    """Input of the network, and what turns its output into units.

    Args:
        rivals: features of each rival, shape (r, f).
        runs: features of each run, shape (n, k); the last one is 1 with the wind on, else 0.
        shifts: of the quantities under each rival, in standard deviations, shape (r, d); 0 where not determined.
        covariances: of the quantities under each rival, in the same unit, shape (r, d, d).
        valid: shape (r,).
        values: of the quantities by the nominal fit, SI, shape (d,).
        stds: their standard deviations, SI, shape (d,); 1 where not determined.
        known: which quantities are determined, shape (d,).
    """

    rivals: Array
    runs: Array
    shifts: Array
    covariances: Array
    valid: Mask
    values: Array
    stds: Array
    known: Mask


def record_features(runs: Sequence[Demodulated]) -> list[tuple[Features, Rivals] | None]:
    """Features of records, each by itself, for ζ and ωn.

    Returns:
        For each, the features and the fits behind them; None where the windows determine no decay.
    """
    windows = RivalWindows.of(runs)
    nominal = windows.joined([(-windows.time, None), (None, windows.time)])
    columns = record_columns(windows)
    ends = 2 * np.cumsum(windows.sizes)
    return [
        _record(run, nominal[a:b], columns[a:b])
        for run, a, b in zip(runs, ends - 2 * windows.sizes, ends, strict=True)
    ]


def _record(run: Demodulated, nominal: Array, columns: Array) -> tuple[Features, Rivals] | None:
    values = np.concatenate((run.logarithm, run.phase))
    found = _fit([run], values, nominal, columns)
    if found is None:
        return None
    rate, omega = run.rate + found.parameters[0], run.omega + found.parameters[1]
    natural = float(np.hypot(rate, omega))
    jacobian = np.array([[omega**2, -rate * omega], [rate * natural**2, omega * natural**2]]) / natural**3
    moved = np.array([[rate, omega]]) + found.shifts
    sizes = np.hypot(moved[:, 0], moved[:, 1])
    moved = np.column_stack((moved[:, 0] / sizes, sizes))
    own = _run_features(run, found, 0.0, np.zeros(2), 0.0)
    return _features(found, moved, jacobian, np.ones(2, dtype=bool), own[None]), found


def campaign_features(
    runs: Sequence[Run],
    seen: Sequence[Demodulated],
    design: Design,
    alone: Sequence[Rivals],
) -> Features | None:
    """Features of a campaign, for Cnβ, Cnr, Izz and Cr.

    Args:
        runs: those that the design links, each with its stiffness.
        seen: windows of the runs.
        alone: the rivals of each run by itself.

    Returns:
        The features; None where the runs determine no coefficient.
    """
    nominal = _campaign_design(seen, design)
    first = _fit(seen, *nominal, np.zeros((nominal[0].size, 0)))
    if first is None:
        return None
    start = derivatives(design, first.parameters)
    air = (start.get("cn_beta") or 0.0, start.get("cn_r") or 0.0)
    columns = campaign_columns(RivalWindows.of(seen), _conditions(runs, design, air))
    found = _fit(seen, *nominal, columns)
    if found is None or not start.names:
        return None
    known = np.array([name in start.names for name in CAMPAIGN_NAMES])
    moved = np.zeros((len(found.shifts), len(CAMPAIGN_NAMES)))
    for place, shift in enumerate(found.shifts):
        under = derivatives(design, found.parameters + shift)
        if under.names:
            moved[place, known] = under.values
        else:
            moved[place, known] = start.values + start.jacobian @ shift
            found.valid[place] = False
    jacobian = np.zeros((len(CAMPAIGN_NAMES), design.size))
    jacobian[known] = start.jacobian
    fastest = max(run.wind_speed for run in runs)
    rows = []
    for run, windows, one, link in zip(runs, seen, alone, design.links, strict=True):
        own = np.array([windows.rate, windows.omega]) + one.parameters
        rate, stiffness = link @ found.parameters
        gap = own - np.array([rate, np.sqrt(max(stiffness - rate**2, 0.0))])
        away = gap / np.sqrt(np.diag(one.covariances[0]))
        rows.append(_run_features(windows, one, run.wind_speed / max(fastest, 1e-300), away, 1.0))
    return _features(found, moved, jacobian, known, np.array(rows))


def _campaign_design(windows: Sequence[Demodulated], design: Design) -> tuple[Array, Array]:
    """Data and columns of the shared parameters: the windows' own decays are added to their deviations."""
    values, blocks = [], []
    for run, link in zip(windows, design.links, strict=True):
        half = run.time / (2.0 * run.omega)
        stiffness = run.omega**2 + run.rate**2
        values += [run.logarithm - run.rate * run.time, run.phase + half * (stiffness - 2.0 * run.rate**2)]
        blocks += [np.outer(-run.time, link[0]), np.outer(half, link[1] - 2.0 * run.rate * link[0])]
    return np.concatenate(values), np.concatenate(blocks)


def _conditions(runs: Sequence[Run], design: Design, air: tuple[float, float]) -> RivalConditions:
    springs = np.array([run.spring_stiffness for run in runs], dtype=np.float64)
    speeds = np.array([run.wind_speed for run in runs])
    return RivalConditions(
        springs,
        design.stiffness_loads,
        design.damping_loads,
        speeds / max(float(speeds.max()), 1e-300),
        np.unique(springs, return_inverse=True)[1],
        air,
    )


def _fit(windows: Sequence[Demodulated], values: Array, design: Array, columns: Array) -> Rivals | None:
    """Eliminate a level of envelope and phase for every run, then fit the rivals."""
    table = np.column_stack((values, design, columns))
    weights, place = [], 0
    for run in windows:
        share = run.information / run.information.sum()
        for _ in range(2):
            rows = slice(place, place + run.time.size)
            table[rows] -= share @ table[rows]
            weights.append(run.information)
            place += run.time.size
    ends = np.cumsum([1, design.shape[1]])
    return fit_rivals(
        table[:, 0], table[:, 1 : ends[1]], table[:, ends[1] :], np.concatenate(weights), 2 * len(windows)
    )


def _features(found: Rivals, moved: Array, jacobian: Array, known: Mask, runs: Array) -> Features:
    covariances = jacobian @ found.covariances @ jacobian.T
    variances = np.where(known, np.diag(covariances[0]), 1.0)
    stds = np.sqrt(np.maximum(variances, 1e-300))
    shifts = np.where(known, (moved - moved[0]) / stds, 0.0)
    covariances = covariances / np.outer(stds, stds)
    widths = np.sqrt(np.maximum(np.diagonal(covariances, axis1=1, axis2=2), 1e-12))
    level = np.log(found.remaining / found.freedom + 0.05)
    rivals = np.column_stack(
        (
            np.arcsinh(found.scores),
            np.log(found.own + 1e-6),
            level,
            level - level.min(),
            np.arcsinh(shifts),
            np.where(known, np.log(np.minimum(widths, 1e6)), 0.0),
        )
    )
    rivals[~found.valid] = 0.0
    shifts[~found.valid] = 0.0
    return Features(
        rivals, runs, shifts, covariances, found.valid, np.where(known, moved[0], 0.0), stds, known
    )


def _run_features(run: Demodulated, alone: Rivals, speed: float, away: Array, linked: float) -> Array:
    """The run by itself; ``away`` is how far its own decay lies from that of the campaign."""
    weight = np.sqrt(run.samples) / run.noise
    zero_time = _slope(run.zero, run.time, weight)
    zero_size = _slope(run.zero, run.amplitude**2, weight)
    root = np.sqrt(run.information)
    size = run.amplitude / run.amplitude[0]
    harmonics: list[float] = []
    # A sensor mounted the other way round changes the sign of the zero and of the second harmonic: it is left out.
    for harmonic, power, fold in ((run.second, 1.0, abs), (run.third, 2.0, float)):
        pattern = root * size**power
        level = pattern @ (root * harmonic) / np.sqrt(pattern @ pattern)
        spread = float(np.mean(np.abs(root * harmonic) ** 2))
        harmonics += [fold(np.arcsinh(level.real)), fold(np.arcsinh(level.imag)), np.log(0.5 * spread + 0.05)]
    centred = (run.zero - float(np.average(run.zero, weights=weight**2))) * weight
    remaining = np.log(alone.remaining / alone.freedom + 0.05)
    own = [
        abs(float(np.arcsinh(zero_time))),
        abs(float(np.arcsinh(zero_size))),
        float(np.log(np.mean(centred**2) + 0.05)),
        *harmonics,
        float(remaining[0]),
        float(remaining[-2]),
        float(np.log(run.fast_noise + 1e-2)),
        float(np.log(run.omega * run.time[-1])),
        float(np.log(run.information.sum())),
        float(run.rate * run.time[-1]),
        *np.arcsinh(away),
        linked,
        speed,
        float(speed > 0.0),
    ]
    assert len(own) == OWN
    return np.concatenate((np.arcsinh(alone.scores[1:]), own))


def _slope(values: Array, against: Array, weight: Array) -> float:
    """Significance of a slope."""
    share = weight**2 / float(weight @ weight)
    x = against - share @ against
    return float((weight * x) @ (weight * (values - share @ values)) / np.sqrt((weight * x) @ (weight * x)))
