"""A fitted formula as a law in the measured campaign's units, and its share of held-out data."""

from __future__ import annotations

from typing import Final

import numpy as np

from diagnosis.answer.held_out import predict_held_out, predict_stretches, turns_of
from diagnosis.likelihood.ceiling import ratio
from diagnosis.likelihood.least_squares import Fit
from diagnosis.model.similarity import Similarity
from diagnosis.remainder.closable import Law
from diagnosis.remainder.formula import Proposal

FORMULA_CLOSES: Final = 0.1
"""Minimum share of the residual that a formula must explain on held-out runs. Judgement."""


def held_out_share(base: Fit, wider: Fit) -> tuple[float, float, str]:
    """Share of a fit's residual that a wider fit explains on held-out data, its deviation, and the data."""
    before, after = (predict_held_out(one).residuals for one in (base, wider))
    held_out = "runs" if before else "stretches of time"
    if not before:
        turns = turns_of(base, {run.id for run in base.problem.data.runs})
        before, after = (predict_stretches(one, turns) for one in (base, wider))
    both = [run for run in before if run in after]
    powers = np.array([[float(r[run] @ r[run]) for run in both] for r in (before, after)])
    sizes = np.array([before[run].size for run in both], np.float64)
    drop = np.nan_to_num(powers[0] - powers[1], nan=0.0, neginf=0.0)
    return *ratio(drop, powers[0] - sizes), held_out


def stated_law(proposal: Proposal, similarity: Similarity, closed: float, std: float) -> Law | None:
    """The law of a proposal in the measured campaign's units; None if its share of held-out data is small.

    Args:
        closed: share of held-out data that the law explains.
        std: standard deviation of the share.
    """
    if closed < FORMULA_CLOSES:
        return None
    own, values = {}, {}
    for place, (name, given) in enumerate(proposal.table["parameters"].items()):
        full, unit = f"{proposal.table['name']}.{name}", str(given["unit"])
        value = similarity.own(proposal.fit.value(full), unit)
        low, high = sorted(similarity.own(float(given[end]), unit) for end in ("lower", "upper"))
        own[name] = {
            "unit": unit, "scale": value or similarity.own(float(given["scale"]), unit), "lower": min(low, value),
            "upper": max(high, value), "default": value if place else 0.0,
        }  # fmt: skip
        values[name] = (value, similarity.own(proposal.fit.std(full), unit))
    return Law({**proposal.table, "parameters": own}, values, closed, std)
