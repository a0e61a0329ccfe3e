"""The user's model compared with the runs: the values in its file, and the fitted ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from diagnosis.settings import settings_of
from identification.printing import Document, significant, unit_mark, with_std

#: By attribute of the file: the fitted quantity, and the coefficient that it is a part of.
_FREE = {
    "joint armature": ("inertia", "yaw_inertia"),
    "joint damping": ("damping", "mechanical_damping"),
    "joint stiffness": ("stiffness", "added_stiffness"),
}


def corrected(document: Document) -> list[tuple[Mapping[str, Any], float]]:
    """The attributes of the model that disagree with the runs, as in the patch.

    Returns:
        With the standard deviation of each new value, in its unit; none without a model.
    """
    model, after = document.get("model") or {}, document["coefficients"]["after"]
    found = []
    for one in model.get("written", ()):
        free, name = _FREE.get(one["name"], ("", ""))
        known = after.get(name, {"std": None})
        if free not in model["free"] or known["std"] is None:
            continue
        change = abs(one["after"][0] - one["before"][0])
        chosen = settings_of(document).words
        if change > max(chosen.file_off_stds * known["std"], chosen.file_off_share * abs(known["value"])):
            found.append((one, known["std"]))
    return found


def model_words(document: Document) -> str:
    """Differences of the values in the model's file from those of the runs, in a sentence; empty without any."""
    said = []
    for one, std in corrected(document):
        before, unit = significant(one["before"][0], 3), unit_mark(one["unit"].split(",")[0])
        after = with_std(one["after"][0], std) if std > 0.0 else significant(one["after"][0], 3)
        said.append(f"{one['name']} is {before} {unit} in the file and {after} {unit} by the runs")
    return f"{document['model']['file']} does not fit: {'; '.join(said)}." if said else ""


def model_step(document: Document) -> str:
    """What to do where the values in the model's file do not fit, without a full stop; empty where they fit."""
    if not corrected(document):
        return ""
    return f"Correct these values in {document['model']['file']}; --patch FILE writes a model with them"
