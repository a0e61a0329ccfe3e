"""One factor on the statements of a run or group of runs that makes frequency and damping of all runs agree.

The air's part of k grows as ρV² and of a as ρV. A wrong clock changes both k and a entirely. The kinds of
factors can therefore be distinguished. An equal effect on all runs of one wind speed is not a slip.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any

import numpy as np
from scipy.special import chdtri, fdtri

from identification import policy
from identification.examination.slips.base import SlipEvidence
from identification.examination.slips.motions import (
    ConditionsFit,
    MeasuredMotions,
    RunConditions,
    TrialSlip,
    fitted,
)
from identification.examination.slips.run_labels import mending_statements
from identification.status import SYSTEMATIC, Outcome, Remark
from tunnel_sim.vocabulary.record import Array

Places = tuple[int, ...]
Changed = Callable[[RunConditions, float], RunConditions]
_FEWEST = 4  # minimum number of runs
_MOST_RUNS = 40  # maximum number of runs that are tried one by one; beyond it groups are tried
_MOST_SAID = 3
_LARGEST = 0.7  # maximum share of a decrease: greater slips are units and labels
_IDLE = 0.25  # multiple of the least stated wind: a first guess
_LAGS = (0.1, -0.1)  # radians of phase: first guesses
_CERTAIN = 1e6  # degrees of freedom of a bound
_UNITS = {"wind_speed": "m/s", "air_density": "kg/m3", "spring_stiffness": "N m/rad"}
_ALONG = " along"
_ROUNDED = "spring_stiffness, rounded"
_KINDS = {"speed": "wind_speed", "density": "air_density", "clock": "time_s", "spring": "spring_stiffness"}


def wrong_factor(evidence: SlipEvidence) -> Remark | None:
    """One factor on a speed, a density, a spring or a clock makes all runs agree, and no effect does.

    Refused, or asked about where the evidence is weaker.

    Labels that agree equally well come first.
    """
    swings = [s for s in evidence.swings if s.run.spring_stiffness and s.rate > 0.0 and s.stiffness > 0.0]
    if len(swings) < _FEWEST:
        return None
    motions = MeasuredMotions.of(swings)
    found = _agreeing(motions)
    best = min(found, key=lambda one: one.fit.squares(one.level), default=None)
    if best is None or _labels_agree(evidence, motions, best):
        return None
    return _said(motions, found)


@dataclass(frozen=True, eq=False)
class _Found:
    """A slip that makes all runs agree, unlike the stated conditions and every single effect.

    Args:
        level: scatter between the runs, over the usual scatter.
        refused: whether chance explains the slip less than once in a lifetime.
    """

    trial: TrialSlip
    fit: ConditionsFit
    level: float
    refused: bool


def _agreeing(m: MeasuredMotions) -> list[_Found]:
    """The slips with which the runs agree about equally well, the best first; none if no slip is needed.

    The springs are tried as stated first, then with errors.
    """
    stated = fitted(m, wide=True)
    if stated.freedom < 2 or stated.squares(policy.LEVELS_OF_SCATTER[0]) <= stated.freedom:
        return []
    effects = [stated, *(fitted(m, one, wide=True) for one in _effects(m))]
    trials = list(_slips(m))
    for wide in (False, True):
        fits = [(trial, fitted(m, trial, wide=wide)) for trial in trials]
        judged = [_judged(trial, fit, effects) for trial, fit in fits]
        found = [one for one in judged if one is not None]
        if found:
            level = min(one.level for one in found)
            limit = min(one.fit.squares(level) for one in found) + float(chdtri(1, policy.DIFFERENCE_RATE))
            ties = [one for one in found if one.fit.squares(level) <= limit]
            ties.sort(key=lambda one: one.fit.squares(level))
            return [*_rounded(m, ties, level, limit, wide=wide), *ties]
    return []


def _rounded(
    m: MeasuredMotions, ties: Sequence[_Found], level: float, limit: float, *, wide: bool
) -> Iterator[_Found]:
    """Two springs with one rounded stated value, if they agree as well as a wrong clock.

    Args:
        limit: limit of the sum of squares at the level of scatter.
    """
    parts: dict[Places, float] = {}
    for one in ties:
        for value in np.unique(m.stated) if one.trial.kind == "time_s" else ():
            own = np.flatnonzero(m.stated == value).tolist()
            inside = [place in one.trial.places for place in own]
            if any(inside) and not all(inside):
                part = tuple(p for p, same in zip(own, inside, strict=True) if same == inside[0])
                parts.setdefault(part, float(value))
    for part, value in parts.items():
        trial = TrialSlip(_scaled("spring", part), part, _ROUNDED)
        fit = fitted(m, trial, wide=wide)
        step = float(Decimal(1).scaleb(int(Decimal(f"{value:.15g}").as_tuple().exponent)))
        if abs(fit.number) <= step / value and fit.squares(level) <= limit:
            yield _Found(trial, fit, level, ties[0].refused)


def _judged(trial: TrialSlip, fit: ConditionsFit, effects: Sequence[ConditionsFit]) -> _Found | None:
    """A trial that makes the runs agree; None if its number may be due to an effect or to chance, or is zero.

    The gain by one more number is tested by F with the remaining scatter, combined with the usual scatter of
    rigs, and with the greatest scatter that chance is believed to cause.
    """
    size = abs(fit.number) if trial.kind == "idle" else fit.number
    if fit.freedom < 1 or abs(size) < trial.least or not -_LARGEST < size < 1.0 / (1.0 - _LARGEST):
        return None
    if fit.squares(policy.AGREEING_SCATTER) > float(chdtri(fit.freedom, policy.SLIP_AGREES)):
        return None
    own, known = fit.level(), policy.SCATTER_FREEDOM
    usual = float(np.sqrt((known + fit.freedom * own**2) / (known + fit.freedom)))
    tests = ((own, fit.freedom), (usual, known + fit.freedom), (policy.LEVELS_OF_SCATTER[1], _CERTAIN))
    for rate in (policy.REFUSAL_RATE, policy.QUESTION_RATE):
        for level, freedom in tests:
            gain = min(one.squares(level) for one in effects) - fit.squares(level)
            if gain > float(fdtri(1, freedom, 1.0 - rate)):
                return _Found(trial, fit, usual, refused=rate == policy.REFUSAL_RATE)
    return None


def _labels_agree(evidence: SlipEvidence, m: MeasuredMotions, best: _Found) -> bool:
    """Whether another label of a run, or an exchange, agrees as well as the best factor."""
    limit = best.fit.squares(best.level) + float(chdtri(1, policy.DIFFERENCE_RATE))
    for labels in mending_statements(evidence):
        if labels.speed.size != m.stated.size:
            continue
        conditions = replace(m.conditions, speed=labels.speed, density=labels.density, clock=labels.clock)
        values, place = np.unique(labels.spring, return_inverse=True)
        other = replace(
            m, stated=labels.spring, place=np.asarray(place), springs=values.size, conditions=conditions
        )
        if fitted(other).squares(best.level) <= limit:
            return True
    return False


def _scaled(key: str, places: Places) -> Changed:
    """A factor 1 + e on a condition of some runs."""

    def change(c: RunConditions, number: float) -> RunConditions:
        values = getattr(c, key).copy()
        values[list(places)] *= 1.0 + number
        return replace(c, **{key: values})

    return change


def _along(key: str, order: Array) -> Changed:
    """A condition that changes in proportion to the place of the run in the campaign."""
    return lambda c, number: replace(c, **{key: getattr(c, key) * (1.0 + number * order)})


def _blowing(places: Places, unit: float) -> Changed:
    """A wind in runs that state none, in units of the least stated wind."""

    def change(c: RunConditions, number: float) -> RunConditions:
        speed = c.speed.copy()
        speed[list(places)] = abs(number) * unit
        return replace(c, speed=speed)

    return change


def _slips(m: MeasuredMotions) -> Iterator[TrialSlip]:
    """All tried slips: in single runs, in groups, a wind in runs that state none, and along the campaign."""
    count, windy = m.stiffness.size, m.conditions.speed > 0.0
    on, off = (tuple(np.flatnonzero(some).tolist()) for some in (windy, ~windy))
    least = policy.LEAST_FACTOR
    for place in range(count) if count <= _MOST_RUNS else ():
        for key in ("speed", "density", "clock", "spring") if windy[place] else ("clock", "spring"):
            yield TrialSlip(_scaled(key, (place,)), (place,), _KINDS[key], least[_KINDS[key]])
    groups = list(dict.fromkeys(_groups(m)))
    for group in groups:
        blown = tuple(place for place in group if windy[place])
        if 1 < len(blown) < len(on) - 1:
            yield TrialSlip(_scaled("density", blown), blown, "air_density", least["air_density of a group"])
            yield TrialSlip(_scaled("speed", blown), blown, "wind_speed", least["wind_speed"])
        if 1 < len(group) < count - 1:
            yield TrialSlip(_scaled("clock", group), group, "time_s", least["time_s"])
    if on and off:
        unit = float(m.conditions.speed[list(on)].min())
        for group in dict.fromkeys([off, *(tuple(p for p in group if not windy[p]) for group in groups)]):
            if group:
                yield TrialSlip(_blowing(group, unit), group, "idle", least["idle"], _IDLE)
    if len(on) > 2:
        order = np.arange(count) / max(count - 1, 1) - 0.5
        for key in ("density", "speed"):
            yield TrialSlip(_along(key, order), on, _KINDS[key] + _ALONG, least["along"])


def _groups(m: MeasuredMotions) -> Iterator[Places]:
    """The runs of each spring, of each stated density, and all runs up to one and from one on."""
    for values in (m.stated, m.conditions.density):
        for value in np.unique(values):
            yield tuple(np.flatnonzero(values == value).tolist())
    count = m.stiffness.size
    for first in range(2, count - 1) if count <= _MOST_RUNS else ():
        yield tuple(range(first, count))
        yield tuple(range(first))


def _effects(m: MeasuredMotions) -> Iterator[TrialSlip]:
    """Effects that change the runs of each wind speed alike: an offset, a dependence on the speed, and a lag."""
    on = m.conditions.speed > 0.0
    if not on.any():
        return
    speeds = np.where(on, m.conditions.speed, 1.0)
    usual, omega = float(np.median(speeds[on])), float(np.sqrt(np.median(m.stiffness)))
    places = tuple(np.flatnonzero(on).tolist())
    logs = np.where(on, np.log(speeds / usual), 0.0)
    phase = np.where(on, usual / (omega * speeds), 0.0)
    yield TrialSlip(lambda c, e: replace(c, speed=c.speed + e * usual * on), places)
    yield TrialSlip(lambda c, e: replace(c, moment=c.moment + e * logs), places)
    for start in _LAGS:
        yield TrialSlip(lambda c, e: replace(c, lag=e * phase), places, start=start)


def _said(m: MeasuredMotions, found: Sequence[_Found]) -> Remark | None:
    """The remark on the best slips."""
    best: dict[tuple[Places, str], _Found] = {}
    for one in found:
        best.setdefault((one.trial.places, one.trial.kind), one)
    shown = list(best.values())[:_MOST_SAID]
    ids = tuple(dict.fromkeys(m.swings[place].run.id for one in shown for place in one.trial.places))
    said = ", or with ".join(_words(m, one.trial, one.fit.number) for one in shown)
    what = f"the stated values contradict frequency and damping of the runs, which agree with {said}"
    names = {"idle": "wind_speed", _ROUNDED: "spring_stiffness (with one more digit)"}
    keys = dict.fromkeys(names.get(one.trial.kind, one.trial.kind.removesuffix(_ALONG)) for one in shown)
    remedy = f"correct {' or '.join(keys)}, or leave {'the run' if len(ids) == 1 else 'these runs'} out"
    outcome = Outcome.REFUSED if found[0].refused else Outcome.NOTED
    figures: dict[str, Any] = {SYSTEMATIC: said}
    return Remark(outcome, ids, what, remedy, figures)


def _words(m: MeasuredMotions, trial: TrialSlip, number: float) -> str:
    """The slip with its size."""
    ids = ", ".join(m.swings[place].run.id for place in trial.places)
    percent = f"{100.0 * abs(number):.2g} %"
    if trial.kind == "time_s":
        return f"time_s of {ids} {percent} {'fast' if number > 0.0 else 'slow'}"
    if trial.kind == _ROUNDED:
        goes = "stiffer" if number > 0.0 else "softer"
        value = f"{m.stated[trial.places[0]]:.4g} N m/rad"
        return f"two springs under the rounded value {value}, the one in {ids} {percent} {goes}"
    if trial.kind == "idle":
        unit = float(m.conditions.speed[m.conditions.speed > 0.0].min())
        return f"a wind of {abs(number) * unit:.2g} m/s in {ids}, which state none"
    if trial.kind.endswith(_ALONG):
        goes = "rising" if number > 0.0 else "falling"
        return f"{trial.kind.removesuffix(_ALONG)} {goes} by {percent} from the first run to the last"
    stated = {
        "wind_speed": m.conditions.speed,
        "air_density": m.conditions.density,
        "spring_stiffness": m.stated,
    }[trial.kind][list(trial.places)]
    given = list(dict.fromkeys(stated.tolist()))
    if len(given) > 1:
        return f"{trial.kind} of {ids} {percent} {'higher' if number > 0.0 else 'lower'}"
    meant = given[0] * (1.0 + number)
    return f"{trial.kind} = {given[0]:.4g} of {ids} as {meant:.3g} {_UNITS[trial.kind]}"
