"""Single lines of a diagnosis beside its tables, and the answer in three lines, from its document."""

from __future__ import annotations

from diagnosis.findings.misfit import misfit_of, of_swing, rms_shown
from diagnosis.findings.terms import named_answer, scattering
from diagnosis.findings.whole import Findings
from diagnosis.words.answers import set_out
from diagnosis.words.tables import SOURCES
from identification.printing import COEFFICIENTS
from identification.show.numbers import (
    explained,
    held_out_excess,
    listed,
    plain,
    probability,
    reading_shown,
    share,
    significant,
    unit_mark,
)
from tunnel_sim.effects import Effect, known_effects
from tunnel_sim.vocabulary.dimensions import beside

_MOST = 0.5  # of a variance: more than all its other sources together
_COUNTS = 0.005  # of a variance: a smaller share changes no digit of its root


def diagnosis_brief(answer: Findings) -> str:
    """An answer in three lines: its causes, its gap, and the next step."""
    gap, first = answer.gap, answer.candidates[0]
    causes = answer.causes
    named = named_answer(causes).lower() if causes else "no gap"
    decided = answer.decision.decided
    undecided = "" if decided else f"undecided, the {set_out(answer)} is "
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


def coefficients_line(answer: Findings) -> str:
    """Contributions to the coefficients' standard deviations that those of ``identify`` do not include.

    Empty where none is known.
    """
    after = {name: given for name, given in answer.coefficients.after.items() if given.std}
    if not after:
        return ""
    parts = []
    for source, words in SOURCES.items():
        shares = {name: given.shares.get(source, 0.0) for name, given in after.items()}
        if max(shares.values()) >= _COUNTS:
            mostly = listed(
                [COEFFICIENTS.get(name, name) for name, share in shares.items() if share > _MOST] or [""]
            )
            parts.append(f"{words} (most of the variance of {mostly})" if mostly else words)
    if not parts:
        return ""
    if all(given.shares.keys() <= {"noise", "scatter", "air density"} for given in after.values()):
        return f"± is the ± of tunnel identify; it includes {listed(parts)}."
    return (
        f"± includes {listed(parts)}. The ± of tunnel identify includes the noise, the scatter between runs and "
        "the misfit of its model, so it may be far smaller or larger."
    )


def hidden_line(answer: Findings) -> str:
    """The undetected effects that would change a coefficient by more than its ±; empty where none would.

    The one with the greatest change against the ±, and each that states how to read the coefficients without it.
    """
    after, general_form = answer.coefficients.after, Effect.undetected
    clauses: list[tuple[bool, str]] = []
    for one in answer.hidden:
        moved = []
        for name, given in after.items():
            move = one.moves.get(name)
            if move is not None and given.std and move.value > given.std:
                by = f"{significant(move.value, 2)} {'' if given.unit == '1' else unit_mark(given.unit)}"
                moved.append((COEFFICIENTS.get(name, name), by.strip()))
        own = next((kind.undetected for kind in known_effects() if kind.name == one.effect), general_form)
        template = own if moved else ""
        general = template == general_form
        if not moved or (general and any(said for said, _ in clauses)):
            continue
        size = f"{significant(abs(one.size.value), 2)}{unit_mark(beside(one.size.unit))}"
        changes = " and ".join(f"{label} by {by}" for label, by in moved) if general else moved[-1][1]
        words = {"effect": plain(one.effect), "size": size + explained({one.size.unit})}
        clause = template.format(changes=changes, **words)
        clauses.append((general, f"{clause[0].upper()}{clause[1:]}."))
    return f"Upper limits: {' '.join(clause for _, clause in clauses)}" if clauses else ""


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
