"""The network's view of a record or a campaign: rival linear models of its windows, beside the nominal model.

Averaged over a cycle, a moment changes the decay rate or the frequency by a power of the amplitude. A rival is one
such power, with a factor for its dependence on spring, wind and frequency; or a change of the reading with the
amplitude; or an exact change of a stated number, to first order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.campaign.derivatives import Design, derivatives
from identification.estimate import PARAMETERS
from identification.neural.demodulated import Column, Demodulated, Places, RivalWindows
from identification.statistics import determined, inverse, scaled_solve
from tunnel_sim.vocabulary.campaign import Run
from tunnel_sim.vocabulary.record import Array

Mask = NDArray[np.bool_]

_ANY = (-1.0, -0.5, 0.5, 1.0, 2.0, 4.0)  # every exponent except the linear one
_OFFSETS = (0.0, -0.35)  # powers of the speed in an error of the speed
_LAGS = (-0.3, 0.2, 0.8)  # lags of the air's moment, in l/V
SPRINGS = 4
"""Number of different springs, from the softest, with a separate rival each."""


@dataclass(frozen=True, eq=False)
class RivalConditions:
    """The stated conditions of the runs, and the coefficients of their nominal fit.

    Args:
        stiffness: Kr, shape (runs,), N m/rad.
        stiffness_load: ½ρV²·A·l, shape (runs,), N m; 0 with the wind off.
        damping_load: ½ρV·A·l², shape (runs,), N m s; 0 with the wind off.
        speed: V as a ratio to the largest of the campaign, shape (runs,); 0 with the wind off.
        spring: index of the spring in the campaign, from the softest, shape (runs,).
        air: Cnβ and Cnr of the nominal fit, 1/rad; 0 where they are not determined.
    """

    stiffness: Array
    stiffness_load: Array
    damping_load: Array
    speed: Array
    spring: Places
    air: tuple[float, float]

    @classmethod
    def of(cls, runs: Sequence[Run], design: Design, air: tuple[float, float]) -> RivalConditions:
        """Conditions of the runs that the design links, each with its spring."""
        springs = np.array([run.spring_stiffness for run in runs], dtype=np.float64)
        speeds = np.array([run.wind_speed for run in runs])
        speeds = speeds / max(float(speeds.max()), 1e-300)
        places = np.unique(springs, return_inverse=True)[1]
        return cls(springs, design.stiffness_loads, design.damping_loads, speeds, places, air)


def _readings(w: RivalWindows) -> list[Column]:
    """A reading with an amplitude or phase that depends on the amplitude."""
    logarithms = [(w.powers[power], None) for power in (-1.0, 2.0, 4.0)]
    return [*logarithms, *((None, w.powers[power]) for power in (-1.0, 2.0))]


def _drifts_and_steps(w: RivalWindows, stiffness: Array | float) -> list[Column]:
    """A spring or a damper that changes along the run, and steps at the instants that fit the runs best."""
    turning = (stiffness / w.omega)[w.run]
    phase = np.concatenate([best_step(run, run.phase) for run in w.runs]) * w.omega[w.run]
    size = np.concatenate([best_step(run, run.logarithm) for run in w.runs])
    return [
        (None, turning * w.drift),
        (None, turning * w.settling),
        (-w.drift, None),
        (None, phase),
        (size, None),
    ]


def campaign_columns(w: RivalWindows, c: RivalConditions) -> Array:
    """The columns of the rivals of a campaign, shape (2 w, 51)."""
    constant, ones = np.ones_like(c.stiffness), np.ones(w.time.size)
    on = c.speed > 0.0
    damped = [
        *((power, w.omega**power) for power in (-1.0, -0.5, 0.5, 1.0, 2.0)),
        *((power, c.stiffness / w.omega) for power in (-1.0, 0.0, 1.0)),
        *((power, c.damping_load) for power in (-1.0, 1.0, 2.0, 4.0)),
        (0.0, c.stiffness_load),
        (0.0, on.astype(np.float64)),
    ]
    stiff = [
        *((power, c.stiffness) for power in _ANY),
        *((power, constant) for power in (-1.0, 0.0, 2.0)),
        *((power, c.stiffness_load) for power in (-1.0, 1.0, 2.0, 4.0)),
        (0.0, c.stiffness**2),
        (0.0, c.stiffness * c.stiffness_load),
        *((0.0, c.stiffness * (c.spring == number)) for number in range(SPRINGS)),
    ]
    # A wind speed that drifts or differs from its statement, and an air moment that lags the motion.
    speed = np.where(on, c.speed, 1.0)
    drag, turning = 0.5 * c.air[1] * c.damping_load, -c.air[0] * c.stiffness_load / w.omega
    wind = [
        ((drag * speed ** (power - 1.0))[w.run] * w.time, (turning * speed ** (power - 1.0))[w.run] * w.time)
        for power in _OFFSETS
    ]
    load = 0.5 * c.air[0] * c.stiffness_load / w.omega
    delay = np.divide(c.damping_load, c.stiffness_load, out=np.zeros_like(speed), where=on)  # l/V
    for lag in _LAGS:
        response = 1.0 / (1.0 + lag * delay * (1j * w.omega - w.rate)) - 1.0
        wind.append(((load * response.imag)[w.run] * w.time, (-load * response.real)[w.run] * w.time))
    wind += [(drag[w.run] * total * ones, turning[w.run] * total) for total in (w.drift, w.settling)]
    return w.joined(
        [
            *((-factor[w.run] * w.integrals[power], None) for power, factor in damped),
            *((None, (factor / w.omega)[w.run] * w.integrals[power]) for power, factor in stiff),
            *wind,
            *_readings(w),
            *_drifts_and_steps(w, c.stiffness),
        ]
    )


def best_step(run: Demodulated, values: Array) -> Array:
    """The step, from 0 to 1, added to a straight line, that lowers χ² most, shape (w,).

    Args:
        values: logarithm or phase, shape (w,), dimensionless.
    """
    weight, time = run.information, run.time - run.time[-1]
    # Sums over the windows from each one to the last: every step, and its products with the line and the values.
    terms = np.stack((weight, weight * time, weight * time**2, weight * values, weight * time * values))
    sums = np.cumsum(terms[:, ::-1], axis=1)[:, ::-1]
    (a, b, c, d, e), (level, slope) = sums[:, 0], (sums[0, 1:], sums[1, 1:])
    determinant = a * c - b * b
    own = level - (c * level**2 - 2.0 * b * level * slope + a * slope**2) / determinant
    aim = sums[3, 1:] - (level * (c * d - b * e) + slope * (a * e - b * d)) / determinant
    best = int(np.argmax(aim**2 / np.maximum(own, 1e-6 * a)))
    return np.asarray((np.arange(time.size) > best).astype(np.float64))


SETS = (2, 3, 4)
"""Numbers of columns in the larger rivals, found by forward selection; one more rival has all columns."""
MORE = len(SETS) + 2
"""Rivals in addition to those with one column: the nominal model first; the sets and all columns together last."""
_PRIOR = 1e-6  # variance of a column's own fit over the prior variance of its effect: 1000 deviations
_PRIOR_ALL = 1e-3  # the same ratio where all columns act together


@dataclass(frozen=True, eq=False)
class Rivals:
    """The nominal model and its rivals, nominal first.

    Args:
        parameters: parameters of the nominal model, shape (p,).
        shifts: contribution of each rival to them, shape (r, p).
        covariances: covariance of the parameters under each rival, shape (r, p, p).
        scores: signed significance of a rival's column, shape (r,); for a set, the root of its fall of χ².
        own: share of a column that the nominal parameters cannot imitate, shape (r,).
        remaining: χ² of each rival, shape (r,).
        freedom: number of values less number of nominal unknowns.
    """

    parameters: Array
    shifts: Array
    covariances: Array
    scores: Array
    own: Array
    remaining: Array
    freedom: int
    valid: Mask


def fit_rivals(values: Array, design: Array, columns: Array, weights: Array, taken: int) -> Rivals | None:
    """Fit the nominal model and every rival; None where the data do not determine the nominal parameters.

    A weak normal prior on every column keeps the parameters finite if the column is nearly a combination of the
    nominal columns.

    Args:
        values: data, shape (n,).
        design: columns of the nominal parameters, shape (n, p).
        columns: columns of the rivals, shape (n, c); zero where a rival does not apply.
        weights: inverse variances, shape (n,).
        taken: number of unknowns eliminated beforehand.
    """
    root = np.sqrt(weights)
    nominal, scaled = design * root[:, None], columns * root[:, None]
    normal = nominal.T @ nominal
    if not determined(normal):
        return None
    covariance = inverse(normal)
    parameters = scaled_solve(normal, nominal.T @ (root * values))
    rest = root * values - nominal @ parameters
    full = np.einsum("nc,nc->c", scaled, scaled)
    valid = full > 0.0
    scaled = scaled / np.sqrt(np.where(valid, full, 1.0))
    moves = covariance @ (nominal.T @ scaled)  # (p, c): shift of the parameters by each column
    own = scaled - nominal @ moves
    gram, aim = own.T @ own, own.T @ rest
    alone = np.diag(gram).copy()
    sizes = aim / (alone + _PRIOR)
    scores = aim / np.sqrt(alone + _PRIOR)
    total = float(rest @ rest)
    shifts, covariances = [np.zeros(parameters.size)], [covariance]
    shifts += list((-moves * sizes).T)
    outer = moves.T[:, :, None] * moves.T[:, None, :]
    covariances += list(covariance + outer / (alone + _PRIOR)[:, None, None])
    fallen, remaining = [0.0, *scores], [total, *(total - scores**2)]
    places = forward_selection(gram, aim, max(SETS))
    sets = [(np.array(places[:number], dtype=np.intp), _PRIOR) for number in SETS]
    for chosen, prior in [*sets, (np.flatnonzero(valid), _PRIOR_ALL)]:
        inner = gram[np.ix_(chosen, chosen)] + prior * np.eye(chosen.size)
        solved = np.linalg.solve(inner, np.column_stack((aim[chosen], moves[:, chosen].T)))
        shifts.append(-moves[:, chosen] @ solved[:, 0])
        covariances.append(covariance + moves[:, chosen] @ solved[:, 1:])
        fall = float(aim[chosen] @ solved[:, 0])
        fallen.append(float(np.sqrt(max(fall, 0.0))))
        remaining.append(total - fall)
    return Rivals(
        parameters,
        np.array(shifts),
        np.array(covariances),
        np.array(fallen),
        np.concatenate(([1.0], alone, np.ones(len(SETS) + 1))),
        np.maximum(np.array(remaining), 0.0),
        values.size - taken - parameters.size,
        np.concatenate(([True], valid, np.ones(len(SETS) + 1, dtype=bool))),
    )


def forward_selection(gram: Array, aim: Array, number: int) -> list[int]:
    """Forward selection of a number of columns: each lowers χ² most in addition to the previous ones.

    Args:
        gram: products of the columns, shape (c, c).
        aim: products of the columns with the data, shape (c,).
    """
    rest, own = aim.copy(), np.diag(gram).copy()
    gram = gram.copy()
    chosen: list[int] = []
    for _ in range(min(number, aim.size)):
        gain = rest**2 / (own + _PRIOR)
        gain[chosen] = -1.0
        best = int(np.argmax(gain))
        chosen.append(best)
        share = gram[:, best] / (own[best] + _PRIOR)
        rest = rest - share * rest[best]
        gram = gram - np.outer(share, gram[best])
        own = np.maximum(np.diag(gram), 0.0)
    return chosen


RECORD_NAMES = ("zeta", "omega_n")
CAMPAIGN_NAMES = PARAMETERS
LEVEL = 2
"""Column of a rival's features: the logarithm of its χ² over the freedom, plus a small constant."""
OWN = 20
"""Features of a run in addition to the significance of its rivals."""


@dataclass(frozen=True, eq=False)
class Features:
    """Input of the network, without units, and the scales of its output.

    Shifts of the quantities are in standard deviations of the nominal fit, amplitudes in units of the noise,
    times in periods. Numbers that range over decades are compressed by asinh or the logarithm.

    Args:
        rivals: features of each rival, shape (r, f).
        runs: features of each run, shape (n, k); the last one is 1 with the wind on, else 0.
        shifts: shifts of the quantities under each rival, in standard deviations, shape (r, d); 0 where not
            determined.
        covariances: covariances of the quantities under each rival, in the same unit, shape (r, d, d).
        values: values of the quantities in the nominal fit, SI, shape (d,).
        stds: standard deviations of the values, SI, shape (d,); 1 where not determined.
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
    """Features of single records, for ζ and ωn, and the fits behind them.

    Returns:
        For each record; None where the windows do not determine a decay.
    """
    windows = RivalWindows.of(runs)
    nominal = windows.joined([(-windows.time, None), (None, windows.time)])
    free: list[Column] = [(-windows.integrals[power], None) for power in _ANY]
    free += [(None, windows.integrals[power]) for power in _ANY]
    columns = windows.joined([*free, *_readings(windows), *_drifts_and_steps(windows, 1.0)])
    ends = 2 * np.cumsum(windows.sizes)
    pairs: list[tuple[Features, Rivals] | None] = []
    for run, a, b in zip(runs, ends - 2 * windows.sizes, ends, strict=True):
        fitted = _fit([run], np.concatenate((run.logarithm, run.phase)), nominal[a:b], columns[a:b])
        if fitted is None:
            pairs.append(None)
            continue
        rate, omega = run.rate + fitted.parameters[0], run.omega + fitted.parameters[1]
        natural = float(np.hypot(rate, omega))
        jacobian = np.array([[omega**2, -rate * omega], [rate * natural**2, omega * natural**2]]) / natural**3
        moved = np.array([[rate, omega]]) + fitted.shifts
        sizes = np.hypot(moved[:, 0], moved[:, 1])
        moved = np.column_stack((moved[:, 0] / sizes, sizes))
        own = _run_features(run, fitted, 0.0, np.zeros(2), 0.0)
        pairs.append((_features(fitted, moved, jacobian, np.ones(2, dtype=bool), own[None]), fitted))
    return pairs


def campaign_features(
    runs: Sequence[Run], decays: Sequence[Demodulated], design: Design, alone: Sequence[Rivals]
) -> Features | None:
    """Features of a campaign, for Cnβ, Cnr, Izz and Cr; None if the runs do not determine any coefficient."""
    # The windows' own decays are added to their deviations.
    parts, blocks = [], []
    for decay, link in zip(decays, design.links, strict=True):
        half = decay.time / (2.0 * decay.omega)
        stiffness = decay.omega**2 + decay.rate**2
        parts += [
            decay.logarithm - decay.rate * decay.time,
            decay.phase + half * (stiffness - 2.0 * decay.rate**2),
        ]
        blocks += [np.outer(-decay.time, link[0]), np.outer(half, link[1] - 2.0 * decay.rate * link[0])]
    values, shared = np.concatenate(parts), np.concatenate(blocks)
    first = _fit(decays, values, shared, np.zeros((values.size, 0)))
    if first is None:
        return None
    start = derivatives(design, first.parameters)
    air = (start.get("cn_beta") or 0.0, start.get("cn_r") or 0.0)
    columns = campaign_columns(RivalWindows.of(decays), RivalConditions.of(runs, design, air))
    fitted = _fit(decays, values, shared, columns)
    if fitted is None or not start.names:
        return None
    known = np.array([name in start.names for name in CAMPAIGN_NAMES])
    moved = np.zeros((len(fitted.shifts), len(CAMPAIGN_NAMES)))
    for place, shift in enumerate(fitted.shifts):
        under = derivatives(design, fitted.parameters + shift)
        if under.names:
            moved[place, known] = under.values
        else:
            moved[place, known] = start.values + start.jacobian @ shift
            fitted.valid[place] = False
    jacobian = np.zeros((len(CAMPAIGN_NAMES), design.size))
    jacobian[known] = start.jacobian
    fastest = max(run.wind_speed for run in runs)
    rows = []
    for run, decay, rivals, link in zip(runs, decays, alone, design.links, strict=True):
        own = np.array([decay.rate, decay.omega]) + rivals.parameters
        rate, stiffness = link @ fitted.parameters
        gap = own - np.array([rate, np.sqrt(max(stiffness - rate**2, 0.0))])
        away = gap / np.sqrt(np.diag(rivals.covariances[0]))
        rows.append(_run_features(decay, rivals, run.wind_speed / max(fastest, 1e-300), away, 1.0))
    return _features(fitted, moved, jacobian, known, np.array(rows))


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
    values, design, columns = np.split(table, [1, 1 + design.shape[1]], axis=1)
    return fit_rivals(values[:, 0], design, columns, np.concatenate(weights), 2 * len(windows))


def _features(fitted: Rivals, moved: Array, jacobian: Array, known: Mask, runs: Array) -> Features:
    covariances = jacobian @ fitted.covariances @ jacobian.T
    variances = np.where(known, np.diag(covariances[0]), 1.0)
    stds = np.sqrt(np.maximum(variances, 1e-300))
    shifts = np.where(known, (moved - moved[0]) / stds, 0.0)
    covariances = covariances / np.outer(stds, stds)
    widths = np.sqrt(np.maximum(np.diagonal(covariances, axis1=1, axis2=2), 1e-12))
    level = np.log(fitted.remaining / fitted.freedom + 0.05)
    rivals = np.column_stack(
        (
            np.arcsinh(fitted.scores),
            np.log(fitted.own + 1e-6),
            level,
            level - level.min(),
            np.arcsinh(shifts),
            np.where(known, np.log(np.minimum(widths, 1e6)), 0.0),
        )
    )
    rivals[~fitted.valid] = 0.0
    shifts[~fitted.valid] = 0.0
    return Features(
        rivals, runs, shifts, covariances, fitted.valid, np.where(known, moved[0], 0.0), stds, known
    )


def _run_features(run: Demodulated, alone: Rivals, speed: float, away: Array, linked: float) -> Array:
    """The features of a run by itself; ``away`` is the difference of its decay from the campaign's."""
    weight = np.sqrt(run.samples) / run.noise
    zero_time = _slope(run.zero, run.time, weight)
    zero_size = _slope(run.zero, run.amplitude**2, weight)
    root = np.sqrt(run.information)
    size = run.amplitude / run.amplitude[0]
    harmonics: list[float] = []
    # The sign of the zero and of the second harmonic depends on the mounting of the sensor: it is left out.
    for harmonic, power, fold in ((run.second, 1.0, abs), (run.third, 2.0, float)):
        pattern = root * size**power
        level = pattern @ (root * harmonic) / np.sqrt(pattern @ pattern)
        spread = float(np.mean(np.abs(root * harmonic) ** 2))
        harmonics += [fold(np.arcsinh(level.real)), fold(np.arcsinh(level.imag)), np.log(0.5 * spread + 0.05)]
    centred = (run.zero - float(np.average(run.zero, weights=weight**2))) * weight
    remaining = np.log(alone.remaining / alone.freedom + 0.05)
    features = [
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
    assert len(features) == OWN
    return np.concatenate((np.arcsinh(alone.scores[1:]), features))


def _slope(values: Array, against: Array, weight: Array) -> float:
    """Significance of a slope."""
    share = weight**2 / float(weight @ weight)
    x = against - share @ against
    return float((weight * x) @ (weight * (values - share @ values)) / np.sqrt((weight * x) @ (weight * x)))
