"""The remaining gap, its influence on the coefficients, and the part of it that could be explained."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import chdtrc

from diagnosis.findings.finding import Judged, Picture
from diagnosis.findings.hidden import Hidden
from diagnosis.findings.judgements import Estimates
from diagnosis.findings.terms import KINDS, scattering
from diagnosis.likelihood.ceiling import INCLUDED_IN, Ceiling
from diagnosis.model.rig import unit_per_inertia
from diagnosis.noise.gap import gap_test
from diagnosis.remainder.closable import Closable, Curve, Law, Line
from diagnosis.remainder.explain import COMMON_FIRST
from diagnosis.search.answer import UNKNOWN
from diagnosis.search.study import Study
from identification.printing import COEFFICIENTS
from identification.show.blocks import TextTable
from identification.show.drawing import AFTER, BEFORE, NARROW, colour_bar, faded
from identification.show.numbers import (
    alternatives,
    change_up_to,
    joined_mark,
    listed,
    part,
    percent,
    plain,
    significant,
    unit_mark,
    unit_shown,
    with_std,
)
from identification.show.quantity import INTERVAL, Quantity
from identification.show.style import figure, grid, styled
from tunnel_sim.effects.capabilities import AtRandom
from tunnel_sim.effects.registry import known_effects
from tunnel_sim.vocabulary.dimensions import beside
from tunnel_sim.vocabulary.freedom import freedom_of_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MATERIAL_SHARE: Final = 0.01
"""Minimum relative change of a coefficient for the residual gap to be material. Convention. Derivatives are
quoted to one per cent."""

NOISE_STDS: Final = 2.0
"""Margin of the upper bound on the explainable share where the residual is noise, in standard deviations.
Convention."""


@dataclass(frozen=True)
class Move:
    """Move of a coefficient due to the remaining gap.

    Args:
        value: half the excess over chance of the difference between the two most different halves of the data,
            in ``unit``.
        relative: ``value`` over the coefficient's absolute value, a fraction; None where the coefficient is zero.
        std: standard deviation stated for the coefficient, in ``unit``; None where the runs do not determine it.
        material: whether the remainder is significant and moves the coefficient by more than its standard
            deviation or by 1 %.
    """

    value: float
    relative: float | None
    std: float | None
    unit: str
    material: bool = False

    @property
    def most(self) -> float:
        """Upper limit of the move, in ``unit``: its value, or the standard deviation if that is larger."""
        return max(self.value, self.std or 0.0)


@dataclass(frozen=True)
class Remainder:
    """The gap that remains after the named causes; the whole gap where none is named.

    Args:
        significant: whether the remaining gap is beyond chance, by the tests of the gap.
        excess: mean squared scaled residual minus one on held-out readings, in noise variances of a sample.
        p_value: p-value of the strongest test, corrected for the number of tests.
        material: whether the gap is significant and moves a coefficient by more than its standard deviation or
            by 1 %.
        words: the remainder in sentences; empty until they are written.
        further: a significant effect beside the causes that is too small to be named; empty if there is none.
    """

    significant: bool
    excess: float
    p_value: float
    material: bool
    moves: Mapping[str, Move]
    words: str = ""
    further: str = ""

    @property
    def remains(self) -> bool:
        """Whether a part of the gap remains: it is material, or visible in the fit whatever the coefficients do."""
        return self.significant and (self.material or self.excess > 1.0)

    def is_small(self, coefficients: Mapping[str, Quantity]) -> bool:
        """Whether the remaining gap, if any, moves every determined coefficient by 1 % at most."""
        known = {name: move.most for name, move in self.moves.items() if move.std is not None}
        limits = {name: MATERIAL_SHARE * abs(coefficients[name].value) for name in known}
        return not self.significant or all(known[name] <= limit for name, limit in limits.items())

    def in_words(self, judged: Judged) -> str:
        """The remaining gap, in sentences."""
        rest, causes = self, judged.causes
        after, named = judged.coefficients_after, judged.names_effects
        moves, excess, misfit = rest.moves, rest.excess, judged.misfit
        size = f"{misfit.rms_words(excess)} root mean square"
        larger = excess > 1.0
        if larger:
            size = f"{size}, {significant(math.sqrt(excess), 2)} times the noise"
        remaining = f"the residual ({size})" if named else "the gap"
        subject = remaining[0].upper() + remaining[1:]
        if named and larger:
            subject = f"Part of the gap remains: {remaining}"
        material = [name for name, move in moves.items() if move.material]
        known = [name for name, move in moves.items() if move.std is not None]
        if not causes:
            words = "No gap: nothing remains beyond the noise."
        elif not rest.significant:
            words = "The residual is within the noise."
        elif material:
            moved = _each({name: change_up_to(moves[name].value, after[name]) for name in material})
            start = f"Part of the gap remains: {remaining}" if named else subject
            words = f"{start} could change {moved}. Do not trust the coefficients beyond the intervals given."
        elif not known:
            words = f"{subject} changes no coefficient that these runs determine."
        else:
            bounds = _each(
                {name: f"less than {change_up_to(moves[name].most, after[name])}" for name in known}
            )
            start = subject if named or not self.is_small(after) else "The gap is immaterial: it"
            words = f"{start} changes {bounds}."
        if rest.further:
            words += f" {plain(rest.further).capitalize()} is significant, but too small to be named."
        return words


def remainder(
    study: Study, stated: Estimates, moved: Mapping[str, float], excess: float, hidden: Sequence[Hidden] = ()
) -> Remainder:
    """Judge the residual gap of the answer; a gap within chance is never material.

    Coloured noise absorbs a part of the residual that the tests by band cannot see. A significant further
    effect shows it.

    Args:
        stated: the coefficients of the answer's fit with their standard deviations.
        moved: moves of the coefficients by the remainder, by the same names (`coefficient_move`), in their
            units.
        excess: on held-out readings, in noise variances of a sample.
        hidden: the effects that could hide beside the answer; effects without a limit do not count.
    """
    moment, chosen = study.moment, study.settings.answer
    if moment is not None:  # the runs have innovations
        runs = zip(study.chosen.problem.data.runs, study.chosen.residuals, strict=True)
        still = [residual for run, residual in runs if run.id not in moment.process.runs]
        both = np.concatenate([*moment.process.innovations, *still])
        p_value = float(chdtrc(both.size, both @ both))
    elif study.chosen is study.nominal:
        p_value = study.gap.test.p_value
    else:  # no cause changes the tests of the noise itself, so the tests of the residuals count
        noise = study.prepared.noise.rounded(study.chosen, study.prepared.step)
        p_value = gap_test(study.chosen, noise, study.prepared.trend, coarse_step=True).p_value
    hidden = [one for one in hidden if one.size.determined]
    further = max(hidden, key=lambda one: one.significance, default=None) if study.named else None
    by_effect = 1.0 if further is None else min(1.0, len(hidden) * float(chdtrc(1, further.significance**2)))
    shown = further is not None and by_effect < chosen.remains_rate <= p_value
    p_value = min(p_value, by_effect)
    beyond_chance = p_value < chosen.remains_rate
    moves = {}
    for name, given in stated.items():
        relative = moved[name] / abs(given.value) if given.value else None
        # by the standard deviation, or by 1 %, where the runs determine the coefficient
        far = given.std is not None and (moved[name] > given.std or (relative or 0.0) > MATERIAL_SHARE)
        moves[name] = Move(moved[name], relative, given.std, given.unit, material=beyond_chance and far)
    return Remainder(
        significant=beyond_chance,
        excess=excess,
        p_value=p_value,
        material=any(move.material for move in moves.values()),
        moves=moves,
        further=further.effect if shown and further is not None else "",
    )


def _each(sizes: dict[str, str]) -> str:
    """Text: each coefficient with the size of its change."""
    return listed([f"{COEFFICIENTS.get(name, name)} by {size}" for name, size in sizes.items()])


def closable_words(closable: Closable | None, judged: Judged) -> str:
    """A few sentences on the explainable part of the remainder; empty where it is not known."""
    if closable is None:
        return ""
    gap_words = f"the {_gap(judged)}"
    if gap_words == "the gap" and scattering(judged.causes):
        gap_words += " beyond the scatter between runs"
    ceilings = closable.ceilings
    if closable.kind == "noise":
        most = max(
            (ceiling for ceiling in ceilings if ceiling.determined()), key=lambda ceiling: ceiling.closed
        )
        bound = percent(max(most.closed, 0.0) + NOISE_STDS * most.std)
        return (
            f"No smooth moment or error of the reading could explain more than {bound} of {gap_words}: the rest is "
            "noise."
        )
    of_others = _measured_otherwise(closable.kind, ceilings)
    largest = _largest(closable, ceilings, gap_words, per_inertia="omega_n" in judged.coefficients_after)
    return " ".join([*largest, *of_others, *_line(closable.line)])


def _largest(
    closable: Closable, ceilings: Sequence[Ceiling], gap_words: str, *, per_inertia: bool
) -> list[str]:
    """The share that this kind explains beyond the other kinds, its place, and its formula.

    Args:
        per_inertia: whether moments are per unit inertia.
    """
    kind, where, law = closable.kind, closable.events, closable.law
    best = next(ceiling for ceiling in ceilings if ceiling.kind == kind)
    measured = "measured" if law is None else "estimated without a formula,"
    sentences = [
        f"{_as_subject(kind)} could explain {percent(best.closed, best.std)} of {gap_words} ({measured} on "
        f"held-out {best.held_out})."
    ]
    if closable.alike:
        sentences.append(
            f"These runs cannot distinguish it from {alternatives([KINDS[other] for other in closable.alike])}."
        )
    elif closable.next_most is not None:
        beside = [one for one in ceilings if one.held_out == best.held_out]
        alike, known = len(beside) == len(ceilings), all(one.determined() for one in beside)
        which = [] if alike else [f"measured on {best.held_out}"]
        which += [] if known else ["with a share that is determined"]
        more = f"more than {percent(closable.next_most)}" if closable.next_most > 0.0 else "any of it"
        wider = [
            one for one in beside if one.kind == INCLUDED_IN.get(kind) and one.closed > closable.next_most
        ]
        apart = f"Apart from {KINDS[wider[0].kind]}, which includes it, no" if wider else "No"
        sentences.append(f"{' '.join([apart, 'other kind', *which])} would explain {more}.")
    if where and kind != "line":
        run = f"run {where[0]['run']} ({where[0]['from_s']:.2f} to {where[0]['to_s']:.2f} s)"
        largest = "" if len(where) == 1 else f"{len(where)} runs, the largest part in "
        sentences.append(f"Most of it is in {largest}{run}.")
    if law is not None:
        formula = law.effect.get("moment") or law.effect["reading"]
        explains = percent(law.closed, law.std)
        sentences.append(f"The formula {formula} explains {explains}{_with_values(law, per_inertia)}.")
    return sentences


def _as_subject(kind: str) -> str:
    """A kind of law at the start of a sentence; a comma closes an apposition, but no list."""
    name = KINDS[kind]
    return name.capitalize() + ("," if ", " in name and " or " not in name else "")


def _with_values(law: Law, per_inertia: bool) -> str:
    """The numbers of a formula, as a clause; empty where it has none.

    Args:
        per_inertia: whether no inertia is stated or identified, so that moments are per unit inertia.
    """
    stated, determined, unknown = law.effect.get("parameters", {}), [], []
    for name, (value, std) in law.parameters.items():
        if not 0.0 < std < _UNKNOWN * abs(value):
            unknown.append(name)
            continue
        unit = stated.get(name, {}).get("unit", "1")
        unit = unit_per_inertia(unit) if per_inertia else unit
        determined.append(f"{name} = {with_std(value, std)}{unit_mark(beside(unit))}")
    undetermined = f"{listed(unknown)} not determined by these runs" if unknown else ""
    return (
        f", with {listed([*determined, *filter(None, [undetermined])])}" if determined or undetermined else ""
    )


_UNKNOWN = 10.0  # standard deviations over the value: neither sign nor order of magnitude is known


def formula_line(found: Closable | None, judged: Judged) -> str:
    """How to test the formula of the remainder, or a suspected effect; empty if there is neither."""
    if found is None or found.law is None:
        suspect = "State the suspected effect in a file, and diagnose again with --effects-file."
        return suspect if judged.causes == UNKNOWN and not judged.cycling else ""
    return (
        "Write the formula as an effect with --propose FILE, and diagnose again with --effects-file FILE: its "
        "probability among the known effects tells whether it is the cause."
    )


def _measured_otherwise(kind: str, ceilings: Sequence[Ceiling]) -> list[str]:
    """The kind that explains more than the named one on other held-out readings, and why it is not named.

    Empty where no kind does.
    """
    best = next(one for one in ceilings if one.kind == kind)
    others = (one for one in ceilings if one.determined() and one.held_out != best.held_out)
    most = max(others, key=lambda one: one.closed, default=best)
    if most.closed <= best.closed:
        return []
    return [
        f"{_as_subject(most.kind)} would explain {percent(most.closed, most.std)}, measured on "
        f"{most.held_out}. A law common to all runs is preferred if it explains {part(COMMON_FIRST)} of "
        "that share or more, since it can be a property of the rig."
    ]


def _line(line: Line | None) -> list[str]:
    """A steady line, in a sentence; none without one."""
    if line is None:
        return []
    frequency = with_std(line.frequency_hz, line.frequency_std_hz)
    mark, factor = unit_shown(line.unit)
    amplitude = with_std(factor * line.amplitude, factor * line.amplitude_std)
    amplitude += joined_mark(mark)
    return [
        f"The line is at {frequency} Hz. Its amplitude is {amplitude} (root mean square over the runs). Chance "
        "alone shows a line in less than "
        f"{100.0 * line.false_alarm_rate:.2g} % of campaigns."
    ]


def closable_title(judged: Judged) -> str:
    """The heading of the explainable part; without a decided cause, the residual gap is the whole gap."""
    return f"What could explain the {_gap(judged)}"


def _gap(judged: Judged) -> str:
    return "residual gap" if judged.causes != UNKNOWN and judged.decided else "gap"


def closable_line(found: Closable | None, rest: Remainder | None, judged: Judged) -> str:
    """The explainable part, in a line; empty without a gap, or where it is not known."""
    if found:
        return f"{closable_title(judged)}: {found.words}"
    if rest is None or not judged.causes:
        return ""
    if not rest.significant:
        return f"{closable_title(judged)}: nothing beyond chance (p = {rest.p_value:.2g})."
    if any(issubclass(kind, AtRandom) for kind in known_effects() if kind.name in judged.causes):
        return f"{closable_title(judged)}: not stated, since any law would explain part of a random moment."
    return ""


def closable_table(found: Closable | None, judged: Judged) -> TextTable:
    """Share of the remainder that each kind could explain, in per cent, the named kind first.

    A table without rows where the remainder is within chance.
    """
    kind = "" if found is None else found.kind
    ceilings = sorted(found.ceilings if found else (), key=lambda one: one.kind != kind)
    rows = [
        (
            KINDS[one.kind],
            percent(max(one.closed, 0.0), one.std) if one.determined() else "not determined",
            one.held_out,
        )
        for one in ceilings
    ]
    title = f"Share of the {_gap(judged)} that each kind of law could explain, estimated without a formula"
    return TextTable(title, ("kind of law", "share", "held out"), tuple(rows), ("share",))


def law_pictures(closable: Closable | None, reading: str) -> tuple[Picture, ...]:
    """The figure of a law without a formula; none with a formula.

    Args:
        reading: unit of the readings.
    """
    if closable is None or closable.curve is None:
        return ()
    caption = (
        "The missing law, estimated without a formula, with its 95 % band. White cells of a map are within the "
        "band. The part that the coefficients and the zero of the model absorb is subtracted."
    )
    description = "The missing moment, or error of the reading, as a curve with its band or as a map."
    return (Picture("law", caption, description, partial(law_figure, closable.curve, reading)),)


@styled
def law_figure(curve: Curve, reading: str) -> Figure:
    """The law without a formula, with its 95 % band; in a map, white cells are within it.

    Args:
        reading: unit of the readings.
    """
    units = freedom_of_unit(reading).shown
    motion, rate = [*units.values()][:2]
    shape = [len(axis) for axis in curve.places]
    unit, factor = units.get(curve.unit, (curve.unit, 1.0))  # moments keep their unit
    values, std = (factor * np.reshape(given, shape) for given in (curve.values, curve.std))
    name = f"{'error of the reading' if curve.unit == next(iter(units)) else 'missing moment'} [{unit}]"
    axes_by_name = {
        "angle": (f"angle [{motion[0]}]", motion[1]),
        "rate": (f"rate [{rate[0]}]", rate[1]),
        "time": ("time since the start [s]", 1.0),
    }
    (label, *others), scales = zip(*(axes_by_name[axis] for axis in curve.over), strict=True)
    places = [scale * np.asarray(axis) for scale, axis in zip(scales, curve.places, strict=True)]
    fig = figure(NARROW, 3.2)
    axes = fig.add_subplot()
    axes.set_xlabel(label)
    if len(shape) == 1:
        (place,), band = places, INTERVAL * std
        axes.fill_between(place, values - band, values + band, color=AFTER, alpha=0.25, lw=0)
        axes.plot(place, values, color=AFTER)
        axes.set_ylabel(name)
        grid(axes)
        return fig
    reach = float(np.max(np.abs(values))) or 1.0
    shown = np.where(np.abs(values) > INTERVAL * std, values, np.nan)
    colours = faded(AFTER, BEFORE)
    mesh = axes.pcolormesh(*places, shown.T, cmap=colours, vmin=-reach, vmax=reach, shading="nearest")
    axes.set_ylabel(*others)
    colour_bar(fig, mesh, axes, label=name)
    return fig
