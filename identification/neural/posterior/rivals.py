"""Rival linear models of the windows: the nominal model and, beside it, each of many shapes, by least squares.

A rival acts on envelope and phase of the windows to first order in its size. By averaging over a
cycle, a moment changes the decay rate or the frequency by an amount that depends on the amplitude as a power. A
rival is such a power with a factor that says how it depends on spring, wind and frequency, a change of the reading
that depends on the amplitude, or an exact change of a stated number. All windows of all runs are treated in one
array.

A rival adds one column to the nominal model. It shifts the parameters by an amount in closed form and lowers χ² by
another. Sets of two to four columns come from forward selection. A weak normal prior on every column keeps the
parameters finite where a column is nearly a combination of the nominal ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.neural.posterior.demodulated import Demodulated
from identification.statistics import determined, inverse, scaled_solve
from tunnel_sim.vocabulary.record import Array

Places = NDArray[np.intp]

_FLOOR = 0.02  # least amplitude over the first: smaller ones would make inverse powers of noise
_POWERS = (-1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0)
_ANY = (-1.0, -0.5, 0.5, 1.0, 2.0, 4.0)  # all but the linear one
_OFFSETS = (0.0, -0.35)  # powers of the speed in an error of the speed
_LAGS = (-0.3, 0.2, 0.8)  # of the air's moment, l/V
_SETTLING = 4.0  # time constants in a record
SPRINGS = 4
"""Number of different springs, from the softest, that each have a rival of their own."""


@dataclass(frozen=True, eq=False)
class RivalConditions:
    """What is stated of the runs, and what the nominal model makes of them.

    Args:
        stiffness: Kr, shape (runs,), N m/rad.
        stiffness_load: ½ρV²·A·l, shape (runs,), N m; 0 with the wind off.
        damping_load: ½ρV·A·l², shape (runs,), N m s; 0 with the wind off.
        speed: V as a ratio to the largest of the campaign, shape (runs,); 0 with the wind off.
        spring: number of the spring among those of the campaign, from the softest, shape (runs,).
        air: Cnβ and Cnr of the nominal fit, 1/rad; 0 where there are none.
    """

    stiffness: Array
    stiffness_load: Array
    damping_load: Array
    speed: Array
    spring: Places
    air: tuple[float, float]


@dataclass(frozen=True, eq=False)
class RivalWindows:
    """The windows of all runs, one after the other.

    Args:
        sizes: number of windows of each run, shape (runs,).
        run: number of each window's run, shape (w,).
        omega: angular frequency of each run, shape (runs,), rad/s.
        rate: decay rate of each run, shape (runs,), 1/s.
        time: shape (w,), s.
        powers: of the amplitude, by exponent, shape (w,) each.
        integrals: of these powers over time, by exponent, shape (w,) each.
        drift: integral of the time as a share of the record, shape (w,), s.
        settling: integral of a step that settles, shape (w,), s.
    """

    runs: Sequence[Demodulated]
    sizes: Places
    run: Places
    omega: Array
    rate: Array
    time: Array
    powers: dict[float, Array]
    integrals: dict[float, Array]
    drift: Array
    settling: Array

    @classmethod
    def of(cls, runs: Sequence[Demodulated]) -> RivalWindows:
        """Integrals over time, from each run's first window, by the trapezium rule."""
        sizes = np.array([run.time.size for run in runs])
        place = np.repeat(np.arange(len(runs)), sizes)
        time = np.concatenate([run.time for run in runs])
        first = np.array([run.amplitude[0] for run in runs])[place]
        relative = np.concatenate([run.amplitude for run in runs]) / first
        amplitude = first * np.maximum(relative, _FLOOR)
        share = time / np.array([run.duration for run in runs])[place]
        begins = np.concatenate(([0], np.cumsum(sizes)[:-1]))
        steps = np.diff(time, prepend=0.0)
        steps[begins] = 0.0
        table = np.stack([*(amplitude**power for power in _POWERS), share, 1.0 - np.exp(-_SETTLING * share)])
        before = np.concatenate((table[:, :1], table[:, :-1]), axis=1)
        total = np.cumsum(0.5 * steps * (table + before), axis=1)
        total = total - total[:, begins][:, place]
        return cls(
            runs,
            sizes,
            place,
            np.array([run.omega for run in runs]),
            np.array([run.rate for run in runs]),
            time,
            dict(zip(_POWERS, table, strict=False)),
            dict(zip(_POWERS, total, strict=False)),
            total[-2],
            total[-1],
        )

    def stacked(self, logarithms: Sequence[Array], phases: Sequence[Array]) -> Array:
        """Columns of the logarithm alone and of the phase alone, run by run: shape (2 w, columns)."""
        return self.joined([*((one, None) for one in logarithms), *((None, other) for other in phases)])

    def joined(self, columns: Sequence[tuple[Array | None, Array | None]]) -> Array:
        """Columns of logarithm and phase; within a run the logarithms of its windows come first."""
        table = np.zeros((2, self.time.size, len(columns)))
        for place, pair in enumerate(columns):
            for channel, values in enumerate(pair):
                if values is not None:
                    table[channel, :, place] = values
        ends = np.cumsum(self.sizes)
        order = np.concatenate(
            [
                np.concatenate((np.arange(a, b), self.time.size + np.arange(a, b)))
                for a, b in zip(ends - self.sizes, ends, strict=True)
            ]
        )
        return np.asarray(table.reshape(2 * self.time.size, -1)[order])


def _readings(w: RivalWindows) -> list[tuple[Array | None, Array | None]]:
    """A reading whose amplitude or phase depends on the amplitude."""
    logarithms = [(w.powers[power], None) for power in (-1.0, 2.0, 4.0)]
    return [*logarithms, *((None, w.powers[power]) for power in (-1.0, 2.0))]


def _drifts_and_steps(w: RivalWindows, stiffness: Array | float) -> list[tuple[Array | None, Array | None]]:
    """A spring or a damper that changes along the run, and steps at the instants where the runs show them best."""
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


def record_columns(w: RivalWindows) -> Array:
    """The columns of the rivals of records by themselves, shape (2 w, 22)."""
    free: list[tuple[Array | None, Array | None]] = [(-w.integrals[power], None) for power in _ANY]
    free += [(None, w.integrals[power]) for power in _ANY]
    return w.joined([*free, *_readings(w), *_drifts_and_steps(w, 1.0)])


def campaign_columns(w: RivalWindows, c: RivalConditions) -> Array:
    """The columns of the rivals of a campaign, shape (2 w, 51)."""
    one = np.ones_like(c.stiffness)
    on = (c.speed > 0.0).astype(np.float64)
    damped = [
        *((power, w.omega**power) for power in (-1.0, -0.5, 0.5, 1.0, 2.0)),
        *((power, c.stiffness / w.omega) for power in (-1.0, 0.0, 1.0)),
        *((power, c.damping_load) for power in (-1.0, 1.0, 2.0, 4.0)),
        (0.0, c.stiffness_load),
        (0.0, on),
    ]
    stiff = [
        *((power, c.stiffness) for power in _ANY),
        *((power, one) for power in (-1.0, 0.0, 2.0)),
        *((power, c.stiffness_load) for power in (-1.0, 1.0, 2.0, 4.0)),
        (0.0, c.stiffness**2),
        (0.0, c.stiffness * c.stiffness_load),
        *((0.0, c.stiffness * (c.spring == number)) for number in range(SPRINGS)),
    ]
    return w.joined(
        [
            *((-factor[w.run] * w.integrals[power], None) for power, factor in damped),
            *((None, (factor / w.omega)[w.run] * w.integrals[power]) for power, factor in stiff),
            *_wind(w, c),
            *_readings(w),
            *_drifts_and_steps(w, c.stiffness),
        ]
    )


def _wind(w: RivalWindows, c: RivalConditions) -> list[tuple[Array, Array]]:
    """A wind speed that is not as stated or drifts, and an air moment behind the motion."""
    on = c.speed > 0.0
    speed, ones = np.where(on, c.speed, 1.0), np.ones(w.time.size)
    drag, turning = 0.5 * c.air[1] * c.damping_load, -c.air[0] * c.stiffness_load / w.omega
    found = [
        ((drag * speed ** (power - 1.0))[w.run] * w.time, (turning * speed ** (power - 1.0))[w.run] * w.time)
        for power in _OFFSETS
    ]
    load = 0.5 * c.air[0] * c.stiffness_load / w.omega
    delay = np.divide(c.damping_load, c.stiffness_load, out=np.zeros_like(speed), where=on)  # l/V
    for lag in _LAGS:
        response = 1.0 / (1.0 + lag * delay * (1j * w.omega - w.rate)) - 1.0
        found.append(((load * response.imag)[w.run] * w.time, (-load * response.real)[w.run] * w.time))
    return found + [(drag[w.run] * total * ones, turning[w.run] * total) for total in (w.drift, w.settling)]


def best_step(run: Demodulated, values: Array) -> Array:
    """The step, from 0 to 1, beside a straight line, that lowers χ² most.

    Args:
        values: logarithm or phase, shape (w,), dimensionless.

    Returns:
        Shape (w,).
    """
    weight, time = run.information, run.time - run.time[-1]
    # Sums over the windows from each one on: every step, and its products with the line and the values.
    terms = np.stack((weight, weight * time, weight * time**2, weight * values, weight * time * values))
    sums = np.cumsum(terms[:, ::-1], axis=1)[:, ::-1]
    (a, b, c, d, e), (level, slope) = sums[:, 0], (sums[0, 1:], sums[1, 1:])
    determinant = a * c - b * b
    own = level - (c * level**2 - 2.0 * b * level * slope + a * slope**2) / determinant
    aim = sums[3, 1:] - (level * (c * d - b * e) + slope * (a * e - b * d)) / determinant
    best = int(np.argmax(aim**2 / np.maximum(own, 1e-6 * a)))
    return np.asarray((np.arange(time.size) > best).astype(np.float64))


Mask = NDArray[np.bool_]
SETS = (2, 3, 4)
"""Numbers of columns in the larger rivals, found by forward selection; one more rival has all columns."""
MORE = len(SETS) + 2
"""Rivals besides those of one column: the nominal model first; the sets and all columns together last."""
_PRIOR = 1e-6  # least squares of a column's own fit over the prior variance of its effect: 1000 deviations
_PRIOR_ALL = 1e-3  # the same where all columns act together


@dataclass(frozen=True, eq=False)
class Rivals:
    """The nominal model and its rivals, nominal first.

    Args:
        parameters: of the nominal model, shape (p,).
        shifts: what each rival adds to them, shape (r, p).
        covariances: of the parameters under each rival, shape (r, p, p).
        scores: signed significance of a rival's column, shape (r,); of a set, the root of its fall of χ².
        own: share of a column that the nominal parameters cannot imitate, shape (r,).
        remaining: χ² of each rival, shape (r,).
        freedom: number of values less number of nominal unknowns.
        valid: whether the campaign shows the rival at all, shape (r,).
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
    """Fit the nominal model and every rival.

    Args:
        values: data, shape (n,).
        design: columns of the nominal parameters, shape (n, p).
        columns: of the rivals, shape (n, c); zero where a rival does not apply.
        weights: inverse variances, shape (n,).
        taken: unknowns eliminated beforehand.

    Returns:
        The fits; None where the data do not determine the nominal parameters.
    """
    root = np.sqrt(weights)
    nominal, seen = design * root[:, None], columns * root[:, None]
    normal = nominal.T @ nominal
    if not determined(normal):
        return None
    covariance = inverse(normal)
    parameters = scaled_solve(normal, nominal.T @ (root * values))
    rest = root * values - nominal @ parameters
    full = np.einsum("nc,nc->c", seen, seen)
    valid = full > 0.0
    seen = seen / np.sqrt(np.where(valid, full, 1.0))
    moves = covariance @ (nominal.T @ seen)  # (p, c): how a column shifts the parameters
    own = seen - nominal @ moves
    gram, aim = own.T @ own, own.T @ rest
    alone = np.diag(gram).copy()
    sizes = aim / (alone + _PRIOR)
    scores = aim / np.sqrt(alone + _PRIOR)
    total = float(rest @ rest)
    shifts, covariances = [np.zeros(parameters.size)], [covariance]
    shifts += list((-moves * sizes).T)
    outer = moves.T[:, :, None] * moves.T[:, None, :]
    covariances += list(covariance + outer / (alone + _PRIOR)[:, None, None])
    found_scores, remaining = [0.0, *scores], [total, *(total - scores**2)]
    places = forward_selection(gram, aim, max(SETS))
    sets = [(np.array(places[:number], dtype=np.intp), _PRIOR) for number in SETS]
    for chosen, prior in [*sets, (np.flatnonzero(valid), _PRIOR_ALL)]:
        inner = gram[np.ix_(chosen, chosen)] + prior * np.eye(chosen.size)
        solved = np.linalg.solve(inner, np.column_stack((aim[chosen], moves[:, chosen].T)))
        shifts.append(-moves[:, chosen] @ solved[:, 0])
        covariances.append(covariance + moves[:, chosen] @ solved[:, 1:])
        fall = float(aim[chosen] @ solved[:, 0])
        found_scores.append(float(np.sqrt(max(fall, 0.0))))
        remaining.append(total - fall)
    return Rivals(
        parameters,
        np.array(shifts),
        np.array(covariances),
        np.array(found_scores),
        np.concatenate(([1.0], alone, np.ones(len(SETS) + 1))),
        np.maximum(np.array(remaining), 0.0),
        values.size - taken - parameters.size,
        np.concatenate(([True], valid, np.ones(len(SETS) + 1, dtype=bool))),
    )


def forward_selection(gram: Array, aim: Array, number: int) -> list[int]:
    """Forward selection: each column lowers χ² most beside those before it.

    Args:
        gram: products of the columns, shape (c, c).
        aim: products of the columns with the data, shape (c,).
        number: of columns to choose.
    """
    left, own = aim.copy(), np.diag(gram).copy()
    gram = gram.copy()
    chosen: list[int] = []
    for _ in range(min(number, aim.size)):
        gain = left**2 / (own + _PRIOR)
        gain[chosen] = -1.0
        best = int(np.argmax(gain))
        chosen.append(best)
        share = gram[:, best] / (own[best] + _PRIOR)
        left = left - share * left[best]
        gram = gram - np.outer(share, gram[best])
        own = np.maximum(np.diag(gram), 0.0)
    return chosen
