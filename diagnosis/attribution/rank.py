"""Which effect: every one of the vocabulary, and pairs, added to the nominal model and fitted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from diagnosis.fitting.least_squares import Fit, FitError, fit, fit_growing
from diagnosis.fitting.problem import Point, Problem
from diagnosis.fitting.starting_points import StartingPoint, is_gross, starting_points
from diagnosis.policy import (
    ALWAYS_FITTED,
    FORM_SHARE,
    FREED_FROM,
    FREED_HYPOTHESES,
    PAIR_BASES,
    PAIR_SECONDS,
    PREDICTED_SHARE,
)
from tunnel_sim.effects import Effect
from tunnel_sim.effects.base import ParameterInfo

_POLISH = 1e-7  # drop of χ², as a share of it, at which a polished fit has converged

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """The nominal model with effects added, fitted.

    Args:
        effects: names, in the order they were added.
        fit: the fit.
        textbook: the fit with the textbook form, where the forms were freed in the end; None otherwise.
    """

    effects: tuple[str, ...]
    fit: Fit
    textbook: Fit | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects, sorted."""
        return tuple(sorted(self.effects))

    @property
    def forms(self) -> int:
        """How many form parameters were freed."""
        problem = self.fit.problem
        return sum(i.form for k in problem.effects if k.name in problem.free_forms for i in k.parameters())


def rank_singles(
    nominal: Fit, kinds: Sequence[type[Effect]], progress: Progress | None = None
) -> list[Hypothesis]:
    """Add each effect alone.

    Args:
        nominal: the fit without any.
        kinds: effects to try.
        progress: called with the name of each effect.

    Returns:
        Fitted hypotheses, best first. Effects that linear theory predicts to close next to nothing are left
        out.
    """
    found = []
    for kind, starts in _worth_fitting(nominal, kinds, ALWAYS_FITTED):
        if progress is not None:
            progress(kind.name)
        best = _best_fit(_tried(kind, starts, nominal), nominal)
        if best is not None:
            found.append(Hypothesis((kind.name,), best))
    return _with_forms(found, nominal)


def rank_pairs(
    singles: Sequence[Hypothesis], kinds: Sequence[type[Effect]], progress: Progress | None = None
) -> list[Hypothesis]:
    """Add a second effect to the best single ones.

    Args:
        singles: best first.
        kinds: effects to try.
        progress: called with the names of each pair.

    Returns:
        Fitted pairs, best first.
    """
    found: dict[tuple[str, ...], Hypothesis] = {}
    for single in singles[:PAIR_BASES]:
        others = [kind for kind in kinds if kind.name not in single.effects]
        for kind, starts in _worth_fitting(single.fit, others, 0)[:PAIR_SECONDS]:
            if progress is not None:
                progress(f"{single.effects[0]} + {kind.name}")
            best = _best_fit(_tried(kind, starts, single.fit), single.fit)
            if best is None:
                continue
            pair = Hypothesis((*single.effects, kind.name), best)
            if pair.names not in found or best.total < found[pair.names].fit.total:
                found[pair.names] = pair
    return _with_forms(list(found.values()), singles[0].fit)


def _with_forms(found: list[Hypothesis], base: Fit) -> list[Hypothesis]:
    """Free the forms of the best hypotheses where the textbook form leaves a good part open; best first."""
    ranked = sorted(found, key=lambda h: h.fit.total)
    freed = [_freed_if_it_pays(h, base) for h in ranked[:FREED_HYPOTHESES]]
    return sorted([*freed, *ranked[FREED_HYPOTHESES:]], key=lambda h: h.fit.total)


def _freed_if_it_pays(hypothesis: Hypothesis, base: Fit) -> Hypothesis:
    """The hypothesis with its forms free, where they close enough; else as it is."""
    fitted = hypothesis.fit
    freed = _free_forms(fitted) if fitted.excess > FREED_FROM * max(base.excess, 0.0) else None
    if freed is None:
        return hypothesis
    found = Hypothesis(hypothesis.effects, freed)
    return found if freed.excess < FORM_SHARE**found.forms * fitted.excess else hypothesis


def polish(chosen: Hypothesis) -> Hypothesis:
    """The hypothesis fitted to convergence with its forms free, so that its covariance includes the forms.

    Args:
        chosen: a fitted hypothesis.

    Returns:
        The same effects with a χ² no larger; as given where the fit cannot go on.
    """
    better = _free_forms(chosen.fit, tolerance=_POLISH)
    if better is None:
        with suppress(FitError, np.linalg.LinAlgError):
            better = fit(chosen.fit.problem, chosen.fit.point, tolerance=_POLISH)
    if better is None or better.total > chosen.fit.total:
        better = chosen.fit
    textbook = _textbook(better, chosen.fit) if better.problem.free_forms else None
    return Hypothesis(chosen.effects, better, textbook)


def _textbook(freed: Fit, first: Fit) -> Fit | None:
    """The same effects in textbook form: the first fit where it had that, else one from the freed values."""
    if not first.problem.free_forms:
        return first
    problem = Problem(freed.problem.data, freed.problem.effects, freed.problem.fixed)
    values = dict(zip(freed.problem.names, freed.point.common.tolist(), strict=True))
    start = Point(np.array([values[name] for name in problem.names]), freed.point.release)
    with suppress(FitError, np.linalg.LinAlgError):
        return fit(problem, start)
    return None


def _free_forms(fitted: Fit, tolerance: float = 1e-4) -> Fit | None:
    """The same effects with the forms free; None where none has a form, or nothing is gained."""
    problem = fitted.problem
    kinds = [kind for kind in problem.effects if any(info.form for info in kind.parameters())]
    if not kinds:
        return None
    freed = Problem(problem.data, problem.effects, problem.fixed, tuple(kind.name for kind in kinds))
    values = dict(zip(problem.names, fitted.point.common.tolist(), strict=True))
    defaults = {f"{k.name}.{i.name}": _within(i) for k in kinds for i in k.parameters() if i.form}
    start = Point(np.array([(defaults | values)[name] for name in freed.names]), fitted.point.release)
    try:
        found = fit(freed, start, tolerance=tolerance)
    except (FitError, np.linalg.LinAlgError):
        return None
    return found if found.total < fitted.total else None


def _within(info: ParameterInfo) -> float:
    """Where a form starts: at the textbook value, or half a step inside a bound, where its slope may vanish."""
    return info.default + 0.5 * info.scale if info.default == info.lower else info.default


def _worth_fitting(
    base: Fit, kinds: Iterable[type[Effect]], always: int
) -> list[tuple[type[Effect], list[StartingPoint]]]:
    scored = [(kind, starts) for kind in kinds if (starts := starting_points(base, kind))]
    scored.sort(key=lambda item: -item[1][0].predicted_drop)
    limit = 0.0 if always == 0 else PREDICTED_SHARE * base.total
    return [item for i, item in enumerate(scored) if i < always or item[1][0].predicted_drop > limit]


def _tried(kind: type[Effect], starts: Sequence[StartingPoint], base: Fit) -> Sequence[StartingPoint]:
    return starts if is_gross(base) else starts[: kind.tries]


def _best_fit(starts: Sequence[StartingPoint], base: Fit) -> Fit | None:
    best: Fit | None = None
    if is_gross(base):
        # linear theory does not hold there: the balance of moments goes first
        starts = sorted(starts, key=lambda start: not start.balanced)[:2]
    for start in starts:
        try:
            if is_gross(base):
                found = fit_growing(start.problem, start.point)
            else:
                found = fit(start.problem, start.point, base=base)
        except (FitError, np.linalg.LinAlgError):
            continue
        if np.isfinite(found.total) and (best is None or found.total < best.total):
            best = found
    return best
