"""The answers in the order of their probabilities, and the name of the answer that is set out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from identification.printing import Document


def ranked(document: Document) -> list[Mapping[str, Any]]:
    """The answers of a document, the most probable first.

    The document starts with its answer. If undecided, that is the most probable set of effects, and an unknown
    cause may be more probable.
    """
    return sorted(document["candidates"], key=lambda one: -one["probability"])


def set_out(document: Document) -> str:
    """The name of the answer whose parameters are stated, such as ``most probable answer``."""
    if document.get("decided", True):
        return "answer"
    first = document["candidates"][0]
    most = max(one["probability"] for one in document["candidates"])
    return "most probable answer" if first["probability"] >= most else "most probable set of effects"
