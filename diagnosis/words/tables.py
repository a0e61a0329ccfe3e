"""The tables of a diagnosis, from its document. Columns for which only a page has room are details."""

from __future__ import annotations

from collections.abc import Sequence

from diagnosis.findings.terms import answer_name
from diagnosis.findings.whole import Findings
from diagnosis.words.answers import ranked
from identification.show.blocks import TextTable
from identification.show.numbers import (
    estimated,
    explained,
    held_out_excess,
    plain,
    probability,
    share,
    significant,
    unit_mark,
)
from identification.show.quantity import Quantity
from tunnel_sim.vocabulary.dimensions import beside


def candidates_table(answer: Findings) -> TextTable:
    """The answers considered and their shares of the gap, most probable first; a last row counts the others."""
    rows, given, chosen = [], ranked(answer), answer.settings.words
    probable = [c for c in given[: chosen.answers_listed] if c.probability >= chosen.answer_listed]
    shown = probable or given[:1]
    for candidate in shown:
        fitted = candidate.effect not in ("none", "unknown")
        closed = share(candidate.closed) if fitted else "–"
        name = answer_name(candidate.effect).replace(" + ", " +\n")
        parameters = "\n".join(
            f"{plain(full).replace('.', ': ')} = {_estimate(answer, full, candidate.effect, given)}"
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
        f"Answers for {answer.campaign}",
        heads,
        tuple(rows),
        heads[1:4],
        names=("answer",),
        detail=detail,
    )


def _estimate(answer: Findings, full: str, candidate: str, given: Quantity) -> str:
    """A parameter of an answer, by its full name."""
    mark = unit_mark(beside(given.unit, ""))
    return answer.repeated.spread_estimate(full.rpartition(".")[0] or candidate, given) or estimated(
        given, mark
    )


def parameters_table(answer: Findings) -> TextTable:
    """The parameters of the answer; a table without rows where it has none."""
    first = answer.candidates[0]
    rows, effect = [], ""
    for full, given in first.parameters.items():
        owner, _, name = full.rpartition(".")
        owner = owner or first.effect
        size = _estimate(answer, full, first.effect, given)
        rows.append((owner if owner != effect else "", name, size))
        effect = owner
    whose = "Parameters" if answer.decision.decided else f"Parameters of the {answer.set_out}"
    units = explained({given.unit for given in first.parameters.values()})
    heads = ("effect", "parameter", "estimate")
    return TextTable(f"{whose} ± one standard deviation{units}", heads, tuple(rows), names=heads[:2])


def patch_table(answer: Findings) -> TextTable:
    """The changes of the patch; a table without rows where no model was given."""
    model, rows = answer.model, []
    for one in model.written if model else ():
        numbers = _numbers(one.before), _numbers(one.after)
        rows.append((one.name, *numbers, unit_mark(beside(one.unit, ""))))
    heads = ("attribute", "before", "after", "unit")
    return TextTable(f"Changes to {model.file if model else ''}", heads, tuple(rows), heads[1:3])


def _numbers(values: Sequence[float]) -> str:
    last = max((i for i, value in enumerate(values) if value), default=0)
    return " ".join(significant(value, 4) for value in values[: last + 1])
