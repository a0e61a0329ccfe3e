"""Friction against rate: the fitted law with its band, and points from the energy balance of the records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from diagnosis.findings.finding import Picture
from diagnosis.likelihood.least_squares import Fit
from diagnosis.model.similarity import Similarity
from identification.show.drawing import AFTER, INK, NARROW, PAPER
from identification.show.numbers import plain, unit_mark
from identification.show.quantity import INTERVAL
from identification.show.style import figure, grid, log_axis, styled
from identification.signal.strokes import reversals, strokes
from tunnel_sim.effects import Effect
from tunnel_sim.effects.capabilities import Friction
from tunnel_sim.files.writing import as_json
from tunnel_sim.vocabulary.dimensions import dimension
from tunnel_sim.vocabulary.quantities import Angles, Rates
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class FrictionPoint:
    """The mean friction of strokes with similar rates, from their energy losses.

    Args:
        rate_rad_s: mean rate over the distance, rad/s.
        moment: mean moment of the strokes, in the unit of the curve.
        std: standard error of the moment by the scatter of the strokes, in that unit.
        strokes: number of strokes.
    """

    rate_rad_s: float
    moment: float
    std: float
    strokes: int


@dataclass(frozen=True)
class FrictionCurve:
    """The friction of an effect against the rate.

    Args:
        effect: name of the effect.
        unit: unit of the moments: N m, or rad/s² per unit inertia.
        rate_rad_s: ascending, rad/s.
        moment: moment of the fitted law at these rates, in the unit.
        std: its standard deviation by the covariance of the fit, in the unit.
        points: points by the energy balance, of ascending rates; none where the records give none.
        per_load: further friction per moment carried by the joint, dimensionless; excluded from law and points.
    """

    effect: str
    unit: str
    rate_rad_s: tuple[float, ...]
    moment: tuple[float, ...]
    std: tuple[float, ...]
    points: tuple[FrictionPoint, ...] = ()
    per_load: float = 0.0

    def to_json_dict(self) -> dict[str, Any]:
        """The fields, in JSON's types."""
        return {name: as_json(value) for name, value in vars(self).items()}

    def pictures(self) -> tuple[Picture, ...]:
        """Friction against rate."""
        caption = (
            "Friction against rate, with 95 % intervals. Line: the law of the answer, with the band of its fit. "
            "Circles: energy lost between reversals of the motion, less the dissipation by the other terms of the "
            "answer, over the distance; at the mean rate."
        )
        description = "Friction against rate: the fitted law with its band, and points by the energy lost."
        return (Picture("friction", caption, description, partial(friction_figure, self)),)


_PLACES = 80  # number of points of the curve
_BELOW = 0.5  # share of the least rate among the points at which the curve begins
_BINS = 12  # maximum number of bins
_RATIO = 1.15  # minimum ratio of the ends of a bin
_NOISE = 10.0  # minimum length of a stroke in standard deviations of the noise: shorter ones are noise
_PEAK = 0.5 * np.pi  # greatest rate of a swing over the mean of its rate over the time


def friction_curve(fit: Fit, own: Similarity) -> FrictionCurve | None:
    """The friction of a fit against the rate, in the campaign's own units.

    Returns:
        The curve; None where the fit has no friction, or no run moves from one reversal to another.
    """
    effects = fit.problem.effects_at(fit.point.common)
    place = next((at for at, one in enumerate(effects) if isinstance(one, Friction)), None)
    if place is None or effects[place].is_null:
        return None
    passed = _strokes(fit)
    if not passed:
        return None
    shown = np.concatenate([one.rate for one in passed])
    unit = fit.problem.data.model.moment_unit
    low, high = _BELOW * float(shown.min()), _PEAK * float(shown.max())
    rates = np.geomspace(low, high, _PLACES)
    values, std = _law(fit, place, rates)
    return FrictionCurve(
        effects[place].name,
        unit,
        _own(rates, own, "rad/s"),
        _own(values, own, "N m"),
        _own(std, own, "N m"),
        tuple(
            FrictionPoint(
                own.own(one.rate_rad_s, "rad/s"),
                own.own(one.moment, "N m"),
                own.own(one.std, "N m"),
                one.strokes,
            )
            for one in _binned(passed, effects[place])
        ),
        sum(getattr(effects[place], info.name) for info in effects[place].parameters() if info.of_load),
    )


def _own(values: Array, own: Similarity, unit: str) -> tuple[float, ...]:
    factor = own.own(1.0, unit)
    return tuple(float(f"{value:.6g}") for value in (factor * values).tolist())


def _law(fit: Fit, place: int, rates: Rates) -> tuple[Array, Array]:
    """The law of an effect at some rates with its standard deviation, by the covariance of its parameters.

    Args:
        place: index of the effect in the fit.

    Returns:
        Both in N m, shape (n,).
    """
    problem, common = fit.problem, fit.point.common
    own = [
        at for at, one in enumerate(problem.parameters.common) if one.effect == problem.effects[place].name
    ]
    steps = problem.parameters.steps(common)
    values = _sliding(problem.effects_at(common)[place], rates)
    slopes = np.empty((rates.size, len(own)))
    for column, at in enumerate(own):
        changed = common.copy()
        changed[at] += steps[at]
        slopes[:, column] = (_sliding(problem.effects_at(changed)[place], rates) - values) / steps[at]
    covariance = fit.stated_covariance[np.ix_(own, own)]
    return values, np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", slopes, covariance, slopes), 0.0))


def _sliding(effect: Effect, rates: Array) -> Array:
    assert isinstance(effect, Friction)
    return effect.sliding(rates)


@dataclass(frozen=True, eq=False)
class _Passed:
    """The strokes of a run.

    Args:
        rate: mean rate over the distance, rad/s, shape (n,).
        missed: their energy loss beyond the fitted model, J, shape (n,).
        error: standard deviation of the energy at every reversal due to the noise, J, shape (n + 1,).
    """

    rate: Array
    travel: Angles
    missed: Array
    error: Array


def _strokes(fit: Fit) -> list[_Passed]:
    """The strokes of every run that has any.

    A stroke's loss in the records differs from its loss in the fitted model by the error of the friction law. All
    other losses are equal in both, as are the errors of the reversals.
    """
    problem, found = fit.problem, []
    prediction = problem.predict([fit.point])[0]
    for place, (run, predicted) in enumerate(zip(problem.data.runs, prediction, strict=True)):
        turns = reversals(predicted, _NOISE * run.noise_std)
        if run.derivative or turns.size < 2:
            continue
        stiffness, centre = float(fit.linear[place, 2]), fit.zero(place)
        physics = problem.chain(fit.point.common, fit.point.per_run[place], run).physics()
        moment = physics.input_moment(run.times)
        model, record = (strokes(one, turns, stiffness, moment, centre) for one in (predicted, run.reading))
        force = stiffness * (model.angle - centre) - moment[turns]
        error = run.noise_std * record.spread * np.abs(force)
        rate = _mean_rates(predicted, run.times, turns)
        found.append(_Passed(rate, model.travel, record.lost - model.lost, error))
    return found


def _mean_rates(angle: Array, time: Array, turns: NDArray[np.int64]) -> Array:
    """Mean of the rate over the distance of every stroke, rad/s, shape (strokes,)."""
    rate = np.abs(np.gradient(angle, time))
    sums = [np.concatenate([[0.0], np.cumsum(rate**power)])[turns] for power in (1, 2)]
    return np.asarray(np.diff(sums[1]) / np.diff(sums[0]))


def _binned(runs: Sequence[_Passed], effect: Effect) -> list[FrictionPoint]:
    """The friction by bins of equal ratios of the rates.

    Consecutive strokes share a reversal, and its error cancels in their sum: they count as one.
    """
    rates = np.concatenate([one.rate for one in runs])
    bins = int(np.clip(np.log(rates.max() / rates.min()) / np.log(_RATIO), 1.0, _BINS))
    edges = np.geomspace(rates.min(), rates.max() * (1.0 + 1e-9), bins + 1)
    groups: list[list[tuple[float, float, float, int]]] = [[] for _ in range(bins)]
    for one in runs:
        places = np.clip(np.searchsorted(edges, one.rate, side="right") - 1, 0, bins - 1)
        ends = np.flatnonzero(np.diff(places)) + 1
        for first, last in pairwise([0, *ends.tolist(), places.size]):
            travel = one.travel[first:last]
            whole = float(travel.sum())
            rate = float(travel @ one.rate[first:last]) / whole
            error = float(np.hypot(one.error[first], one.error[last])) / whole
            moment = float(one.missed[first:last].sum()) / whole + float(
                _sliding(effect, np.array([rate]))[0]
            )
            groups[int(places[first])].append((rate, moment, error, last - first))
    return [_point(np.array(group)) for group in groups if group]


def _point(group: Array) -> FrictionPoint:
    """The mean weighted by inverse variances; its error is the larger of the noise's and the scatter's."""
    rate, moment, error, count = group.T
    weight = np.maximum(error, 1e-300) ** -2.0
    total, mean = float(weight.sum()), float(weight @ moment / weight.sum())
    scatter = float(weight @ (moment - mean) ** 2) / max(len(group) - 1, 1)
    std = float(np.sqrt(max(scatter, 1.0) / total))
    return FrictionPoint(float(weight @ rate) / total, mean, std, int(count.sum()))


@styled
def friction_figure(curve: FrictionCurve) -> Figure:
    """Friction against rate with 95 % intervals."""
    rate, moment, std = (np.array(given, np.float64) for given in (curve.rate_rad_s, curve.moment, curve.std))
    fig = figure(NARROW, 3.0)
    axes = fig.add_subplot()
    low, high = moment - INTERVAL * std, moment + INTERVAL * std
    axes.fill_between(rate, np.maximum(low, 0.0), high, color=AFTER, alpha=0.25, lw=0)
    load = curve.per_load
    more = f" without load; {100.0 * load:.2g} % of the load comes on top" if load else ""
    axes.plot(rate, moment, color=AFTER, label=f"law, fitted{more}")
    tops = [float(high.max())]
    if curve.points:
        at, mean, error = (
            np.array(given, np.float64)
            for given in zip(*((one.rate_rad_s, one.moment, one.std) for one in curve.points), strict=True)
        )
        axes.errorbar(
            at, mean, yerr=INTERVAL * error, fmt="o", color=INK, mfc=PAPER, ms=5, capsize=2, elinewidth=1.0,
            label="energy lost between reversals",
        )  # fmt: skip
        tops.append(min(float((mean + INTERVAL * error).max()), _MOST_DRAWN * float(moment.max())))
    axes.set_ylim(0.0, _ROOM_ABOVE * max(tops))
    mark = unit_mark(curve.unit) + ("" if dimension(curve.unit)[0] else ", over inertia")
    axes.set(xlabel="rate [rad/s]", ylabel=f"{plain(curve.effect)} [{mark}]")
    log_axis(axes, "x")
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=1 if load else 2, borderpad=0.0, borderaxespad=0.3
    )
    grid(axes)
    return fig


_ROOM_ABOVE = 1.15  # length of the axis over the greatest friction drawn
_MOST_DRAWN = 1.6  # times the law's greatest friction: very uncertain points lie beyond the axis
