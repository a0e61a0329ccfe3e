"""The text fields of a document, composed in one place."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.findings.cautions import CAUTIONS, NOISE, PATCH, remark, said
from diagnosis.findings.coefficients import coefficient_note
from diagnosis.findings.place import where_words
from diagnosis.findings.remainder import closable_words
from diagnosis.findings.verdict import verdict
from diagnosis.findings.whole import Findings
from identification.status import Remark


@dataclass(frozen=True)
class Sentences:
    """Sentences written from the facts of a document; empty where there is nothing to say.

    Args:
        verdict: the answer in one paragraph.
        where: the place of the gap.
        rest: the remaining gap.
        closable: the part of it that could be explained.
        note: notes on the coefficients.
        noise: reasons for the noise used.
        cautions: caveats.
        remarks: remarks on the noise.
        patch: differences between the patched model and the law found.
    """

    verdict: str
    where: str
    rest: str
    closable: str
    note: str
    noise: str
    cautions: tuple[str, ...]
    remarks: tuple[Remark, ...]
    patch: tuple[str, ...]


def sentences(answer: Findings) -> Sentences:
    """Write the sentences of a diagnosis, whose text fields are ignored."""
    found, rest, model = (
        answer.found,
        "" if answer.rest is None else answer.rest.in_words(answer),
        answer.model,
    )
    unit = answer.misfit.unit
    return Sentences(
        verdict=verdict(answer, rest),
        where=where_words(answer.where, answer.found.place or answer.found.nowhere, answer),
        rest=rest,
        closable=closable_words(answer.closable, answer),
        note=coefficient_note(answer.coefficients, answer),
        noise="" if found.noise is None else said(NOISE, found.noise, unit),
        cautions=tuple(said(CAUTIONS, one, unit) for one in found.cautions),
        remarks=tuple(remark(one, unit) for one in found.noted),
        patch=() if model is None else tuple(said(PATCH, one) for one in model.differences),
    )
