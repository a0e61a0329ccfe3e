"""The rig's inertia from springs of known stiffness, and outliers among the springs.

The paper's eq. (1): Izz is the gradient of Kr against ωn² over the wind-off runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from identification.estimate import RunEstimate
from identification.policy import (
    DIFFERENCE_DEVIATIONS,
    LEAST_SPRING_RESOLUTION,
    LEAST_SPRING_SPREAD,
    SPRING_AT_BEST,
    SPRING_FLAG_RATE,
)
from identification.show.numbers import with_std
from identification.show.quantity import Quantity
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

_TRIALS = 9999  # number of simulated sets of correct springs that calibrate the rule


@dataclass(frozen=True)
class SpringFit:
    """The line Kr = Izz ωn² + intercept.

    Args:
        inertia: Izz, the gradient of the line, kg m².
        intercept: N m/rad.
        residual_percent: stated stiffness over the line's value, minus one, by spring, %.
        p_value: probability that correct springs deviate at least as much as these.
    """

    inertia: Quantity
    intercept: Quantity
    residual_percent: tuple[float, ...]
    flagged: tuple[bool, ...]
    p_value: float


def fit_springs(stiffness: Sequence[float], frequency_hz: Sequence[float]) -> SpringFit:
    """Fit the line by least squares and flag outliers.

    The line is the paper's: unweighted, through all springs. The flags come from the inertia of each spring by
    itself, Kr/ωn² (eq. 1), because the error of a spring is relative. Outliers mask one another, so the rule is
    10.1080/00401706.1983.10487848): the spring furthest from the others is tested by its externally studentised
    residual (Student's t, Bonferroni over the remaining springs) and removed, repeatedly up to a third of them; all
    springs up to the *last* one beyond chance are flagged. The nominal level is too lenient for ten springs (8.5 %
    of correct sets at 5 %), so it is calibrated on simulated sets of correct springs with normal relative errors.
    A stiffness common to all runs (a tilted axis) shows in the intercept and in flags on the softest springs.

    Args:
        stiffness: Kr per spring, N m/rad, shape (n,), n ≥ 3.
        frequency_hz: wind-off frequency with each spring, Hz, shape (n,).

    Raises:
        TunnelError: with fewer than three springs, unequal lengths or values that are not positive.
    """
    springs = np.asarray(stiffness, dtype=np.float64)
    omega_squared = (2.0 * np.pi * np.asarray(frequency_hz, dtype=np.float64)) ** 2
    where = "springs"
    if springs.shape != omega_squared.shape or springs.ndim != 1:
        raise TunnelError(
            "the numbers of stiffnesses and frequencies differ", where=where, remedy="pair them"
        )
    if springs.size < 3:
        raise TunnelError(
            "fewer than three springs", where=where, remedy="add wind-off runs with other springs"
        )
    if not (np.all(np.isfinite(springs)) and np.all(springs > 0.0) and np.all(omega_squared > 0.0)):
        raise TunnelError("stiffness and frequency must be positive", where=where, remedy="correct the table")
    if np.unique(omega_squared).size < 2:
        raise TunnelError(
            "all frequencies are the same", where=where, remedy="use springs of different stiffness"
        )
    line, covariance = _least_squares(np.column_stack((omega_squared, np.ones_like(springs))), springs)
    fitted = line[0] * omega_squared + line[1]
    flagged, p_value = np.zeros(springs.size, dtype=bool), 1.0
    if springs.size > 3:  # two correct springs of three cannot outvote a wrong one
        rng = np.random.default_rng(1)  # so that the result is repeatable
        chances, order = _take_out_the_worst((springs / omega_squared)[None, :])
        least = _take_out_the_worst(rng.standard_normal((_TRIALS, springs.size)))[0].min(axis=1)
        beyond = np.flatnonzero(chances[0] <= np.quantile(least, SPRING_FLAG_RATE))
        if beyond.size:
            flagged[order[0, : beyond[-1] + 1]] = True
        p_value = (1 + int(np.sum(least <= chances[0].min()))) / (1 + _TRIALS)
    return SpringFit(
        inertia=Quantity(float(line[0]), float(np.sqrt(covariance[0, 0])), "kg m2"),
        intercept=Quantity(float(line[1]), float(np.sqrt(covariance[1, 1])), "N m/rad"),
        residual_percent=tuple((100.0 * (springs / fitted - 1.0)).tolist()),
        flagged=tuple(flagged.tolist()),
        p_value=p_value,
    )


def pair_remark(campaign: Campaign, runs: Sequence[RunEstimate]) -> Remark | None:
    """A remark that the two springs of a campaign give different inertias; None if they agree, or are not two.

    Two springs known to `SPRING_AT_BEST` disagree at the level `DIFFERENCE_RATE`.

    Args:
        campaign: the campaign, which states the stiffnesses.
        runs: the estimates; the natural frequencies of free decays with the wind off are compared.
    """
    still = [run for run in campaign.decays if not run.wind_on]
    stated = {run.id: run for run in still if run.spring_stiffness}
    inertias: dict[float, list[Quantity]] = {}
    for found in runs:
        run = stated.get(found.id)
        if run is not None and run.spring_stiffness and found.omega_n is not None:
            inertia = run.spring_stiffness / found.omega_n.value**2
            std = 2.0 * inertia * found.omega_n.known_std / found.omega_n.value
            inertias.setdefault(run.spring_stiffness, []).append(Quantity(inertia, std, "kg m2"))
    if len(inertias) != 2 or {run.spring_stiffness for run in campaign.runs} != inertias.keys():
        return None
    (soft, one), (stiff, other) = sorted(inertias.items())
    means = [float(np.mean([each.value for each in several])) for several in (one, other)]
    stds = [
        float(np.sqrt(sum(each.known_std**2 for each in several))) / len(several) for several in (one, other)
    ]
    apart = abs(means[0] / means[1] - 1.0)
    std = float(np.hypot(stds[0] / means[0], stds[1] / means[1]))
    allowed = DIFFERENCE_DEVIATIONS * float(np.hypot(std, np.sqrt(2.0) * SPRING_AT_BEST))
    if stiff / soft < 1.0 + LEAST_SPRING_SPREAD or apart < allowed:
        return None
    return Remark(
        Outcome.NOTED,
        tuple(each.id for each in runs if each.id in stated),
        f"with the wind off the springs of {soft:g} and {stiff:g} N m/rad give inertias that differ by "
        f"{with_std(100.0 * apart, 100.0 * std)} %: one of them is not as stiff as stated, or another moment, such "
        "as gravity's, acts; two springs do not show which",
        "add runs with a third spring, or measure the stiffness of both springs again",
    )


def wind_off_line(
    stiffness: Array, omega_n: Array, omega_n_std: Array
) -> tuple[Quantity | None, Quantity | None]:
    """Izz [kg m²] from wind-off runs, the gradient of Kr against ωn², and the intercept [N m/rad].

    The standard deviation is the larger of two: from the scatter about the line, and propagated from the
    frequencies' standard deviations. Springs with stated stiffnesses within 1 %, or with indistinguishable
    frequencies, count as one, and Izz is then Kr/ωn²: a gradient over them would be dominated by their errors
    and too small (the attenuation of Fuller, Measurement Error Models (1987), doi 10.1002/9780470316665, §
    1.1). The intercept is then None; both are None if the frequencies fall as the springs get stiffer.

    Args:
        stiffness: Kr per run, N m/rad, shape (n,).
        omega_n: natural angular frequency per run, rad/s, shape (n,).
        omega_n_std: standard deviation of ωn, rad/s, shape (n,).
    """
    squared, squared_std = omega_n**2, 2.0 * omega_n * omega_n_std
    away = stiffness - stiffness.mean()
    apart = float(np.ptp(stiffness)) > LEAST_SPRING_SPREAD * float(stiffness.max())
    rise, rise_std = float(away @ squared), float(np.linalg.norm(away * squared_std))
    if apart and rise < -LEAST_SPRING_RESOLUTION * rise_std:
        return None, None
    if not apart or rise < LEAST_SPRING_RESOLUTION * rise_std:
        inertias = stiffness / squared
        propagated = inertias * squared_std / squared / stiffness.size
        scatter = float(np.std(inertias, ddof=1)) / np.sqrt(stiffness.size) if stiffness.size > 1 else 0.0
        std = max(float(np.linalg.norm(propagated)), float(scatter))
        return Quantity(float(inertias.mean()), std, "kg m2"), None
    columns = np.column_stack((squared, np.ones_like(squared)))
    line, covariance = _least_squares(columns, stiffness)
    # A frequency error changes the line's Kr by the gradient times the error of ωn².
    influence = np.linalg.pinv(columns) * (line[0] * squared_std)
    own = np.linalg.norm(influence, axis=1)
    std = np.maximum(own, np.sqrt(np.diag(covariance)))
    inertia, intercept = map(Quantity, line.tolist(), std.tolist(), ("kg m2", "N m/rad"))
    return inertia, intercept


def inertia_of_springs(stiffness: Array, squared: Array, *, with_line: bool) -> float:
    """Izz alone, kg m², as in `wind_off_line`, for other frequencies of the same springs.

    Args:
        stiffness: Kr per run, N m/rad, shape (n,).
        squared: ωn² per run, rad²/s², shape (n,).
        with_line: whether Izz is the gradient of a line; else the mean of Kr/ωn².
    """
    if not with_line:
        return float(np.mean(stiffness / squared))
    return float(_least_squares(np.column_stack((squared, np.ones_like(squared))), stiffness)[0][0])


def _least_squares(columns: Array, values: Array) -> tuple[Array, Array]:
    solution = np.asarray(np.linalg.lstsq(columns, values, rcond=None)[0], dtype=np.float64)
    degrees = values.size - columns.shape[1]
    variance = float(np.sum((values - columns @ solution) ** 2)) / degrees if degrees > 0 else 0.0
    return solution, np.asarray(variance * np.linalg.inv(columns.T @ columns))


def _take_out_the_worst(sets: Array) -> tuple[Array, NDArray[np.intp]]:
    # Rows are sets of springs. Per step: the Bonferroni probability of the worst spring, and its index.
    rows = np.arange(sets.shape[0])
    kept = np.ones(sets.shape, dtype=bool)
    chances, order = [], []
    for step in range(max(1, sets.shape[1] // 3)):
        count = sets.shape[1] - step
        mean = np.sum(sets * kept, axis=1, keepdims=True) / count
        squares = np.where(kept, (sets - mean) ** 2, -1.0)
        worst = np.argmax(squares, axis=1)
        own = squares[rows, worst] * count / (count - 1)  # divided by 1 − leverage
        # Rounding errors do not count: a set of equal springs has no outlier.
        floor = (1e-12 * np.abs(mean[:, 0])) ** 2
        rest = np.maximum((np.sum(squares * kept, axis=1) - own) / (count - 2), floor)
        chances.append(np.minimum(1.0, 2.0 * count * stdtr(count - 2, -np.sqrt(own / rest))))
        order.append(worst)
        kept[rows, worst] = False
    return np.array(chances).T, np.array(order).T
