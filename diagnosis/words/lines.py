"""Single lines of a diagnosis beside its tables, and the answer in three lines, from its document."""

from __future__ import annotations

from diagnosis.findings.misfit import misfit_of, of_swing, rms_shown
from diagnosis.findings.terms import named_answer, scattering
from diagnosis.findings.whole import Findings
from identification.show.numbers import (
    held_out_excess,
    plain,
    probability,
    reading_shown,
    share,
)


def diagnosis_brief(answer: Findings) -> str:
    """An answer in three lines: its causes, its gap, and the next step."""
    gap, first = answer.gap, answer.candidates[0]
    causes = answer.causes
    named = named_answer(causes).lower() if causes else "no gap"
    decided = answer.decision.decided
    undecided = "" if decided else f"undecided, the {answer.set_out} is "
    misfit, excess = misfit_of(answer), gap.excess_before
    size = f"{held_out_excess(excess)} times the noise variance"
    if misfit is not None:
        size = f"{rms_shown(misfit, excess)} root mean square, {of_swing(misfit, excess)} ({size})"
    closed = f"; {share(gap.closed)} explained {gap.closed_on}" if answer.names_effects else ""
    likely = probability(first.probability)
    return (
        f"Diagnosis of {answer.campaign!r}: {undecided}{named} (probability {likely})\n"
        f"  gap {size}{closed}\n"
        "  print() shows all; .plot(), .write_report(path), .to_frame()"
    )


def inclusion_line(answer: Findings) -> str:
    """The effects that may be among the causes, most probable first; empty where none is probable enough."""
    least = answer.settings.words.effect_listed
    likely = dict(sorted(answer.inclusion.items(), key=lambda item: -item[1]))
    names = [name for name, value in likely.items() if value >= least]
    last = scattering(names)  # scatter is common to every answer
    ordered = [*(name for name in names if name not in last), *last]
    shown = [f"{plain(name)} {probability(likely[name])}" for name in ordered]
    return f"Among the causes, with probability: {', '.join(shown)}." if shown else ""


def patch_line(answer: Findings) -> str:
    """The share of the gap that the patched model explains; empty without a model."""
    model = answer.model
    if model is None:
        return ""
    if not answer.names_effects:
        fitted = ", ".join(model.free)
        said = f"No cause is written into the patched model, only the fitted parameters: {fitted}."
    else:
        closed, by_fit = (f"{100.0 * part:.1f} %" for part in (model.closed, model.closed_by_fit))
        said = (
            f"The patched model, simulated by MuJoCo, explains {closed} of the gap {model.closed_on}; the fit "
            f"itself explains {by_fit}."
        )
    zero = f"{'−' if model.zero_rad < 0.0 else '+'} {reading_shown(abs(model.zero_rad), 3)}"
    return f"{said} The reading is the position of {model.joint} {zero}."
