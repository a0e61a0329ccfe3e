"""The formula for the residual of driven runs: laws of a short list, each fitted like an effect.

If dry friction stops a driven body, the moment missing at rest depends on the input, not on the measured path.
Linear responses therefore give no bound on the explainable share, as they do for free decays. Instead, the laws
are integrated with the motion.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from scipy.special import chdtri

from diagnosis.likelihood.ceiling import Ceiling
from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.paths import Ranges, paths, ranges
from diagnosis.remainder.closable import Closable
from diagnosis.remainder.formula import Formula, FormulaTerm, Proposal, predicted_drop, propose
from diagnosis.remainder.laws import held_out_share, stated_law
from diagnosis.search.study import Study

LAWS_FITTED: Final = 3
"""Number of laws that are fitted to driven runs, by greatest predicted drop of χ². Judgement.
Time against coverage."""

_OF_RATE = ("abs(r)*r", "r^3", "sign(r)")
_OF_SLOW_RATE = ("exp(-(r/v)^2)*sign(r)", "tanh(r/v)")
"""Friction that rises at low rates (Stribeck), and friction that is smooth about rest. Both are also general
forms of dry friction. But an answer has one form, and friction that rises may also grow with the load."""
_OF_ANGLE = ("b^2", "b^3", "abs(b)*b")
_OF_BOTH = ("b^2*r", "b*sign(r)", "abs(b)*sign(r)")
_WIDTHS = (0.05, 0.2)  # shares of the greatest rate; a fit reaches the values between
_FIRST = 0.01  # share of the greatest restoring moment: the starting value of a coefficient


def closable_driven(study: Study, *, significant: bool) -> Closable | None:
    """The law of a short list that predicts held-out data best; None if no law does, or none is sought.

    Args:
        significant: whether the residual of the answer exceeds chance.

    Returns:
        In the measured campaign's units, with the law's share as the explainable share.

    Raises:
        LinAlgError: when the equations of a fit cannot be solved.
    """
    base = study.chosen
    if not study.causes or not significant or study.moment is not None or base.excess <= 0.0:
        return None
    settings, laws = base.settings.remainder, list(_formulas(base))
    laws.sort(key=lambda law: -predicted_drop(base, law[1], law[0]))
    found = [
        (kind, proposal)
        for kind, formula in laws[:LAWS_FITTED]
        if (proposal := propose(base, formula, kind)) is not None
    ]
    if not found:
        return None
    kind, best = min(found, key=lambda one: one[1].fit.total)
    # all laws of the list share one false-alarm rate
    if base.total - best.fit.total < chdtri(1 + _own_numbers(best), settings.term_rate / len(laws)):
        return None
    closed, std, held_out = held_out_share(base, best.fit)
    law = stated_law(best, study.similarity, closed, std)
    if law is None:
        return None
    return Closable(
        excess=base.excess / base.problem.data.mean_block,
        ceilings=(Ceiling(kind, closed, std, held_out),),
        kind=kind,
        events=(),
        curve=None,
        law=law,
        alike=(),
        next_most=None,
        line=None,
    )


def _own_numbers(proposal: Proposal) -> int:
    return len(proposal.table["parameters"]) - 1


def _formulas(base: Fit) -> Iterator[tuple[str, Formula]]:
    """The laws to be tried, with the kind of each; their initial coefficients are small."""
    motions = paths(base)
    r = ranges(motions)
    moment = _FIRST * r.angle * r.stiffness
    delta = np.zeros(base.point.common.size)
    for kind, term in _terms(r):
        at = {"b": r.angle, "r": r.rate}
        # the laws have their maxima at different points of the motion
        inside = [
            float(np.max(np.abs(term.value({k: s * v for k, v in at.items()})))) for s in (0.05, 0.3, 1.0)
        ]
        yield kind, Formula((term,), (-moment / max(*inside, 1e-300),), False, delta, 0.0)


def _terms(r: Ranges) -> Iterator[tuple[str, FormulaTerm]]:
    for kind, texts in (("rate", _OF_RATE), ("angle", _OF_ANGLE), ("state", _OF_BOTH)):
        yield from ((kind, FormulaTerm(text)) for text in texts)
    for text in _OF_SLOW_RATE:
        yield from (("rate", FormulaTerm(text, {"v": width * r.rate})) for width in _WIDTHS)
