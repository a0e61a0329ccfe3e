"""The answers in the order of their probabilities, and the name of the answer that is set out."""

from __future__ import annotations

from diagnosis.findings.candidates import Candidate
from diagnosis.findings.whole import Findings


def ranked(answer: Findings) -> list[Candidate]:
    """The answers of a document, the most probable first.

    The document starts with its answer. If undecided, that is the most probable set of effects, and an unknown
    cause may be more probable.
    """
    return sorted(answer.candidates, key=lambda one: -one.probability)
