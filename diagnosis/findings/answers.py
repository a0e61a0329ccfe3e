"""The answers considered, with their probabilities and parameters: tables and a figure."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from diagnosis.findings.candidates import Candidate
from diagnosis.findings.finding import Judged, Picture
from diagnosis.findings.repeatability import RunRepeatability
from diagnosis.findings.terms import answer_name, scattering
from identification.show.blocks import TextTable
from identification.show.drawing import ACCENT, NARROW, QUIET
from identification.show.numbers import (
    estimated,
    explained,
    held_out_excess,
    plain,
    probability,
    share,
    unit_mark,
)
from identification.show.quantity import Quantity
from identification.show.style import figure, grid, styled
from tunnel_sim.vocabulary.dimensions import beside

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ANSWERS_LISTED: Final = 6
"""Maximum number of answers in a table. Judgement."""
ANSWER_LISTED: Final = 0.005
"""Minimum probability of an answer in a table. Judgement."""
ANSWER_DRAWN: Final = 0.01
"""Minimum probability of an answer in the charts of the report. Judgement."""


def ranked(candidates: Sequence[Candidate]) -> list[Candidate]:
    """The answers of a document, the most probable first.

    The document starts with its answer. If undecided, that is the most probable set of effects, and an unknown
    cause may be more probable.
    """
    return sorted(candidates, key=lambda one: -one.probability)


def candidates_table(
    candidates: Sequence[Candidate], repeated: RunRepeatability, judged: Judged
) -> TextTable:
    """The answers considered and their shares of the gap, most probable first; a last row counts the others."""
    rows, given = [], ranked(candidates)
    probable = [c for c in given[:ANSWERS_LISTED] if c.probability >= ANSWER_LISTED]
    shown = probable or given[:1]
    for candidate in shown:
        fitted = candidate.effect not in ("none", "unknown")
        closed = share(candidate.closed) if fitted else "–"
        name = answer_name(candidate.effect).replace(" + ", " +\n")
        parameters = "\n".join(
            f"{plain(full).replace('.', ': ')} = {_estimate(repeated, full, candidate.effect, given)}"
            for full, given in candidate.parameters.items()
        )
        excess = held_out_excess(candidate.excess_after)
        rows.append((name, probability(candidate.probability), closed, excess, parameters))
    if others := given[len(shown) :]:
        together = sum(candidate.probability for candidate in others)
        rows.append((f"{len(others)} more, together", probability(together), "", "", ""))
    detail = ("residual [× noise variance]", "parameters")
    heads = ("answer", "probability", "explained in the fit", *detail)
    return TextTable(
        f"Answers for {judged.campaign}",
        heads,
        tuple(rows),
        heads[1:4],
        names=("answer",),
        detail=detail,
    )


def _estimate(repeated: RunRepeatability, full: str, candidate: str, given: Quantity) -> str:
    """A parameter of an answer, by its full name."""
    mark = unit_mark(beside(given.unit, ""))
    return repeated.spread_estimate(full.rpartition(".")[0] or candidate, given) or estimated(given, mark)


def parameters_table(first: Candidate, repeated: RunRepeatability, judged: Judged) -> TextTable:
    """The parameters of the answer; a table without rows where it has none."""
    rows, effect = [], ""
    for full, given in first.parameters.items():
        owner, _, name = full.rpartition(".")
        owner = owner or first.effect
        size = _estimate(repeated, full, first.effect, given)
        rows.append((owner if owner != effect else "", name, size))
        effect = owner
    whose = "Parameters" if judged.decided else f"Parameters of the {judged.set_out}"
    units = explained({given.unit for given in first.parameters.values()})
    heads = ("effect", "parameter", "estimate")
    return TextTable(f"{whose} ± one standard deviation{units}", heads, tuple(rows), names=heads[:2])


def inclusion_line(inclusion: Mapping[str, float], least: float) -> str:
    """The effects that may be among the causes, most probable first; empty where none is probable enough.

    Args:
        inclusion: by effect, the probability that it is among the causes.
        least: probability of an effect that is listed.
    """
    likely = dict(sorted(inclusion.items(), key=lambda item: -item[1]))
    names = [name for name, value in likely.items() if value >= least]
    last = scattering(names)  # scatter is common to every answer
    ordered = [*(name for name in names if name not in last), *last]
    shown = [f"{plain(name)} {probability(likely[name])}" for name in ordered]
    return f"Among the causes, with probability: {', '.join(shown)}." if shown else ""


SHOWN = 8
"""Most answers drawn."""


_LABEL = 24  # characters in a line of a label


def candidates_pictures(candidates: Sequence[Candidate]) -> tuple[Picture, ...]:
    """The likely answers."""
    drawn = Picture(
        "which",
        "Probability of the likely answers. The possible answers are: no gap, every fitted set of effects, and "
        "unknown.",
        "Bars: probability of each answer.",
        partial(candidates_figure, candidates),
    )
    return (drawn,)


@styled
def candidates_figure(candidates: Sequence[Candidate]) -> Figure | None:
    """The answers that are not improbable; None for fewer than two, where words suffice."""
    shown = [c for c in ranked(candidates)[:SHOWN] if c.probability >= ANSWER_DRAWN]
    if len(shown) < 2:
        return None
    names = [textwrap.fill(plain(answer_name(candidate.effect)), _LABEL) for candidate in shown]
    fig = figure(NARROW, 0.7 + 0.3 * len(shown) + 0.15 * sum(name.count("\n") for name in names))
    axes = fig.add_subplot()
    values = [candidate.probability for candidate in shown]
    colours = [ACCENT if candidate is candidates[0] else QUIET for candidate in shown]
    axes.barh(range(len(shown)), values, color=colours, height=0.6)
    for index, value in enumerate(values):
        axes.text(value + 0.01, index, probability(value), va="center")
    axes.set_yticks(range(len(shown)), names)
    axes.invert_yaxis()
    axes.set(xlim=(0.0, 1.12), xticks=np.linspace(0.0, 1.0, 6), xlabel="probability")
    grid(axes, "x")
    return fig
