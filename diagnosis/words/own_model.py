"""The user's model compared with the runs: the values in its file, and the fitted ones."""

from __future__ import annotations

from diagnosis.findings.whole import Findings
from diagnosis.patch.written_model import WrittenAttribute
from identification.show.numbers import significant, unit_mark, with_std

#: By attribute of the file: the fitted quantity, and the coefficient that it is a part of.
_FREE = {
    "joint armature": ("inertia", "yaw_inertia"),
    "joint damping": ("damping", "mechanical_damping"),
    "joint stiffness": ("stiffness", "added_stiffness"),
}


def corrected(answer: Findings) -> list[tuple[WrittenAttribute, float]]:
    """The attributes of the model that disagree with the runs, as in the patch.

    Returns:
        With the standard deviation of each new value, in its unit; none without a model.
    """
    model, after = answer.model, answer.coefficients.after
    found: list[tuple[WrittenAttribute, float]] = []
    if model is None:
        return found
    for one in model.written:
        free, name = _FREE.get(one.name, ("", ""))
        known = after.get(name)
        if free not in model.free or known is None or known.std is None:
            continue
        change = abs(one.after[0] - one.before[0])
        chosen = answer.settings.words
        if change > max(chosen.file_off_stds * known.std, chosen.file_off_share * abs(known.value)):
            found.append((one, known.std))
    return found


def model_words(answer: Findings) -> str:
    """Differences of the values in the model's file from those of the runs, in a sentence; empty without any."""
    said, model = [], answer.model
    for one, std in corrected(answer):
        before, unit = significant(one.before[0], 3), unit_mark(one.unit.split(",")[0])
        after = with_std(one.after[0], std) if std > 0.0 else significant(one.after[0], 3)
        said.append(f"{one.name} is {before} {unit} in the file and {after} {unit} by the runs")
    return "" if model is None or not said else f"{model.file} does not fit: {'; '.join(said)}."


def model_step(answer: Findings) -> str:
    """What to do where the values in the model's file do not fit, without a full stop; empty where they fit."""
    if answer.model is None or not corrected(answer):
        return ""
    return f"Correct these values in {answer.model.file}; --patch FILE writes a model with them"
