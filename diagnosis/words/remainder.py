"""The remaining gap, and the part of it that could be explained, in sentences."""

from __future__ import annotations

import math
from collections.abc import Sequence

from diagnosis.findings.misfit import misfit_of, rms_shown
from diagnosis.findings.terms import KINDS, scattering
from diagnosis.findings.whole import Findings
from diagnosis.likelihood.ceiling import Ceiling
from diagnosis.remainder.closable import Closable, Law, Line
from diagnosis.search.weigh import UNKNOWN
from identification.printing import COEFFICIENTS
from identification.show.numbers import (
    change_up_to,
    left_over,
    listed,
    part,
    percent,
    plain,
    significant,
    unit_mark,
    unit_shown,
    with_std,
)
from tunnel_sim.effects import known_effects
from tunnel_sim.vocabulary.dimensions import beside


def rest_words(answer: Findings) -> str:
    """The remaining gap, in sentences; empty for a document without it."""
    rest, causes = answer.rest, answer.causes
    if rest is None:
        return ""
    after, named = answer.coefficients.after, answer.names_effects
    moves, excess, misfit = rest.moves, rest.excess, misfit_of(answer)
    size = left_over(excess) if misfit is None else f"{rms_shown(misfit, excess)} root mean square"
    larger = excess > 1.0  # than the noise: people see it in the fit, whatever it does to the coefficients
    if larger and misfit is not None:
        size = f"{size}, {significant(math.sqrt(excess), 2)} times the noise"
    left = f"the residual ({size})" if named else "the gap"
    subject = f"Part of the gap remains: {left}" if named and larger else left[0].upper() + left[1:]
    material = [name for name, move in moves.items() if move.material]
    known = [name for name, move in moves.items() if move.std is not None]
    if not causes:
        words = "No gap: nothing remains beyond the noise."
    elif not rest.significant:
        words = "The residual is within the noise."
    elif material:
        moved = _each({name: change_up_to(moves[name].value, after[name]) for name in material})
        start = f"Part of the gap remains: {left}" if named else subject
        words = f"{start} could change {moved}. Do not trust the coefficients beyond the intervals given."
    elif not known:
        words = f"{subject} changes no coefficient that these runs determine."
    else:
        most = {name: max(moves[name].value, moves[name].std or 0.0) for name in known}
        bounds = _each({name: f"less than {change_up_to(size, after[name])}" for name, size in most.items()})
        words = f"{subject} changes {bounds}." if named else f"The gap is immaterial: it changes {bounds}."
    if rest.further:
        words += f" {plain(rest.further).capitalize()} is significant, but too small to be named."
    return words


def _each(sizes: dict[str, str]) -> str:
    """Coefficients with the sizes of their changes."""
    return listed([f"{COEFFICIENTS.get(name, name)} by {size}" for name, size in sizes.items()])


def closable_words(answer: Findings) -> str:
    """The part of the remainder that could be explained, in a few sentences; empty where it is not known."""
    closable = answer.closable
    if closable is None:
        return ""
    named = answer.causes != UNKNOWN and answer.decision.decided
    beyond = " beyond the scatter between runs" if scattering(answer.causes) else ""
    left = "the residual gap" if named else f"the gap{beyond}"
    ceilings = closable.ceilings
    if closable.kind == "noise":
        chosen = answer.settings.remainder
        most = max((one for one in ceilings if one.determined(chosen)), key=lambda one: one.closed)
        bound = percent(max(most.closed, 0.0) + chosen.noise_stds * most.std)
        return (
            f"No smooth moment or error of the reading could explain more than {bound} of {left}: the rest is "
            "noise."
        )
    of_others = _measured_otherwise(answer, closable.kind, ceilings)
    return " ".join([*_largest(closable, ceilings, left), *of_others, *_line(closable.line)])


def _largest(found: Closable, ceilings: Sequence[Ceiling], left: str) -> list[str]:
    """The share of the kind beside those of the others, its place, and its formula."""
    kind, where, law = found.kind, found.events, found.law
    best = next(one for one in ceilings if one.kind == kind)
    sentences = [
        f"{KINDS[kind].capitalize()} could explain {percent(best.closed, best.std)} of {left} (measured on "
        f"held-out {best.held_out})."
    ]
    if found.alike:
        sentences.append(
            f"These runs cannot distinguish it from {' or '.join(KINDS[one] for one in found.alike)}."
        )
    elif found.next_most is not None:
        alike = all(one.held_out == best.held_out for one in ceilings)
        other = f"No other kind{'' if alike else f' measured on {best.held_out}'}"
        sentences.append(f"{other} would explain more than {percent(max(found.next_most, 0.0))}.")
    if where and kind != "line":
        run = f"run {where[0]['run']} ({where[0]['from_s']:.2f} to {where[0]['to_s']:.2f} s)"
        largest = "" if len(where) == 1 else f"{len(where)} runs, the largest part in "
        sentences.append(f"Most of it is in {largest}{run}.")
    if law is not None:
        formula = law.effect.get("moment") or law.effect["reading"]
        explains = percent(law.closed, law.std)
        sentences.append(f"The formula {formula} explains {explains}{_with_values(law)}.")
    return sentences


def _with_values(law: Law) -> str:
    """The numbers of a formula, as a clause; empty where it has none."""
    stated, said, unknown = law.effect.get("parameters", {}), [], []
    for name, (value, std) in law.parameters.items():
        if not 0.0 < std < _UNKNOWN * abs(value):
            unknown.append(name)
            continue
        unit = stated.get(name, {}).get("unit", "1")
        said.append(f"{name} = {with_std(value, std)}{unit_mark(beside(unit))}")
    left = f"{listed(unknown)} not determined by these runs" if unknown else ""
    return f", with {listed([*said, *filter(None, [left])])}" if said or left else ""


_UNKNOWN = 10.0  # standard deviations over the value: neither sign nor order of magnitude is known


def formula_step(answer: Findings) -> str:
    """How to try the formula of the remainder, without a full stop; empty where there is none."""
    found = answer.closable
    if found is None or found.law is None:
        return ""
    return (
        "Write the formula as an effect with --propose FILE, and diagnose again with --effects-file FILE: its "
        "probability among the known effects tells whether it is the cause"
    )


def _measured_otherwise(answer: Findings, kind: str, ceilings: Sequence[Ceiling]) -> list[str]:
    """The kind that explains more than the named one, on other held-out readings, and why it is not named.

    Empty where no kind does.
    """
    chosen = answer.settings.remainder
    best = next(one for one in ceilings if one.kind == kind)
    others = (one for one in ceilings if one.determined(chosen) and one.held_out != best.held_out)
    most = max(others, key=lambda one: one.closed, default=best)
    if most.closed <= best.closed:
        return []
    return [
        f"{KINDS[most.kind].capitalize()} would explain {percent(most.closed, most.std)}, measured on "
        f"{most.held_out}. A law common to all runs is preferred if it explains {part(chosen.common_first)} of "
        "that share or more, since it can be a property of the rig."
    ]


def _line(found: Line | None) -> list[str]:
    """A steady line, in a sentence; none without one."""
    if found is None:
        return []
    frequency = with_std(found.frequency_hz, found.frequency_std_hz)
    mark, factor = unit_shown(found.unit)
    amplitude = with_std(factor * found.amplitude, factor * found.amplitude_std)
    amplitude += mark if mark == "°" else f" {mark}"
    return [
        f"The line is at {frequency} Hz. Its amplitude is {amplitude} (root mean square over the runs). Chance "
        "alone shows a line in less than "
        f"{100.0 * found.false_alarm_rate:.2g} % of campaigns."
    ]


_LABEL = "What could explain the residual gap"


def closable_line(answer: Findings) -> str:
    """The part that could be explained, in a line; empty where there is no gap, or it is not known."""
    if found := answer.closable:
        return f"{_LABEL}: {found.words}"
    rest = answer.rest
    if not rest or not answer.causes:
        return ""
    if not rest.significant:
        return f"{_LABEL}: nothing beyond chance (p = {rest.p_value:.2g})."
    if any(kind.random for kind in known_effects() if kind.name in answer.causes):
        return f"{_LABEL}: not stated, since any law would explain part of a random moment."
    return ""
