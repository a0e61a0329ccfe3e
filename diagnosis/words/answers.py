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


def set_out(answer: Findings) -> str:
    """The name of the answer whose parameters are stated, such as ``most probable answer``."""
    if answer.decision.decided:
        return "answer"
    first = answer.candidates[0]
    most = max(one.probability for one in answer.candidates)
    return "most probable answer" if first.probability >= most else "most probable set of effects"
