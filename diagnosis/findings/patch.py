"""The user's model with the causes: its changes, the share it explains, and values that do not fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from diagnosis.findings.finding import Judged, NextStep
from diagnosis.patch.written_model import PatchedModel
from identification.show.blocks import TextTable
from identification.show.numbers import listed, reading_shown, significant, unit_mark, with_std
from tunnel_sim.vocabulary.dimensions import beside
from tunnel_sim.vocabulary.rig import WrittenAttribute

FILE_OFF_STDS: Final = 2.0
"""Maximum deviation of a coefficient, in standard deviations, at which the value in the model's file fits.
Convention."""
FILE_OFF_SHARE: Final = 0.01
"""Maximum deviation of a coefficient, as a share, at which the value in the file fits. Judgement."""

#: By attribute of the file: the fitted quantity, and the coefficient to which it contributes.
_FREE = {
    "joint armature": ("inertia", "yaw_inertia"),
    "joint damping": ("damping", "mechanical_damping"),
    "joint stiffness": ("stiffness", "added_stiffness"),
}


def corrected(model: PatchedModel | None, judged: Judged) -> list[tuple[WrittenAttribute, float]]:
    """The attributes of the model that disagree with the runs, as in the patch.

    Returns:
        With the standard deviation of each new value, in its unit; empty without a model.
    """
    after = judged.coefficients_after
    found: list[tuple[WrittenAttribute, float]] = []
    if model is None:
        return found
    for one in model.written:
        free, name = _FREE.get(one.name, ("", ""))
        known = after.get(name)
        if free not in model.free or known is None or known.std is None:
            continue
        change = abs(one.after[0] - one.before[0])
        if change > max(FILE_OFF_STDS * known.std, FILE_OFF_SHARE * abs(known.value)):
            found.append((one, known.std))
    return found


def model_words(model: PatchedModel | None, judged: Judged) -> str:
    """Differences between the values in the model's file and in the runs, in a sentence; empty without any."""
    said = []
    for one, std in corrected(model, judged):
        before, unit = significant(one.before[0], 3), unit_mark(one.unit.split(",")[0])
        after = with_std(one.after[0], std) if std > 0.0 else significant(one.after[0], 3)
        said.append(f"{one.name} is {before} {unit} in the file and {after} {unit} by the runs")
    return "" if model is None or not said else f"{model.file} does not fit: {'; '.join(said)}."


def model_steps(model: PatchedModel | None, judged: Judged) -> list[NextStep]:
    """Remedies where the values in the model's file do not fit; none where they fit."""
    if model is None or not corrected(model, judged):
        return []
    names = listed([one.name for one, _ in corrected(model, judged)])
    return [NextStep(f"Correct {names} in {model.file}; --patch FILE writes a model with these values")]


def patch_line(model: PatchedModel | None, judged: Judged) -> str:
    """The share of the gap that the patched model explains; empty without a model."""
    if model is None:
        return ""
    if not judged.names_effects:
        fitted = ", ".join(model.free)
        said = f"No cause is written into the patched model, only the fitted parameters: {fitted}."
    else:
        closed, by_fit = (f"{100.0 * part:.1f} %" for part in (model.closed, model.closed_by_fit))
        said = (
            f"The patched model, simulated by MuJoCo, explains {closed} of the gap {model.closed_on}; the fit "
            f"itself explains {by_fit}."
        )
    size = reading_shown(abs(model.zero_rad), 3, next(iter(judged.freedom.shown)))
    zero = f"{'−' if model.zero_rad < 0.0 else '+'} {size}"
    return f"{said} The reading is the position of {model.joint} {zero}."


def patch_table(model: PatchedModel | None) -> TextTable:
    """The changes of the patch; a table without rows where no model was given."""
    rows = []
    for one in model.written if model else ():
        numbers = _numbers(one.before), _numbers(one.after)
        rows.append((one.name, *numbers, unit_mark(beside(one.unit, ""))))
    heads = ("attribute", "before", "after", "unit")
    return TextTable(f"Changes to {model.file if model else ''}", heads, tuple(rows), heads[1:3])


def _numbers(values: Sequence[float]) -> str:
    last = max((i for i, value in enumerate(values) if value), default=0)
    return " ".join(significant(value, 4) for value in values[: last + 1])
