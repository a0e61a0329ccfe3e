"""Upper limits on undetected effects: the largest size of every effect that the runs do not exclude.

An effect too small to be named still changes the coefficients, since the fit absorbs a part of it. The change
at the largest size is stated beside the coefficients and is not part of their intervals. First, Cnr without a
named lag is the derivative in phase with the rate (decision 0004), to which a lag contributes. Second, an
effect that the runs do not show is as likely to be absent.

Linear theory proposes a size. A refit with the effect held at this size confirms the limit or corrects it.
Linear theory alone may be wrong: a lag shows by its second order only, and chance differences between the runs
absorb a part of an effect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from diagnosis.answer.linear_theory import (
    DISPERSION_STDS,
    MISFIT_DEGREES,
    Starts,
    coefficients_of,
    influences,
    size_range,
)
from diagnosis.likelihood.least_squares import Fit, fit_near
from diagnosis.likelihood.starting_points import (
    StartingPoint,
    absorbed,
    change_to,
    project_out,
    second_order_starts,
)
from diagnosis.model.parameters import Point
from diagnosis.search.hypothesis import own_gain
from identification.show.quantity import Quantity
from tunnel_sim.vocabulary.record import Array

HIDDEN_STDS: Final = 2.0
"""Distance of the upper limit of an undetected effect from its most probable size, in standard deviations.
Convention."""
HIDDEN_ABSORBED: Final = 0.0001
"""Minimum unabsorbed share of a change for the runs to show the effect. Judgement. The accuracy of linear
theory."""


@dataclass(frozen=True)
class Hidden:
    """An effect that is not named, at the largest size that the runs do not exclude.

    Args:
        effect: name of the effect.
        parameter: name of the severity.
        size: value of that parameter, with the sign that allows the larger size, with its unit; not determined
            where no refit confirms a limit.
        moves: by coefficient, the size of its change by the effect, with its unit; empty without a limit.
        significance: most likely size over its standard deviation, a ratio.
    """

    effect: str
    parameter: str
    size: Quantity
    moves: Mapping[str, Quantity]
    significance: float = 0.0


def hidden_effects(fit: Fit, starts: Starts, residuals: Sequence[Array] | None = None) -> tuple[Hidden, ...]:
    """Upper limits on effects beside the fitted ones, two standard deviations from the most likely size.

    The part of the change that the other parameters cannot absorb is a polynomial in the size: of second order
    where the effect states that its first order is absorbed, else of first order. The polynomial gives χ² at
    every size, and the range of sizes within four units of the least χ². A unit is the dispersion of the misfit
    (`diagnosis.answer.linear_theory.beside`); it is 1 where only noise remains. Refits confirm the size
    (`_confirmed`).

    Args:
        fit: the fit of the answer, with or without effects.
        starts: the effects that may act beside the fitted ones.
        residuals: scaled residuals for the dispersion, by run, where small causes beside the fit explain a part of
            the fit's residuals; each of shape (n,).

    Returns:
        In the given order, without the effects that the runs cannot show.
    """
    total = fit.total if residuals is None else sum(float(r @ r) for r in residuals)
    beyond = max(total - fit.count - DISPERSION_STDS * np.sqrt(2.0 * fit.count), 0.0)
    reach = HIDDEN_STDS**2 * (1.0 + beyond / MISFIT_DEGREES)
    names, influence = coefficients_of(fit), influences(fit)
    hidden, units = [], fit.problem.data.model.coefficient_units
    for kind, points in starts:
        sizes: list[tuple[_Size, StartingPoint]] = []
        with suppress(np.linalg.LinAlgError):
            for start in second_order_starts(fit, kind, passive=True) or points[: kind.tries]:
                one = _largest(fit, start, influence, reach)
                sizes += [] if one is None else [(one, start)]
        sizes.sort(key=lambda one: -float(np.max(np.abs(one[0].moves))))
        tried = (_confirmed(fit, start, one, reach) for one, start in sizes)
        largest = next((one for one in tried if one is not None), None)
        severity = kind.parameters()[0]
        if largest is None and sizes:
            unknown = Quantity(sizes[0][0].size, None, severity.unit, determined=False)
            hidden.append(Hidden(kind.name, severity.name, unknown, {}))
        elif largest is not None:
            size = Quantity(largest.size, None, severity.unit)
            moves = {
                name: Quantity(float(abs(move)), None, units[name])
                for name, move in zip(names, largest.moves, strict=True)
            }
            stds = HIDDEN_STDS * float(np.sqrt(max(one.drop for one, _ in sizes) / reach))
            hidden.append(Hidden(kind.name, severity.name, size, moves, stds))
    return tuple(hidden)


def _confirmed(fit: Fit, start: StartingPoint, linear: _Size, reach: float) -> _Size | None:
    """The size at which a refit is ``reach`` above the least −2 ln L, with the changes of the coefficients.

    A refit confirms a size if its rise is within a tenth of ``reach``. A refit beyond that confirms it too if a
    size close to it lies within. Where linear theory fails, the least is that of the refits, one of them at the
    most likely size, and of the fit; the next size follows from these (`_nearer`). An effect with a phase or an
    instant in every run keeps its size by linear theory: its change is a sum of lines or steps, linear in the size.

    Returns:
        None where no refit confirms a size, or the runs exclude no size at all.
    """
    assert start.scaled is not None
    if start.point.per_run.shape[1] > fit.point.per_run.shape[1]:
        return linear
    least, greatest = sorted(one[start.scaled] for one in start.problem.bounds)
    size = float(
        np.clip(linear.size, least, greatest)
    )  # a multiple of a trial may exceed its bound by rounding
    lowest = fit.unlikelihood - linear.lowered
    known = [(0.0, fit.unlikelihood)]
    near: tuple[float, Point] | None = None
    for number in range(_REFITS):
        again = _held(fit, start, size, near)
        if again is None:
            return None
        known.append((size, again.unlikelihood))
        if number:
            lowest = min(value for _, value in known)
        rise = (again.unlikelihood - lowest) / reach
        # refits beside chance differences may end in several minima, so the rise may have a step
        within = max((abs(one) for one, value in known if value < lowest + reach), default=0.0)
        close = rise > 1.0 and within < abs(size) < _CLOSE * within
        if close and rise > _STEP:  # this refit failed, and its coefficients say nothing
            return None
        if close or abs(rise - 1.0) <= _CONFIRMED:
            return replace(
                linear,
                size=size,
                moves=_changes(fit, start, np.insert(again.point.common, start.scaled, size)),
            )
        if rise < 1.0 or near is None:
            near = size, again.point
        if number == 0 and linear.lowered > _CONFIRMED * reach and linear.likeliest * size > 0.0:
            further = linear.likeliest
        else:
            further = float(np.clip(_nearer(known, reach, start.second_order), least, greatest))
        if further == size:  # all sizes of the range are allowed
            return None
        size = further
    return None


def _nearer(known: Sequence[tuple[float, float]], reach: float, second_order: bool) -> float:
    """The size at which the root of the rise is 1, from sizes and their −2 ln L, by the secant.

    The rise is a parabola about the most likely size, so its root is a line; where the first order is absorbed, a
    line in the square of the size. Refits within that lie below this line twice in a row contradict the next refit
    beyond, which may be in another minimum: it is made again, from nearer.
    """
    power = 2.0 if second_order else 1.0
    least: dict[float, float] = {}
    for size, value in known:
        least[size] = min(value, least.get(size, np.inf))
    likeliest, lowest = min(least.items(), key=lambda one: one[1])
    vertex = abs(likeliest) ** power

    def root(size: float) -> tuple[float, float]:
        place, rise = abs(size) ** power, (least[size] - lowest) / reach
        return place, float(np.copysign(np.sqrt(rise), place - vertex))

    roots = {size: root(size) for size in least}
    low, below = max(one for one in roots.values() if one[1] < 1.0)
    (high, above), beyond = min(
        ((one, size) for size, one in roots.items() if one[0] > low), default=((np.inf, np.inf), np.inf)
    )
    if high < np.inf:
        sides = [roots[size][1] < 1.0 for size, _ in known[-2:]]
        stalls = len(known) > 3 and sides[0] == sides[1]
        if stalls and sides[0] and sum(size == beyond for size, _ in known) == 1:
            return beyond
        place = low + (0.5 if stalls else (1.0 - below) / (above - below)) * (high - low)
    else:
        before, earlier = max((one for one in roots.values() if one[0] < low), default=(0.0, below))
        slope = (below - earlier) / (low - before) if low > before else 0.0
        further = low + (1.0 - below) / slope if slope > 0.0 else np.inf
        place = min(further, low * _WIDEST**power)
    return float(np.copysign(place ** (1.0 / power), known[1][0]))


def _held(fit: Fit, start: StartingPoint, size: float, near: tuple[float, Point] | None) -> Fit | None:
    """The fit with an effect held at a size and its other parameters free; None where it fails.

    Args:
        near: another size and the refit's point there, from which the refit starts; None: from the fit.
    """
    assert start.scaled is not None
    name, problem = start.problem.names[start.scaled], start.problem
    problem = replace(problem, fixed=(*problem.fixed, (name, size)), scatter=fit.problem.scatter)
    common, per_run = fit.point.common, fit.point.per_run
    if near is None:
        own = np.delete(start.point.common, start.scaled)[common.size :]
    else:
        there, part = near[1], size / near[0]
        own = there.common[common.size :]
        common = common + part * (there.common[: common.size] - common)
        per_run = per_run + part * (there.per_run - per_run)
    return fit_near(problem, Point(np.concatenate([common, own]), per_run.copy()), fit, max_iterations=_STEPS)


def _changes(fit: Fit, start: StartingPoint, there: Array) -> Array:
    """Changes of the coefficients from a fit to a refit, shape (coefficients,).

    Args:
        there: common parameters of the refit, with the size of the effect, shape (common,).
    """
    model, changes = fit.problem.data.model, []
    for name in coefficients_of(fit):
        before = model.coefficient(fit.problem.names, fit.point.common, name)
        after = model.coefficient(start.problem.names, there, name)
        changes.append(0.0 if before is None or after is None else after - before)
    return np.array(changes, np.float64)


_REFITS = 10
_STEPS = 10  # iterations of a refit, which starts at the fit
_CONFIRMED = 0.1  # greatest distance of a rise from the limit's rise, as a share of the latter
_CLOSE = 1.1  # maximum ratio of a size beyond the limit to one within it, for both to confirm the limit
_STEP = 10.0  # maximum rise just beyond the limit, in the limit's rise; a failed refit rose by 17,806
_WIDEST = 10.0  # greatest factor between two sizes that are refitted


@dataclass(frozen=True, eq=False)
class _Size:
    """The largest size of an effect that the runs do not exclude."""

    size: float
    moves: Array  # moves of the coefficients there, shape (coefficients,)
    drop: float  # least χ², less the chance gain of parameters per run
    likeliest: float  # the most likely size
    lowered: float  # drop of χ² there


def _largest(fit: Fit, start: StartingPoint, influence: Sequence[Array], reach: float) -> _Size | None:
    """The largest size of an effect within ``reach`` of the least χ², and the moves of the coefficients there.

    A polynomial fitted far from the size contains higher orders in its first order. Where the first order is
    absorbed, the polynomial is therefore fitted again at the size found.
    """
    if start.scaled is None:
        return None
    limit = None
    for number in range(_ROUNDS if start.second_order else 1):
        size = float(start.point.common[start.scaled])
        # at a trial's size, a small share means that the runs cannot show the effect; at later sizes it may
        # be small
        limit = _within(fit, start, influence, reach, HIDDEN_ABSORBED if number == 0 else 0.0)
        if limit is None or limit.size == 0.0 or 1.0 / _SETTLED < limit.size / size < _SETTLED:
            break
        common = start.point.common.copy()
        common[start.scaled] = limit.size
        start = replace(start, point=replace(start.point, common=common))
    return limit


def _within(
    fit: Fit, start: StartingPoint, influence: Sequence[Array], reach: float, least_share: float
) -> _Size | None:
    """Like `_largest`, by a polynomial fitted at the size of the starting point and at half of it."""
    assert start.scaled is not None
    size = float(start.point.common[start.scaled])
    least, greatest = size_range(start)
    if start.second_order:  # with the opposite sign the effect follows another law
        least = 0.0
    parts = [1.0, 0.5] if start.second_order else [1.0]
    seen = [_profiled(fit, start, part, influence, least_share) for part in parts]
    if any(one is None for one in seen):
        return None
    changes, lefts, moves = zip(*(one for one in seen if one is not None), strict=True)
    # change(k) = k u + k² w at k times the size; the unabsorbed part and the moves have the same form
    powers = np.array([[part, part**2][: len(parts)] for part in parts])
    terms, left, slopes = (np.linalg.solve(powers, np.array(of)) for of in (changes, lefts, moves))
    # together with the change itself, so that the prior of the runs' deviations counts
    along, gram = terms @ np.concatenate(fit.residuals), terms @ left.T
    rise: Array = np.zeros(5)  # χ²(k) − χ²(0), from the fourth power of k down
    for i in range(len(terms)):
        rise[3 - i] -= 2.0 * along[i]
        for j in range(len(terms)):
            rise[2 - i - j] += gram[i, j]
    turns = [k for k in _real_roots(np.asarray(np.polyder(rise), np.float64)) if least <= k <= greatest]
    likeliest = min([0.0, *turns], key=lambda k: float(np.polyval(rise, k)))
    lowest = float(np.polyval(rise, likeliest))
    ends = _real_roots(rise - np.array([0.0, 0.0, 0.0, 0.0, lowest + reach]))
    if not ends:
        return None
    outermost = max((float(np.clip(k, least, greatest)) for k in ends), key=abs)
    moved = np.array([outermost, outermost**2][: len(parts)]) @ slopes
    by_chance = own_gain(start.problem) - own_gain(fit.problem)
    # zero first: of two equal numbers max takes the first, and this one is not negative
    return _Size(outermost * size, moved, max(0.0, -lowest - by_chance), likeliest * size, max(0.0, -lowest))


def _real_roots(polynomial: Array) -> list[float]:
    return [float(k.real) for k in np.roots(polynomial) if abs(k.imag) <= _REAL * abs(k)]


_ROUNDS, _SETTLED = 6, 1.5  # rounds, and the factor by which the last one may still change the size
_LEAST_PART = 1e-3  # least step towards a trial, as a share of the step to it
_REAL = 1e-6  # maximum imaginary part of a root, as a share of the root


def _moved(fit: Fit, start: StartingPoint, there: Array) -> Array:
    """Change of a fit's coefficients with an effect beside it, shape (coefficients,).

    Args:
        there: the common parameters of the start's problem, shape (common,). If a trial of gravity is so large
            that nothing would swing, the change is computed from a fraction of the step.
    """
    assert start.scaled is not None
    model, names = fit.problem.data.model, start.problem.names
    here = np.concatenate([fit.point.common, there[fit.point.common.size :]])
    here[start.scaled] = 0.0
    part = 1.0
    while part > _LEAST_PART and model.coefficient(names, here + part * (there - here), "omega_n") == 0.0:
        part *= 0.5
    changes = []
    for name in coefficients_of(fit):
        before = model.coefficient(fit.problem.names, fit.point.common, name)
        after = model.coefficient(names, here + part * (there - here), name)
        changes.append(0.0 if before is None or after is None else (after - before) / part)
    return np.array(changes, np.float64)


def _profiled(
    fit: Fit, start: StartingPoint, part: float, influence: Sequence[Array], least_share: float
) -> tuple[Array, Array, Array] | None:
    """The change of all readings by a part of an effect's size, its unabsorbed part, and its moves.

    The other parameters are moved first: some absorb a change exactly, as Cnβ and Cnr absorb an offset of the
    only wind speed, and linear theory alone would absorb it to first order only.

    Returns:
        The change and its unabsorbed part, scaled, each of shape (n,), and the moves of the coefficients, shape
        (coefficients,); None where the unabsorbed share of the change is at most ``least_share``.
    """
    assert start.scaled is not None
    common = start.point.common.copy()
    common[: fit.point.common.size] = fit.point.common
    common[start.scaled] = part * start.point.common[start.scaled]
    effect, release = common[fit.point.common.size :], start.point.per_run.copy()
    release[:, : fit.point.per_run.shape[1]] = fit.point.per_run
    change = change_to(fit, start.problem, Point(common, release))
    whole = float(np.linalg.norm(np.concatenate(change)))
    if not np.isfinite(whole):
        return None
    there = absorbed(fit, change)
    moved = _moved(fit, start, np.concatenate([there.common, effect]))
    own = np.column_stack([there.per_run, release[:, there.per_run.shape[1] :]])
    change = change_to(fit, start.problem, Point(np.concatenate([there.common, effect]), own))
    if not all(np.all(np.isfinite(one)) for one in change):
        return None
    moved = moved - sum((c @ i for c, i in zip(change, influence, strict=True)), np.zeros_like(moved))
    left = np.concatenate(project_out(fit, change))
    if float(np.linalg.norm(left)) <= least_share * whole:
        return None
    return np.concatenate(change), left, moved
