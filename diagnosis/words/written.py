"""The text fields of a document, composed in one place."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.words.cautions import CAUTIONS, NOISE, PATCH, coefficient_note, remark, said
from diagnosis.words.numbers import Document, unit_of
from diagnosis.words.remainder import closable_words, rest_words
from diagnosis.words.verdict import verdict
from diagnosis.words.where import where_words
from identification.status import Remark


@dataclass(frozen=True)
class Sentences:
    """What is written from the facts of a document; empty where there is nothing to say.

    Args:
        verdict: the answer in one paragraph.
        where: where the gap is.
        rest: what remains of it.
        closable: what could be closed of that.
        note: how to read the coefficients.
        noise: why the noise is taken as it is.
        cautions: caveats.
        remarks: what is noted of the noise.
        patch: where the patched model is not the same law.
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


def sentences(document: Document) -> Sentences:
    """Write what people read of a diagnosis.

    Args:
        document: the diagnosis in JSON's types, whose text fields do not matter.
    """
    found, rest, model = document["found"], rest_words(document), document["model"]
    unit = unit_of(document)
    return Sentences(
        verdict=verdict(document, rest),
        where=where_words(document),
        rest=rest,
        closable=closable_words(document),
        note=coefficient_note(document),
        noise="" if found["noise"] is None else said(NOISE, found["noise"], unit),
        cautions=tuple(said(CAUTIONS, one, unit) for one in found["cautions"]),
        remarks=tuple(remark(one, unit) for one in found["noted"]),
        patch=() if model is None else tuple(said(PATCH, one) for one in model["differences"]),
    )
