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

_POLISH = 1e-7  # drop of χ², as a share of it, below which a polished fit is at its end

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """The nominal model with effects added, fitted.

    Args:
        effects: names, in the order they were added.
        fit: the fit.
        textbook: where forms were freed in the end, the fit with the textbook's; None otherwise.
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
        return sum(i.form for k in problem.effects if k.name in problem.bent for i in k.parameters())


def rank_singles(
    nominal: Fit, kinds: Sequence[type[Effect]], progress: Progress | None = None
) -> list[Hypothesis]:
    """Add each effect alone.

    Args:
        nominal: the fit without any.
        kinds: effects to try.
        progress: told each effect's name.

    Returns:
        Fitted hypotheses, best first. Effects from which linear theory expects next to nothing are left out.
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
        progress: told each pair's names.

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
    """Free the forms of the best hypotheses where the textbook's leave a good part open; best first."""
    ranked = sorted(found, key=lambda h: h.fit.total)
    bent = []
    for hypothesis in ranked[:FREED_HYPOTHESES]:
        fitted = hypothesis.fit
        freed = _bend(fitted) if fitted.excess > FREED_FROM * max(base.excess, 0.0) else None
        bend = None if freed is None else Hypothesis(hypothesis.effects, freed)
        pays = bend is not None and bend.fit.excess < FORM_SHARE**bend.forms * fitted.excess
        bent.append(bend if bend is not None and pays else hypothesis)
    return sorted([*bent, *ranked[FREED_HYPOTHESES:]], key=lambda h: h.fit.total)


def polish(chosen: Hypothesis) -> Hypothesis:
    """The hypothesis fitted to the end and with its forms free: what the form leaves open widens the spread.

    Args:
        chosen: a fitted hypothesis.

    Returns:
        The same effects, nowhere worse; as given where the fit cannot go on.
    """
    better = _bend(chosen.fit, tolerance=_POLISH)
    if better is None:
        with suppress(FitError, np.linalg.LinAlgError):
            better = fit(chosen.fit.problem, chosen.fit.point, tolerance=_POLISH)
    if better is None or better.total > chosen.fit.total:
        better = chosen.fit
    textbook = _straight(better, chosen.fit) if better.problem.bent else None
    return Hypothesis(chosen.effects, better, textbook)


def _straight(bent: Fit, first: Fit) -> Fit | None:
    """The same effects in the textbook's form: as fitted at first where it was, else from the bent ones."""
    if not first.problem.bent:
        return first
    problem = Problem(bent.problem.data, bent.problem.effects, bent.problem.fixed)
    values = dict(zip(bent.problem.names, bent.point.common.tolist(), strict=True))
    start = Point(np.array([values[name] for name in problem.names]), bent.point.release)
    with suppress(FitError, np.linalg.LinAlgError):
        return fit(problem, start)
    return None


def _bend(fitted: Fit, tolerance: float = 1e-4) -> Fit | None:
    """The same effects with the forms free; None where none has one, or nothing is gained."""
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
    """Where a form starts: the textbook's, or a step inside where that is a bound: its slope may vanish there."""
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
        # linear theory says nothing there: the balance of moments goes first
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
