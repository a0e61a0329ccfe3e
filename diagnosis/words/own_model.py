"""A model of one's own beside what the runs say of it: the values in its file, and those fitted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from diagnosis.words.numbers import Document
from identification.printing import significant, unit_mark

#: What a fit leaves free, by the attribute in which it is written.
_FREE = {"joint armature": "inertia", "joint damping": "damping", "joint stiffness": "stiffness"}
_APART = 0.02  # change of a value, as a share of the new one, that is worth a sentence


def corrected(document: Document) -> list[Mapping[str, Any]]:
    """The attributes of the model that the runs do not agree with, as the patch has them; none without a model."""
    model = document.get("model") or {}
    return [
        one
        for one in model.get("written", ())
        if _FREE.get(one["name"]) in model.get("free", ())
        and abs(one["after"][0] - one["before"][0]) > _APART * abs(one["after"][0])
    ]


def model_words(document: Document) -> str:
    """How the values in the model's file differ from those of the runs, in a sentence; empty where they do not."""
    said = []
    for one in corrected(document):
        before, after = (significant(values[0], 3) for values in (one["before"], one["after"]))
        unit = unit_mark(one["unit"].split(",")[0])
        said.append(f"{one['name']} is {before} {unit} there, and the runs say {after} {unit}")
    return f"{document['model']['file']} as given does not fit: {'; '.join(said)}." if said else ""


def model_step(document: Document) -> str:
    """What to do where the values in the model's file do not fit, without a full stop; empty where they do."""
    if not corrected(document):
        return ""
    return f"Correct these values in {document['model']['file']}; --patch FILE writes a model with them"
