"""The sparsest formula that explains what is left, chosen on held-out runs and fitted like any effect."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from scipy.special import chdtri

from diagnosis.fitting.least_squares import Fit, FitError, fit
from diagnosis.fitting.problem import Point
from diagnosis.law.ceiling import Rest
from diagnosis.law.library import Term, terms
from diagnosis.law.ridge import Normal, Ridge, held_out, total
from diagnosis.policy import LAW_FALSE_RATE, LAW_REACHES, LAW_TERM_SHARE
from tunnel_sim.effects import Effect, known_effects
from tunnel_sim.effects.expression_effect import Quantity, expression_effect
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.units import dimension, dimension_text, product

_MOST_TERMS = 3
_TRIED = 10  # terms of the greatest drop of χ² that are tried on held-out runs
_FAR = 1e3  # bounds of a coefficient, in its first value
_NEAR = 4.0  # bounds of a width or place, likewise
_READING_KINDS = ("reading",)


@dataclass(frozen=True, eq=False)
class Formula:
    """A sum of terms with coefficients.

    Args:
        terms: in the order in which they were found.
        coefficients: of each, in N m, or rad for a reading, over the term's own unit.
        of_reading: whether it is an error of the reading.
        delta: steps of the fit's common parameters that go with it, in their units, shape (common,).
        gained: drop of χ² on held-out runs, dimensionless.
    """

    terms: tuple[Term, ...]
    coefficients: tuple[float, ...]
    of_reading: bool
    delta: Array
    gained: float


@dataclass(frozen=True, eq=False)
class Proposal:
    """A formula as an effect, fitted.

    Args:
        kind: the effect's class.
        table: the same as the table of an effects file, in the units of the fit.
        fit: of the answer with the effect added.
    """

    kind: type[Effect]
    table: dict[str, Any]
    fit: Fit


def choose(rest: Rest, kind: str, closable: float) -> Formula | None:
    """Find the terms, one after another.

    Args:
        rest: what is left.
        kind: of `diagnosis.closable.KINDS`.
        closable: drop of χ² on held-out runs that the kind's own basis reaches.

    Returns:
        The formula; None where no term is supported: by chance alone one would be in `LAW_FALSE_RATE` of the
        campaigns, and it must predict held-out runs.
    """
    found = _chosen(rest, kind, closable)
    if kind in ("angle", "rate") and (found is None or found.gained < LAW_REACHES * closable):
        wider = _chosen(rest, "state", closable)
        found = found if wider is None or (found and found.gained >= wider.gained) else wider
    return found


def _chosen(rest: Rest, kind: str, closable: float) -> Formula | None:
    candidates = _with_factors(rest, kind)
    if not candidates:
        return None
    of_reading = kind in _READING_KINDS
    if of_reading and rest.paths[0].run.derivative:
        return None  # an effect's reading is an angle
    columns = [_columns(rest, candidates, index, of_reading) for index in range(len(rest.paths))]
    size = np.maximum(np.max([np.max(np.abs(c), axis=0) for c in columns], axis=0), 1e-300)
    parts = rest.normals([c / size for c in columns])
    chosen, gained = _greedy(rest, parts, len(candidates), closable)
    while sum(1 + len(candidates[i].inner) for i in chosen) > limits.OWN_PARAMETERS:
        chosen.pop()
    if not chosen:
        return None
    whole = _of(total(parts), chosen)
    solution = Ridge(whole, 0.0).solution
    common = rest.size.size
    return Formula(
        tuple(candidates[i] for i in chosen),
        tuple(float(v) for v in solution[common:] / size[chosen]),
        of_reading,
        solution[:common] / rest.size,
        gained,
    )


def _with_factors(rest: Rest, kind: str) -> list[Term]:
    """The terms of a kind: with the wind, or as they are and, those of the angle, in proportion to the spring."""
    found = terms(kind, rest.ranges)
    if kind == "wind":
        fast = [Term("V*" + term.text, term.inner) for term in found if "r" in term.formula.names]
        return [Term("V^2*" + term.text, term.inner) for term in found] + fast
    if kind in _READING_KINDS or len({path.stiffness for path in rest.paths}) == 1:
        return found
    return found + [Term("Kr*" + term.text, term.inner) for term in found if "b" in term.formula.names]


def _columns(rest: Rest, candidates: Sequence[Term], index: int, of_reading: bool) -> Array:
    """Responses to every term in one run, shape (rows, terms)."""
    path = rest.paths[index]
    places: dict[str, float | Array] = {
        "b": path.angle, "y": path.angle, "r": path.rate, "t": path.time, "V": path.speed,
        "Kr": path.stiffness, "omega": path.still_omega,
    }  # fmt: skip
    shape = path.angle.shape
    values = np.column_stack([np.broadcast_to(term.value(places), shape) for term in candidates])
    return path.seen(values) if of_reading else path.response(values)


def _of(whole: Normal, chosen: Sequence[int]) -> Normal:
    """The normal equations of the model's parameters and some of the terms, none with a prior."""
    keep = [*range(whole.free), *(whole.free + i for i in chosen)]
    return Normal(whole.matrix[np.ix_(keep, keep)], whole.gradient[keep], whole.power, len(keep))


def _greedy(rest: Rest, parts: Sequence[Normal], count: int, closable: float) -> tuple[list[int], float]:
    """Terms added as long as each pays on held-out runs."""
    whole = total(parts)
    threshold = float(chdtri(1, LAW_FALSE_RATE / count))
    before = float(rest.before[rest.seen].sum())
    chosen: list[int] = []
    gained = 0.0
    while len(chosen) < _MOST_TERMS and gained < LAW_REACHES * closable:
        drops = _drops(whole, chosen)
        order = [int(i) for i in np.argsort(-drops)[:_TRIED] if drops[i] > threshold]
        tried = []
        for i in order:
            some = [_of(part, [*chosen, i]) for part in parts]
            after = held_out(some, rest.groups, None)
            tried.append((before - float(after[rest.seen].sum()), i))
        if not tried or max(tried)[0] - gained < max(LAW_TERM_SHARE * closable, threshold):
            break
        gained, best = max(tried)
        chosen.append(best)
    return chosen, gained


def _drops(whole: Normal, chosen: Sequence[int]) -> Array:
    """Drop of χ² by each further term, shape (terms,)."""
    c = whole.free
    known = [*range(c), *(c + i for i in chosen)]
    inner = whole.matrix[np.ix_(known, known)]
    size = np.sqrt(np.maximum(np.diag(inner), 1e-300))
    cross = whole.matrix[np.ix_(known, range(c, len(whole.matrix)))] / size[:, None]
    inverse = np.linalg.pinv(inner / np.outer(size, size), rcond=1e-11, hermitian=True)
    solved = inverse @ cross
    own = np.diag(whole.matrix)[c:]
    left = own - np.sum(cross * solved, axis=0)
    along = whole.gradient[c:] - solved.T @ (whole.gradient[known] / size)
    # what the others explain to within rounding gains nothing
    return np.where(left > 1e-6 * np.maximum(own, 1e-300), along**2 / np.maximum(left, 1e-300), 0.0)


def propose(rest: Rest, formula: Formula, kind: str) -> Proposal | None:
    """Fit a formula like any other effect.

    Args:
        rest: what is left, whose fit the effect is added to.
        formula: from `choose`.
        kind: of `diagnosis.closable.KINDS`; names the effect.

    Returns:
        The effect and its fit; None where the fit fails.
    """
    table = effect_table(formula, _free_name(f"proposed_{kind}"))
    try:
        effect = effect_of(table)
    except TunnelError:
        return None
    base = rest.fit
    start_of = {name: float(q["default"] or q["scale"]) for name, q in table["parameters"].items()}
    problem = dataclasses.replace(base.problem, effects=(*base.problem.effects, effect))
    own = np.array([start_of[name.split(".")[1]] for name in problem.names[len(base.problem.names) :]])
    common = base.point.common + formula.delta
    found = []
    for first in (common, base.point.common):
        with suppress(FitError, np.linalg.LinAlgError):
            found.append(fit(problem, Point(np.concatenate([first, own]), base.point.release)))
            if found[-1].excess < (1.0 - LAW_REACHES) * base.excess:
                break
    best = min((f for f in found if np.isfinite(f.total)), key=lambda f: f.total, default=None)
    return None if best is None or best.total >= base.total else Proposal(effect, table, best)


def _free_name(name: str) -> str:
    """The name, or with a number where it is an effect's already."""
    taken = {kind.name for kind in known_effects()}
    numbered = (f"{name}_{number}" for number in range(2, len(taken) + 3))
    return next(free for free in chain((name,), numbered) if free not in taken)


def effect_table(formula: Formula, name: str) -> dict[str, Any]:
    """A formula as the table of an effects file.

    Args:
        formula: of the fit's units.

    Returns:
        The table, its values those of the formula.
    """
    aim = dimension("rad" if formula.of_reading else "N m")
    first, severity = formula.terms[0], formula.coefficients[0]
    parameters: dict[str, dict[str, object]] = {
        "k": _coefficient(severity, dimension_text(product(aim, first.dimension, -1.0)), severity=True)
    }
    texts = []
    for number, (term, value) in enumerate(zip(formula.terms, formula.coefficients, strict=True), 1):
        text = term.text
        for own, inner in term.inner.items():
            text = re.sub(rf"\b{own}\b", f"{own}{number}", text)
            parameters[f"{own}{number}"] = _inner(inner, term.units[own])
        if number > 1:
            ratio = product(first.dimension, term.dimension, -1.0)
            parameters[f"a{number}"] = _coefficient(value / severity, dimension_text(ratio))
            text = f"a{number}*{text}"
        texts.append(text)
    whole = " + ".join(texts)
    whole = f"k*({whole})" if len(texts) > 1 else f"k*{whole}"
    windy = all(term.text.startswith("V") for term in formula.terms)
    names = set().union(*(term.formula.names for term in formula.terms))
    return {
        "name": name,
        "channel": "sensor" if formula.of_reading else _channel(names),
        "condition": "wind_on" if windy else "always",
        **({"reading": f"y + {whole}"} if formula.of_reading else {"moment": whole}),
        "summary": "A formula that tunnel diagnose proposed for what no effect explains.",
        "parameters": parameters,
    }


def _channel(names: set[str]) -> str:
    if "r" in names:
        return "damping"
    return "stiffness" if "b" in names else "forcing"


def _coefficient(value: float, unit: str, *, severity: bool = False) -> dict[str, object]:
    bound = _FAR * abs(value)
    return {
        "unit": unit, "scale": value, "lower": -bound, "upper": bound, "default": 0.0 if severity else value,
    }  # fmt: skip


def _inner(value: float, unit: str) -> dict[str, object]:
    ends = sorted((value / _NEAR, value * _NEAR)) if value else [-1.0, 1.0]
    return {"unit": unit, "scale": value or ends[1], "lower": ends[0], "upper": ends[1], "default": value}


def effect_of(table: dict[str, Any]) -> type[Effect]:
    """The class of an effect that a table of an effects file states.

    Args:
        table: from `effect_table`.

    Returns:
        The class, not registered.

    Raises:
        TunnelError: when the effect cannot be stated.
    """
    given = dict(table)
    name = str(given.pop("name"))
    parameters = {
        own: Quantity(**{**values, "meaning": f"parameter {own}"})
        for own, values in given.pop("parameters").items()
    }
    return expression_effect(name, parameters=parameters, **given)
