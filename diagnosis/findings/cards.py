"""A card for each cause, and the vocabulary's description of effects."""

from __future__ import annotations

from itertools import pairwise

from diagnosis.findings.closure import WITHIN_THE_NOISE
from diagnosis.findings.repeatability import width_text
from diagnosis.findings.terms import BETWEEN_RUNS, SCATTERS, acts_on, scattering, without_scatter
from diagnosis.findings.whole import Findings
from identification.show.blocks import Card, Heading, Paragraph
from identification.show.numbers import plain
from tunnel_sim.effects import known_effects


def _calm(answer: Findings) -> bool:
    """Whether the verdict says that the residual gap is within the noise."""
    return answer.rest is not None and not answer.rest.significant


def effect_cards(answer: Findings) -> list[Card]:
    """The vocabulary's description of every cause and its rivals."""
    known = {kind.name: kind for kind in known_effects()}
    return [
        Card(
            (
                Heading(plain(name), acts_on(answer, name)),
                Paragraph(f"{(known[name].__doc__ or '').splitlines()[0]} It adds: {known[name].equation}"),
                Paragraph(known[name].signature),
                *(Paragraph(reference, kind="small") for reference in known[name].references),
            )
        )
        for name in [*answer.causes, *answer.ambiguous_with]
        if name in known
    ]


def cause_cards(answer: Findings) -> list[Card]:
    """Every cause of the answer with its size and its effects; the scatter between runs last."""
    if not answer.names_effects:
        return []
    first = answer.candidates[0]
    names = first.effect.split(" + ")
    does = {size.effect: size.words(answer.misfit.unit) for size in answer.sizes}
    steps = answer.waterfall.steps
    gaps = [answer.misfit.words(step.excess) for step in steps]
    if steps and _calm(answer):
        gaps[-1] = WITHIN_THE_NOISE
    closes: dict[str, str] = {}
    for step, (before, after) in zip(steps[1:], pairwise(gaps), strict=True):
        added = str(step.effect).split(" + ")
        together = ", all together" if len(added) > 1 else ""
        closes |= dict.fromkeys(added, f"Its addition takes the misfit from {before} to {after}{together}.")
    cards = [
        _cause(
            plain(name),
            acts_on(answer, name),
            answer.named_causes.said_size(first, name),
            does.get(name, ""),
            closes.get(name, ""),
        )
        for name in without_scatter(names)
    ]
    if scatter := scattering(names):
        spreads = [one for one in answer.repeated.spreads if one.effect in scatter]
        widths = "; ".join(f"{plain(SCATTERS[one.effect])} {width_text(one)}" for one in spreads)
        cards.append(
            _cause(
                BETWEEN_RUNS,
                "by chance",
                widths,
                "",
                closes.get(scatter[0], "").replace(", all together", ""),
            )
        )
    return cards


def _cause(name: str, acts: str, size: str, does: str, closes: str) -> Card:
    does = f"{does}." if does else ""
    size = size[:1].upper() + size[1:]
    return Card(
        (Heading(name, acts), Paragraph(size, kind="size"), Paragraph(does), Paragraph(closes)), "cause"
    )
