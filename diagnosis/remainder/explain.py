"""What could be closed of what an answer leaves: by kind, as a curve, and as a formula."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from diagnosis.answer.held_out import predict_held_out, predict_stretches, turns_of
from diagnosis.closure import KINDS, Ceiling, Closable, Curve, Law, percent
from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.nondimensional import Similarity
from diagnosis.policy import AS_MUCH, COMMON_SHARE, LEAST_CLOSABLE, PLACE_FALSE_ALARM_RATE
from diagnosis.remainder import bases
from diagnosis.remainder.ceiling import Evidence, Unexplained
from diagnosis.remainder.curve import SteadyLine, curve, events, steady_line
from diagnosis.remainder.formula import Proposal, choose, propose
from diagnosis.remainder.ridge import ratio
from diagnosis.search.investigate import Study
from identification.printing import unit_mark, with_std

_BESIDE = 2.0  # standard deviations


def closable(study: Study, *, significant: bool, decided: bool = True) -> Closable | None:
    """Say how much of what the answer leaves could be closed, and by what.

    Args:
        decided: whether the answer is; of an undecided one the whole gap of the nominal model is left.
        significant: whether what remains is beyond chance.

    Returns:
        In the measured campaign's units; None where nothing remains beyond chance, or a random moment is part of
        the answer, beside which anything would be closed.

    Raises:
        LinAlgError: when the equations of a kind cannot be solved.
    """
    left = study.chosen if decided else study.nominal
    if not study.causes or not significant or study.random_answer(study.fitted) is not None:
        return None
    if left.excess <= 0.0:
        return None
    return explain(left, study.similarity, named=study.named and decided)


def explain(left: Fit, similarity: Similarity, *, named: bool) -> Closable:
    """Say how much of what a fit leaves could be closed, and by what.

    Args:
        left: the fit.
        similarity: how its units were made.
        named: whether causes are part of it.
    """
    unexplained = Unexplained(left)
    common = {kind: unexplained.common(kind) for kind in bases.COMMON}
    line = steady_line(unexplained)
    single = {} if line is None else {"line": line.evidence}
    single |= {kind: unexplained.single(kind) for kind in bases.SINGLE}
    kind = chosen_kind(common, single)
    ceilings = tuple(one.ceiling for one in (*common.values(), *single.values()))
    law, shape = None, None
    where: tuple[Mapping[str, Any], ...] = ()
    if kind in common:
        shape = _own_curve(curve(unexplained, common[kind]), similarity)
        law = _law(unexplained, kind, common[kind].drop, similarity)
        kind = _of_formula(kind, law)
    elif line is not None and kind == "line":
        where = tuple(_own_event(one, similarity) for one in line.events)
    elif kind in single:
        where = tuple(
            _own_event(one, similarity) for one in events(unexplained, kind, single[kind].precision)
        )
    excess = left.excess / left.problem.data.runs[0].block
    shown = {one.kind: one for one in ceilings}
    words = _words(kind, shown, law, () if kind == "line" else where, named=named)
    if line is not None and kind == "line":
        words = f"{words} {_line_words(line, similarity)}"
    return Closable(excess, ceilings, kind, words, shape, law, where)


def chosen_kind(common: Mapping[str, Evidence], single: Mapping[str, Evidence]) -> str:
    """The simplest kind that closes about as much as any.

    Args:
        common: kinds whose law holds in every run, the simpler first.
        single: kinds that differ from run to run.

    Returns:
        One of `diagnosis.closure.KINDS`.
    """
    of_all, of_one = (
        max((one.ceiling for one in kinds.values()), key=lambda one: one.closed) for kinds in (common, single)
    )
    if max(of_all.closed, of_one.closed) < LEAST_CLOSABLE:
        return "noise"
    among, best = (common, of_all) if of_all.closed >= COMMON_SHARE * of_one.closed else (single, of_one)
    least = best.closed - max(AS_MUCH, best.std)
    return next(kind for kind, one in among.items() if one.ceiling.closed >= least)


def _of_formula(kind: str, law: Law | None) -> str:
    """The kind, corrected by the formula: few runs may show angle and rate as a function of one of them."""
    formula = "" if law is None else str(law.effect.get("moment", ""))
    other = {"angle": "r", "rate": "b"}.get(kind)
    return "state" if other and re.search(rf"\b{other}\b", formula) else kind


def _law(unexplained: Unexplained, kind: str, drop: float, similarity: Similarity) -> Law | None:
    """The formula of a kind, where one is supported."""
    formula = choose(unexplained, kind, drop)
    proposal = None if formula is None else propose(unexplained, formula, kind)
    if proposal is None:
        return None
    closed, std = _closed_by(proposal.fit, unexplained.fit)
    if closed < LEAST_CLOSABLE:
        return None
    table, values = _own_table(proposal, similarity)
    return Law(table, values, closed, std)


def _closed_by(fitted: Fit, base: Fit) -> tuple[float, float]:
    """Share of what the base leaves that a fit closes, on runs or stretches held out, with its deviation."""
    before, after = (predict_held_out(one).residuals for one in (base, fitted))
    if not before:
        turns = turns_of(base, {run.id for run in base.problem.data.runs})
        before, after = (predict_stretches(one, turns) for one in (base, fitted))
    both = [run for run in before if run in after]
    powers = np.array([[float(r[run] @ r[run]) for run in both] for r in (before, after)])
    sizes = np.array([before[run].size for run in both], np.float64)
    return ratio(np.nan_to_num(powers[0] - powers[1], nan=0.0, neginf=0.0), powers[0] - sizes)


def _own_table(
    proposal: Proposal, similarity: Similarity
) -> tuple[dict[str, Any], dict[str, tuple[float, float]]]:
    """The effect's table and its fitted parameters in the measured campaign's units."""
    table: dict[str, Any] = {**proposal.table}
    own, values = {}, {}
    for place, (name, given) in enumerate(proposal.table["parameters"].items()):
        full, unit = f"{table['name']}.{name}", str(given["unit"])
        value = similarity.own(proposal.fit.value(full), unit)
        low, high = sorted(similarity.own(float(given[end]), unit) for end in ("lower", "upper"))
        own[name] = {
            "unit": unit, "scale": value or similarity.own(float(given["scale"]), unit), "lower": min(low, value),
            "upper": max(high, value), "default": value if place else 0.0,
        }  # fmt: skip
        values[name] = (value, similarity.own(proposal.fit.std(full), unit))
    return table | {"parameters": own}, values


def _own_curve(found: Curve | None, similarity: Similarity) -> Curve | None:
    if found is None:
        return None
    units = {"angle": "rad", "rate": "rad/s", "time": "s"}

    def own(values: tuple[float, ...], unit: str) -> tuple[float, ...]:
        return tuple(float(f"{similarity.own(value, unit):.6g}") for value in values)

    places = tuple(own(axis, units[name]) for name, axis in zip(found.over, found.places, strict=True))
    return Curve(found.over, places, own(found.values, found.unit), own(found.std, found.unit), found.unit)


def _own_event(given: Mapping[str, Any], similarity: Similarity) -> dict[str, Any]:
    times = {name: similarity.own(given[name], "s") for name in ("from_s", "to_s")}
    return {**given, **times}


def _words(
    kind: str,
    ceilings: Mapping[str, Ceiling],
    law: Law | None,
    where: tuple[Mapping[str, Any], ...],
    *,
    named: bool,
) -> str:
    """What could be closed, in a few sentences."""
    left = "what the causes leave" if named else "the gap"
    if kind == "noise":
        most = max(ceilings.values(), key=lambda one: one.closed)
        return (
            f"No more than {percent(max(most.closed, 0.0) + _BESIDE * most.std)} of {left} could be closed by any "
            "smooth moment or error of the reading: the rest is noise."
        )
    best = ceilings[kind]
    said = [
        f"{percent(best.closed, best.std)} of {left} could be closed by {KINDS[kind]}, measured on {best.held_out} "
        "held out of the fit."
    ]
    others = [
        one for one in ceilings.values() if one.held_out == best.held_out and not _includes(one.kind, kind)
    ]
    alike = [one for one in others if one.closed >= best.closed - max(AS_MUCH, best.std)]
    if alike:
        said.append(f"These runs cannot distinguish it from {' or '.join(KINDS[one.kind] for one in alike)}.")
    elif others:
        others_most = max(one.closed for one in others)
        said.append(f"No other kind would close more than {percent(max(others_most, 0.0))}.")
    if where:
        said.append(f"Most of it is in {_places(where)}.")
    if law is not None:
        formula = law.effect.get("moment") or law.effect["reading"]
        said.append(f"The formula {formula} closes {percent(law.closed, law.std)}.")
    return " ".join(said)


def _line_words(line: SteadyLine, similarity: Similarity) -> str:
    def own(values: tuple[float, float], unit: str, factor: float = 1.0) -> str:
        return with_std(*(factor * similarity.own(value, unit) for value in values))

    unit = similarity.reading
    frequency = own((line.frequency, line.frequency_std), "Hz")
    amplitude = own((line.amplitude, line.amplitude_std), unit, 1e3)
    return (
        f"The line is at {frequency} Hz, with an amplitude of {amplitude} m{unit_mark(unit)}, root mean square "
        f"over the runs; chance alone shows one in less than {100.0 * PLACE_FALSE_ALARM_RATE:.2g} % of campaigns."
    )


def _includes(one: str, kind: str) -> bool:
    """Whether a kind is the other or a more general one."""
    return one == kind or (one == "state" and kind in ("angle", "rate"))


def _places(where: tuple[Mapping[str, Any], ...]) -> str:
    first = where[0]
    run = f"run {first['run']} ({first['from_s']:.2f} to {first['to_s']:.2f} s)"
    return run if len(where) == 1 else f"{len(where)} runs, the largest part in {run}"
