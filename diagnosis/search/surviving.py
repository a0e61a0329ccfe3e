"""Whether a cause survives the loss of a run.

A cause acts in every run that could show it. An effect that only repairs one odd run loses its size without
that run, although the other runs determine it. A random moment beside badly fitting effects explains more than
the gap of the nominal model in its runs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from diagnosis.likelihood.least_squares import Fit, FitError, fit_at
from diagnosis.likelihood.without_run import WithoutRuns, refitted_without
from diagnosis.model.fact import Fact
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.process_noise import ProcessNoise, with_response
from diagnosis.search.resolved import unresolved
from diagnosis.search.steady_noise import most_absorbed
from tunnel_sim.vocabulary.record import Array

EXPLAINS_STDS: Final = 4.0
"""Margin of χ² over that maximum due to noise, in standard deviations. Convention. One campaign in 30,000."""

SURVIVES_SIZE: Final = 0.5
"""Minimum size of an effect when any one replaceable run is left out, as a share of its size from all runs.
Convention. The other runs then confirm more than half of it."""
SURVIVES_STDS: Final = 3.0
"""Minimum distance between the whole size and that limit, in standard deviations from the other runs; and
minimum size of an effect for them to show it. Convention. One of 700 runs misses it by chance."""
SURVIVES_EXCESS: Final = 1.0
"""Maximum excess of a fit without a run, in noise variances, for it to contradict the size of an effect.
Judgement. A residual as large as the noise. With a larger residual the fit is not a model of the other runs."""


def refusal(answer: Hypothesis, repeating: Fit) -> Fact | None:
    """The reason why a set is not an answer; None where every cause in it is confirmed.

    Args:
        answer: the set, fitted to whole runs.
        repeating: fit of the nominal model to runs that repeat.
    """
    whole: Fit | None = answer.fit
    if answer.moment is not None:
        kinds, process = answer.moment.kinds, answer.moment.process
        if explains_too_much(process, repeating):
            return Fact("explains too much", {"effects": tuple(kind.name for kind in kinds)})
        whole = _beside(answer, process)
    if whole is None:
        return None
    if unconfirmed := unresolved(whole):
        return Fact("unresolved", {"effects": unconfirmed})
    lost = contradicted(whole)
    run = next(iter(lost.values()), "")
    names = tuple(name for name, without in lost.items() if without == run)
    return Fact("contradicted", {"effects": names, "run": run}) if lost else None


def _beside(answer: Hypothesis, process: ProcessNoise) -> Fit | None:
    """The effects of a set in the noise of its random moment; None if it has none, or the noise fails to settle."""
    noisy = with_response(answer.fit, process.spectrum) if answer.effects else None
    if noisy is None:
        return None
    try:
        return fit_at(replace(answer.fit.problem, data=noisy), answer.fit.point)
    except (FitError, np.linalg.LinAlgError):
        return None


def explains_too_much(process: ProcessNoise, repeating: Fit) -> bool:
    """Whether a random moment explains more than the gap of the nominal model in the runs in which it acts.

    If it does, the effects beside it fit these runs worse than the nominal model, and the moment compensates. The
    nominal model and the releases absorb a part of a random motion, so some excess is due to chance.
    """
    left, freedom = 0.0, 0
    for run, residual in zip(repeating.problem.data.runs, repeating.residuals, strict=True):
        if run.id in process.runs:
            left += float(residual @ residual) - residual.size
            freedom += residual.size
    margin = EXPLAINS_STDS * float(np.sqrt(2.0 * freedom))
    return process.drop > most_absorbed(process, repeating) * max(left, 0.0) + margin


def contradicted(whole: Fit) -> dict[str, str]:
    """The effects that lose their size without a run although the others could show it, each with that run.

    Linear theory finds them, and a fit without the run confirms them. The fit must explain the other runs: if
    more than the noise remains in them, sizes depend on the runs in any case.
    """
    found = dict[str, str]()
    for name, full, sizes, could in _without_each(whole):
        judged = np.where(could * (1.0 - SURVIVES_SIZE) > SURVIVES_STDS, sizes, 1.0)
        for index in np.argsort(judged)[:1]:
            if judged[index] >= SURVIVES_SIZE:
                continue
            again = refitted_without(whole, int(index))
            if again is None or again.excess > SURVIVES_EXCESS:
                continue
            if again.value(full) / whole.value(full) < SURVIVES_SIZE:
                found[name] = whole.problem.data.runs[index].id
    return found


def shown_by_one(whole: Fit) -> dict[str, str]:
    """The effects that only one run can show, each with that run."""
    found = dict[str, str]()
    if len(whole.residuals) > 1:
        for name, _, _, could in _without_each(whole):
            if could.min() < SURVIVES_STDS and np.median(could) >= SURVIVES_STDS:
                found[name] = whole.problem.data.runs[int(np.argmin(could))].id
    return found


def _without_each(whole: Fit) -> Iterator[tuple[str, str, Array, Array]]:
    """For each fitted and evident effect, its size without each run, and the evidence for that size.

    Returns:
        Name, full name of the severity, the size relative to the size from all runs, shape (runs,), and the size of
        all runs in standard deviations of the fit without the run, shape (runs,).
    """
    if len(whole.residuals) < 2:
        return
    names = whole.problem.names
    severities = {kind.name: f"{kind.name}.{kind.parameters()[0].name}" for kind in whole.problem.effects}
    fitted = {name: full for name, full in severities.items() if full in names and whole.bound(full) is None}
    if not fitted:
        return
    without = WithoutRuns.of(whole)
    for name, full in fitted.items():
        place, value = names.index(full), whole.value(full)
        if value != 0.0 and abs(value) >= SURVIVES_STDS * whole.std(full):
            yield (
                name,
                full,
                without.common[:, place] / value,
                abs(value) / np.maximum(without.stds[:, place], 1e-300),
            )
