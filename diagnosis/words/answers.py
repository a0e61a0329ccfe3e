"""The answers in the order of their probabilities, and what the one is called that is set out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from diagnosis.words.numbers import Document


def ranked(document: Document) -> list[Mapping[str, Any]]:
    """The answers of a document, the most probable first.

    The document has the answer first. Of an undecided one that is the most probable set of effects, which an
    unknown cause may exceed.
    """
    return sorted(document["candidates"], key=lambda one: -one["probability"])


def set_out(document: Document) -> str:
    """What the answer is called whose parameters are stated, such as ``most probable answer``."""
    if document.get("decided", True):
        return "answer"
    first = document["candidates"][0]
    most = max(one["probability"] for one in document["candidates"])
    return "most probable answer" if first["probability"] >= most else "most probable set of effects"
