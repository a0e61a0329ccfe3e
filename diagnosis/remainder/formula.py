"""The sparsest formula for the residual, chosen on held-out runs and fitted like any effect."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from itertools import product as combinations
from typing import Any, Final

import numpy as np
from scipy.special import chdtri

from diagnosis.likelihood.ceiling import Normal, Ridge, Unexplained, held_out, total
from diagnosis.likelihood.least_squares import Fit, FitError, fit
from diagnosis.likelihood.paths import Ranges
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import starting_points
from diagnosis.model.parameters import Point
from tunnel_sim.effects import Effect, known_effects
from tunnel_sim.effects.expression_effect import ExpressionParameter, expression_effect
from tunnel_sim.physics.expression import Expression, parse
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.dimensions import Dimension, dimension, dimension_text, product
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.freedom import ANGLE, Freedom
from tunnel_sim.vocabulary.record import Array

TERM_GAIN: Final = 0.02
"""Minimum part of the explainable share that a further term must add. Judgement."""
FORMULA_OPEN: Final = 0.02
"""Maximum missing part of the explainable share for a formula to count as complete. Judgement."""
WIDER_OPEN: Final = 0.02
"""Missing part of the explainable share above which, for a formula of angle or rate, a formula of both is
tried. Judgement."""
FIRST_START: Final = 0.02
"""Maximum unexplained share of the excess for a fitted formula to need no other starting point. Judgement."""
MOST_TERMS: Final = 3
"""Maximum number of terms in a formula. Judgement."""

_NAMES = {"b": "rad", "r": "rad/s", "t": "s", "V": "m/s", "Kr": "N m/rad", "omega": "rad/s", "y": "rad"}
_INNER = {"w": "rad", "c": "rad", "n": "1", "v": "rad/s", "q": "s", "d": "s", "f": "rad/s"}
"""Inner parameters of terms: widths, places, numbers per radian, rates, times and frequencies."""
_COUNTED = {"n": "1/rad", "omega": "1/s", "f": "1/s"}
"""The units of these where the radian is not counted as 1, since a metre stands for it."""


@dataclass(frozen=True)
class FormulaTerm:
    """A term with the values of its inner parameters.

    Args:
        text: expression in ``b``, ``r``, ``t``, ``V``, ``Kr``, ``omega`` or ``y``, and inner parameters.
        inner: value of each inner parameter, in the unit of `_INNER`.
    """

    text: str
    inner: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def formula(self) -> Expression:
        """The text, parsed."""
        return parse(self.text, frozenset({*_NAMES, *_INNER}))

    @cached_property
    def dimension(self) -> Dimension:
        """Powers of kg, m and s."""
        return self.formula.dimension({name: dimension(unit) for name, unit in (_NAMES | _INNER).items()})

    def value(self, places: Mapping[str, float | Array]) -> Array:
        """The term in its own unit, for numbers or arrays of shape (n,) given by name; shape (n,) or ()."""
        return self.formula.value({**places, **self.inner})


_ANGLE = ("b^2", "b^3", "b^5", "abs(b)", "abs(b)*b")
_ANGLE_WIDE = ("tanh(b/w)", "b*exp(-(b/w)^2)", "b/(1+(b/w)^2)")
_ANGLE_PLACE = ("max(abs(b)-c,0)*sign(b)", "max(b-c,0)", "max(-b-c,0)")
_RATE = ("sign(r)", "abs(r)", "abs(r)*r", "r^3")
_STATE = (
    "b^2*r", "abs(b)*r", "b*r", "b*r^2", "b*sign(r)", "abs(b)*sign(r)", "b^2*sign(r)", "b^4*r", "max(b,0)*r",
    "b*sqrt(b^2+(r/omega)^2)", "r/omega*sqrt(b^2+(r/omega)^2)", "b^2*r/omega*sqrt(b^2+(r/omega)^2)",
)  # fmt: skip
_STATE_WIDE = (
    "exp(-(b/w)^2)*r", "b/(1+(b^2+(r/omega)^2)/w^2)", "r/omega/(1+(b^2+(r/omega)^2)/w^2)",
    "b/sqrt(b^2+(r/omega)^2+w^2)", "r/omega/sqrt(b^2+(r/omega)^2+w^2)",
)  # fmt: skip
_TIME_SLOW = ("b*exp(-t/q)", "r*exp(-t/q)", "sign(r)*exp(-t/q)", "exp(-t/q)")
_TIME = ("b*t", "r*t", "b*t^2")
_TIME_WAVE = ("b*sin(f*t)", "b*cos(f*t)", "r*sin(f*t)")
_READING = ("y^2", "y^3", "y^5", "abs(y)", "abs(y)*y", "t", "t^2")
_READING_PLACE = ("max(abs(y)-c,0)*sign(y)", "max(y-c,0)", "max(-y-c,0)")


def terms(kind: str, r: Ranges) -> list[FormulaTerm]:
    """The terms that may explain a kind of `KINDS`, without a factor for spring or wind.

    The values of their inner parameters are spaced closely enough for a fit to reach the values between. No
    terms are returned for kinds that no formula explains.
    """
    library: list[FormulaTerm] = []
    if kind in ("angle", "state", "wind"):
        library += map(FormulaTerm, _ANGLE)
        library += _grid(_ANGLE_WIDE, w=_widths(r, 9))
        library += _grid(_ANGLE_PLACE, c=_places(r))
        library += _grid(("sin(n*b)",), n=np.arange(1.0, 10.1, 0.35) * np.pi / r.angle)
        library += _grid(("tanh(max(abs(b)-c,0)/w)*sign(b)",), c=_places(r)[::2], w=_widths(r, 3))
        library += _grid(("exp(-((b-c)/w)^2)",), c=np.linspace(-0.8, 0.8, 9) * r.angle, w=_widths(r, 3))
    if kind in ("rate", "state", "wind"):
        library += map(FormulaTerm, _RATE)
        library += _grid(("tanh(r/v)",), v=np.geomspace(0.02, 0.5, 6) * r.rate)
    if kind in ("state", "wind"):
        library += map(FormulaTerm, _STATE)
        library += _grid(_STATE_WIDE, w=_widths(r))
        places = np.linspace(-0.85, 0.85, 18) * r.angle
        library += _grid(("exp(-((b-c)/w)^2)*sign(r)",), c=places, w=_widths(r, 5)[:3])
    if kind == "time":
        library += map(FormulaTerm, _TIME)
        library += _grid(_TIME_SLOW, q=np.geomspace(0.04, 1.5, 9) * r.time)
        library += _grid(_TIME_WAVE, f=2.0 * np.pi * np.arange(0.1, 2.0, 0.05) / (2.0 * r.cycle))
        instants = np.linspace(0.04, 0.96, 24) * r.time
        library += _grid(("b*tanh((t-d)/q)", "r*tanh((t-d)/q)"), d=instants, q=np.array([0.1 * r.cycle]))
        often = np.arange(0.1, 0.98 * r.time / r.cycle, 0.2) * r.cycle
        library += _grid(("exp(-((t-d)/q)^2)",), d=often, q=np.array([0.06, 0.2]) * r.cycle)
    if kind == "reading":
        library += map(FormulaTerm, _READING)
        library += _grid(_READING_PLACE, c=_places(r))
        library += _grid(("sin(n*y)",), n=np.arange(1.0, 14.1, 0.35) * np.pi / r.angle)
        instants = np.linspace(0.04, 0.96, 47) * r.time
        library += _grid(("tanh((t-d)/q)", "y*tanh((t-d)/q)"), d=instants, q=np.array([0.02 * r.cycle]))
        library += _grid(("exp(-t/q)", "y*exp(-t/q)"), q=np.geomspace(0.04, 1.5, 9) * r.time)
    return library


def _grid(texts: tuple[str, ...], **inner: Array) -> Iterator[FormulaTerm]:
    for text in texts:
        for values in combinations(*(grid.tolist() for grid in inner.values())):
            yield FormulaTerm(text, dict(zip(inner, values, strict=True)))


def _widths(r: Ranges, count: int = 6) -> Array:
    return np.geomspace(0.05, 0.8, count) * r.angle


def _places(r: Ranges) -> Array:
    return np.linspace(0.08, 0.92, 15) * r.angle


_TRIED = 10  # number of terms with the greatest drop of χ² that are tried on held-out runs
_FAR = 1e3  # bounds of a coefficient, as multiples of its first value
_NEAR = 4.0  # bounds of a width or place, as multiples of its first value


@dataclass(frozen=True, eq=False)
class Formula:
    """A sum of terms with coefficients.

    Args:
        coefficients: coefficient of each term, in N m, or rad for a reading, over the term's own unit.
        delta: accompanying steps of the fit's common parameters, in their units, shape (common,).
        gained: drop of χ² on held-out runs, dimensionless.
    """

    terms: tuple[FormulaTerm, ...]
    coefficients: tuple[float, ...]
    of_reading: bool
    delta: Array
    gained: float


@dataclass(frozen=True, eq=False)
class Proposal:
    """A formula as an effect, fitted.

    Args:
        table: table of an effects file, in the units of the fit.
    """

    table: dict[str, Any]
    fit: Fit


def choose(unexplained: Unexplained, kind: str, closable: float) -> Formula | None:
    """Find the terms of a kind, one after another.

    Args:
        closable: drop of χ² on held-out runs with the kind's own basis.

    Returns:
        The formula; None if no term is supported beyond chance, or the formula does not predict held-out runs.
    """
    found = _chosen(unexplained, kind, closable)
    if kind in ("angle", "rate") and (found is None or found.gained < (1.0 - WIDER_OPEN) * closable):
        wider = _chosen(unexplained, "state", closable)
        found = found if wider is None or (found and found.gained >= wider.gained) else wider
    return found


def _chosen(unexplained: Unexplained, kind: str, closable: float) -> Formula | None:
    candidates = _candidates(unexplained, kind)
    if not candidates:
        return None
    of_reading, columns = kind == "reading", []
    for path in unexplained.paths:
        at = path.fitted if of_reading else path
        places: dict[str, float | Array] = {
            "b": at.angle, "y": at.angle, "r": at.rate, "t": at.time, "V": at.speed,
            "Kr": at.stiffness, "omega": path.still_omega,
        }  # fmt: skip
        values = np.column_stack([np.broadcast_to(term.value(places), at.time.shape) for term in candidates])
        columns.append(path.reading_rows(values) if of_reading else path.response(values))
    size = np.maximum(np.max([np.max(np.abs(c), axis=0) for c in columns], axis=0), 1e-300)
    parts = unexplained.normals([c / size for c in columns])
    chosen, gained = _paying(unexplained, parts, closable)
    while sum(1 + len(candidates[i].inner) for i in chosen) > limits.OWN_PARAMETERS:
        chosen.pop()
    if not chosen:
        return None
    solution = Ridge(_of(total(parts), chosen), 0.0).solution
    common = unexplained.size.size
    return Formula(
        tuple(candidates[i] for i in chosen),
        tuple(float(v) for v in solution[common:] / size[chosen]),
        of_reading,
        solution[:common] / unexplained.size,
        gained,
    )


def _candidates(unexplained: Unexplained, kind: str) -> list[FormulaTerm]:
    """The terms available for a formula of a kind; none if the runs allow none."""
    of_reading = kind == "reading"
    if of_reading and unexplained.paths[0].run.derivative:
        return []  # the reading of an effect is an angle
    found = terms(kind, unexplained.ranges)
    if kind == "wind":
        fast = [FormulaTerm("V*" + term.text, term.inner) for term in found if "r" in term.formula.names]
        return [FormulaTerm("V^2*" + term.text, term.inner) for term in found] + fast
    if not of_reading and len({path.stiffness for path in unexplained.paths}) > 1:
        found += [FormulaTerm("Kr*" + term.text, term.inner) for term in found if "b" in term.formula.names]
    return found


def _paying(unexplained: Unexplained, parts: Sequence[Normal], closable: float) -> tuple[list[int], float]:
    """The terms, added as long as each lowers χ² on held-out runs, and the drop of χ² there.

    Args:
        parts: normal equations of all terms, by unit.
        closable: greatest possible drop of χ².
    """
    whole = total(parts)
    c = whole.free
    power = np.diag(whole.matrix)[c:]
    settings = unexplained.fit.settings.remainder
    threshold = float(chdtri(1, settings.term_rate / power.size))
    before = float(unexplained.before[unexplained.seen].sum())
    chosen: list[int] = []
    gained = 0.0
    enough = (1.0 - FORMULA_OPEN) * closable
    while len(chosen) < MOST_TERMS and gained < enough:
        known = [*range(c), *(c + i for i in chosen)]
        inner = whole.matrix[np.ix_(known, known)]
        width = np.sqrt(np.maximum(np.diag(inner), 1e-300))
        cross = whole.matrix[np.ix_(known, range(c, len(whole.matrix)))] / width[:, None]
        solved = np.linalg.pinv(inner / np.outer(width, width), rcond=1e-11, hermitian=True) @ cross
        left = power - np.sum(cross * solved, axis=0)
        along = whole.gradient[c:] - solved.T @ (whole.gradient[known] / width)
        # a term that the others explain up to rounding gains nothing
        drops = np.where(left > 1e-6 * np.maximum(power, 1e-300), along**2 / np.maximum(left, 1e-300), 0.0)
        order = [int(i) for i in np.argsort(-drops)[:_TRIED] if drops[i] > threshold]
        tried = []
        for i in order:
            some = [_of(part, [*chosen, i]) for part in parts]
            after = held_out(some, unexplained.groups, None)
            tried.append((before - float(after[unexplained.seen].sum()), i))
        if not tried or max(tried)[0] - gained < max(TERM_GAIN * closable, threshold):
            break
        gained, best = max(tried)
        chosen.append(best)
    return chosen, gained


def _of(whole: Normal, chosen: Sequence[int]) -> Normal:
    """The normal equations of the model's parameters and some of the terms, none with a prior."""
    keep = [*range(whole.free), *(whole.free + i for i in chosen)]
    return Normal(whole.matrix[np.ix_(keep, keep)], whole.gradient[keep], whole.power, len(keep))


def propose(base: Fit, formula: Formula, kind: str) -> Proposal | None:
    """Fit a formula beside a fit's effects, like an effect named after the kind; None where the fit fails."""
    stated = _stated(base, formula, kind)
    if stated is None:
        return None
    table, problem, start = stated
    moved = start.common.copy()
    moved[: formula.delta.size] += formula.delta
    found = []
    for first in (moved, start.common) if formula.delta.any() else (start.common,):
        with suppress(FitError, np.linalg.LinAlgError):
            found.append(fit(problem, Point(first, base.point.per_run), base=base))
            if found[-1].excess < FIRST_START * base.excess:
                break
    best = min((f for f in found if np.isfinite(f.total)), key=lambda f: f.total, default=None)
    return None if best is None or best.total >= base.total else Proposal(table, best)


def predicted_drop(base: Fit, formula: Formula, kind: str) -> float:
    """Drop of χ² by a formula beside a fit's effects, by linear theory; 0 if none is predicted."""
    stated = _stated(base, formula, kind)
    starts = [] if stated is None else starting_points(base, stated[1].effects[-1])
    return max((start.predicted_drop for start in starts), default=0.0)


def _stated(base: Fit, formula: Formula, kind: str) -> tuple[dict[str, Any], Problem, Point] | None:
    """The table of a formula, its problem beside a fit's effects, and the start; None if it is not an effect."""
    taken, freedom = {known.name for known in known_effects()}, base.problem.data.freedom
    first = f"proposed_{freedom.words(kind)}"
    numbered = (f"{first}_{number}" for number in range(2, len(taken) + 3))
    table = effect_table(formula, next(n for n in chain((first,), numbered) if n not in taken), freedom)
    try:
        effect = effect_of(table)
    except TunnelError:
        return None
    start_of = {name: float(q["default"] or q["scale"]) for name, q in table["parameters"].items()}
    problem = dataclasses.replace(base.problem, effects=(*base.problem.effects, effect))
    own = [start_of[name.split(".")[1]] for name in problem.names[len(base.problem.names) :]]
    return table, problem, Point(np.concatenate([base.point.common, own]), base.point.per_run)


def effect_table(formula: Formula, name: str, freedom: Freedom = ANGLE) -> dict[str, Any]:
    """A formula in the fit's units as the table of an effects file, with its values; its units are an angle's."""
    inner_units = _INNER | (_COUNTED if freedom.scales else {})
    units = {own: freedom.unit(unit) for own, unit in (_NAMES | _INNER | _COUNTED).items()}
    of_names = {own: dimension(unit) for own, unit in units.items()}

    def coefficient(value: float, of: Dimension, over: Dimension, default: float) -> dict[str, object]:
        unit, bound = freedom.angle_unit(dimension_text(product(of, over, -1.0))), _FAR * abs(value)
        return {"unit": unit, "scale": value, "lower": -bound, "upper": bound, "default": default}

    dimensions = [term.formula.dimension(of_names) for term in formula.terms]
    first, severity = dimensions[0], formula.coefficients[0]
    aim = dimension(freedom.unit("rad" if formula.of_reading else "N m"))
    parameters = {"k": coefficient(severity, aim, first, default=0.0)}
    texts = []
    for number, (term, value) in enumerate(zip(formula.terms, formula.coefficients, strict=True), 1):
        text = term.text
        for own, inner in term.inner.items():
            text = re.sub(rf"\b{own}\b", f"{own}{number}", text)
            ends = sorted((inner / _NEAR, inner * _NEAR)) if inner else [-1.0, 1.0]
            parameters[f"{own}{number}"] = {
                "unit": inner_units[own], "scale": inner or ends[1], "lower": ends[0], "upper": ends[1],
                "default": inner,
            }  # fmt: skip
        if number > 1:
            parameters[f"a{number}"] = coefficient(
                value / severity, first, dimensions[number - 1], default=value / severity
            )
            text = f"a{number}*{text}"
        texts.append(text)
    whole = f"k*({' + '.join(texts)})" if len(texts) > 1 else f"k*{texts[0]}"
    windy = all(term.text.startswith("V") for term in formula.terms)
    names = set().union(*(term.formula.names for term in formula.terms))
    channel = "damping" if "r" in names else "stiffness" if "b" in names else "forcing"
    return {
        "name": name,
        "channel": "sensor" if formula.of_reading else channel,
        "condition": "wind_on" if windy else "always",
        **({"reading": f"y + {whole}"} if formula.of_reading else {"moment": whole}),
        "summary": "A formula proposed by tunnel diagnose for the residual gap.",
        "parameters": parameters,
    }


def effect_of(table: dict[str, Any]) -> type[Effect]:
    """The class of the effect in a table from `effect_table`, not registered.

    Raises:
        TunnelError: when the effect cannot be stated.
    """
    given = dict(table)
    name = str(given.pop("name"))
    parameters = {
        own: ExpressionParameter(**{**values, "meaning": f"parameter {own}"})
        for own, values in given.pop("parameters").items()
    }
    return expression_effect(name, parameters=parameters, **given)
