"""The explained share of the gap on held-out readings, and the answer without causes that these do not confirm."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

from diagnosis.answer.held_out import Waterfall, excess_base, predict_held_out, share_ahead, waterfall
from diagnosis.findings.closure import Confirmation, GapSummary
from diagnosis.findings.reported import gap_summary, held_out_totals, report_fits
from diagnosis.search.study import Study
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True)
class Closing:
    """The explained share of the gap on held-out readings.

    Args:
        gap: before and after, by MuJoCo.
        steps: the same as the causes are added.
        seconds: wall time by step, s.
        shifts: MuJoCo's readings of the answer's model minus those of the fits, in noise standard deviations of
            block means, by run id.
    """

    gap: GapSummary
    steps: Waterfall
    confirmation: Confirmation
    seconds: Mapping[str, float]
    shifts: Mapping[str, Array]


def closing(study: Study) -> Closing:
    """The gap before and after by MuJoCo, and as the causes are added."""
    base, chosen = excess_base(study), study.chosen
    nominal_out = predict_held_out(study.nominal)
    chosen_out = predict_held_out(chosen)
    begun = time.perf_counter()
    shown = report_fits(study.nominal, chosen, nominal_out, chosen_out)
    reported = time.perf_counter()
    steps = waterfall(study, base)
    gap = held_out_totals(gap_summary(study, base, shown), steps)
    gap = replace(gap, closed_ahead=share_ahead(study, nominal_out.residuals.keys()))
    seconds = {"confirmation": reported - begun, "waterfall": time.perf_counter() - reported}
    return Closing(gap, steps, shown.confirmation, seconds, shown.shifts)


def confirmed(study: Study) -> tuple[Study, Closing]:
    """The study without the causes whose addition does not reduce the held-out residual, and its closing."""
    found = closing(study)
    while (fewer := _without_needless(study, found.steps)) is not None:
        study, found = fewer, closing(fewer)
    return study, found


def _without_needless(study: Study, steps: Waterfall) -> Study | None:
    """The study whose answer is the part of the fitted causes that predicts best.

    Returns:
        None where all of them together predict best; or beside a random moment, which absorbs the causes.
    """
    answer = study.answer
    if answer is None or not study.named or study.random is not None:
        return None
    whole = frozenset(answer.effects)
    parts = {whole - {name}: left for name, left in steps.without.items() if name in whole}
    added: frozenset[str] = frozenset()
    for step in steps.steps:
        if step.effect in whole:
            added |= {str(step.effect)}
            parts.setdefault(added, step.excess)
    best = min(filter(None, parts), key=parts.__getitem__, default=whole)
    if best == whole or parts[best] > steps.steps[-1].excess:
        return None
    return study.of_part(tuple(sorted(best)))
