"""A wind speed or spring of single runs that contradicts the other runs, and the value that would agree.

Each possible slip of one label is a `Label`. The table `LABELS` lists them; a new slip is a line in it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import chdtri

from identification import policy
from identification.examination.slips.base import STIFFNESS_UNITS, SlipEvidence
from identification.examination.slips.fits import Statements, agreement
from identification.status import Outcome, Remark

Key = Literal["spring", "speed", "density", "clock"]
#: Names of the labels, and units for labels that are numbers.
_NAMES: Mapping[Key, str] = {
    "spring": "spring_stiffness", "speed": "wind_speed", "density": "air_density", "clock": "time_s",
}  # fmt: skip
_UNITS: Mapping[Key, str] = {"spring": "N m/rad", "speed": "m/s", "density": "kg/m3"}
_FEWEST = 3  # minimum number of runs: two determine g and n
_MOST_SUSPECTS = 12  # number of runs that agree worst; their labels are tried
_MOST_PAIRED = 40  # number of runs up to which all pairs with a suspect are tried
_MOST_SAID = 3
_TIE = 1.0  # squared tolerances: slips that agree about equally well are all named
_DECIMAL = {
    "with its decimal point one place to the right": 10.0,
    "with its decimal point one place to the left": 0.1,
}


Meant = Callable[[float, Sequence[float]], Iterator[tuple[float, str]]]


@dataclass(frozen=True)
class Label:
    """A slip in one label.

    Args:
        key: which label.
        meant: function from the stated value and the values of the other runs, in the unit of the label, to the
            values that may have been meant, each with words for its origin.
        repeats: whether several runs at once may have the slip, as with a wrong unit.
    """

    key: Key
    meant: Meant
    repeats: bool = True


def _over(factors: Mapping[str, float]) -> Meant:
    """The value in another unit, or with its decimal point elsewhere; 0 has no unit.

    Args:
        factors: the stated value over the intended one, by words that follow "as".
    """

    def meant(value: float, _others: Sequence[float]) -> Iterator[tuple[float, str]]:
        yield from ((value / factor, words) for words, factor in factors.items() if value > 0.0)

    return meant


def _both_ways(factors: Mapping[str, float], unit: str) -> Mapping[str, float]:
    """Factors of units, and of the right unit if the other runs have one of these units."""
    others = {f"{unit}, the others {words}": 1.0 / factor for words, factor in factors.items()}
    return {**factors, **others}


def _as_in_another_run(value: float, others: Sequence[float]) -> Iterator[tuple[float, str]]:
    """Each clearly different value of the other runs."""
    for other in dict.fromkeys(others):
        if other > 0.0 and abs(other - value) > policy.LEAST_SPRING_SPREAD * max(other, value):
            yield other, "as in other runs"


def _without_wind(value: float, _others: Sequence[float]) -> Iterator[tuple[float, str]]:
    """No wind, although a speed is stated."""
    if value > 0.0:
        yield 0.0, "with the wind off"


_SPEEDS = {"in km/h": 3.6, "in knots": 1.9438, "in mph": 2.2369, "in ft/s": 3.2808}
_STIFFNESSES = {f"in {unit}": factor for unit, factor in STIFFNESS_UNITS.items()}
#: The stamped times over the true ones.
_CLOCKS = {
    "in minutes": 60.0,
    "in seconds, the others in minutes": 1.0 / 60.0,
    "in milliseconds": 1e-3,
    "in seconds, the others in milliseconds": 1e3,
    **{
        f"of a run sampled {rate:g} times as {how} as stated": factor
        for rate in (2.0, 4.0, 5.0, 10.0)
        for how, factor in (("fast", 1.0 / rate), ("slowly", rate))
    },
}

LABELS: tuple[Label, ...] = (
    Label("speed", _over(_both_ways(_SPEEDS, "in m/s"))),
    Label("speed", _over(_DECIMAL)),
    Label("speed", _as_in_another_run, repeats=False),
    Label("speed", _without_wind, repeats=False),
    Label("spring", _as_in_another_run, repeats=False),
    Label("spring", _over(_DECIMAL)),
    Label("spring", _over(_both_ways(_STIFFNESSES, "in N m/rad"))),
    Label("density", _over(_DECIMAL)),
    Label("clock", _over(_CLOCKS)),
)


@dataclass(frozen=True, eq=False)
class _Trial:
    """Other labels for some runs.

    Args:
        familiar: whether the values are values of other runs, or no wind.
        said: words for the change.
    """

    places: tuple[int, ...]
    names: tuple[str, ...]
    labels: Statements
    familiar: bool
    said: str


Trials = Callable[[Statements, Sequence[int]], Iterator[_Trial]]


def wrong_label(evidence: SlipEvidence) -> Remark | None:
    """One run's label contradicts the others grossly, and agrees if a common slip is undone. Refused."""
    return _found(evidence, _of_one_run)


def _of_one_run(statements: Statements, suspects: Sequence[int]) -> Iterator[_Trial]:
    """Every label of every suspect."""
    for label in LABELS:
        for place in suspects:
            yield from _relabelled(statements, label, (place,))


def wrong_labels(evidence: SlipEvidence) -> Remark | None:
    """Labels of two runs or settings are exchanged, or one slip is in two runs or a whole setting. Refused."""
    return _found(evidence, _of_several_runs)


def _of_several_runs(statements: Statements, suspects: Sequence[int]) -> Iterator[_Trial]:
    """All exchanges, and every label of every setting and of every pair of suspects."""
    count = len(statements.runs)
    for keys in (("spring",), ("speed",), ("spring", "speed")):
        for i, j in itertools.combinations(range(count) if count <= _MOST_PAIRED else suspects, 2):
            if i in suspects or j in suspects:
                yield from _exchanged(statements, keys, (i,), (j,))
    for label in LABELS:
        settings = _settings(statements, label.key)
        yield from (
            trial for at in settings if 1 < len(at) < count for trial in _relabelled(statements, label, at)
        )
        for at in itertools.combinations(suspects, 2) if label.repeats else ():
            if at not in settings:
                yield from _relabelled(statements, label, at)
    for key in ("spring", "speed"):
        for one, two in itertools.combinations(_settings(statements, key), 2):
            if len(one) + len(two) > 2:
                yield from _exchanged(statements, (key,), one, two)


def _settings(statements: Statements, key: str) -> list[tuple[int, ...]]:
    """The runs of each stated value."""
    values = getattr(statements, key)
    return [tuple(np.flatnonzero(values == value).tolist()) for value in np.unique(values)]


def mending_statements(evidence: SlipEvidence) -> list[Statements]:
    """Statements with other labels that agree with the frequencies, of the runs that state a spring."""
    kinds = (_of_one_run, _of_several_runs)
    return [trial.labels for trials in kinds for trial, _ in _mended(evidence, trials)[1]]


def _mended(evidence: SlipEvidence, trials: Trials) -> tuple[Statements | None, list[tuple[_Trial, float]]]:
    """The stated labels, and the trials that agree, each with its sum of squares."""
    swings = [swing for swing in evidence.swings if swing.run.spring_stiffness]
    if len(swings) < _FEWEST:
        return None, []
    statements = Statements.of(swings)
    stated = agreement(statements)
    suspects = np.argsort(-stated.away)[:_MOST_SUSPECTS]
    if not stated.gross:
        suspects = suspects[stated.away[suspects] > policy.MISFIT_DEVIATIONS]
    tried = (
        list(trials(statements, sorted(suspects.tolist()))) if suspects.size and stated.freedom > 0 else []
    )
    # minimum drop of the sum of squares for one more fitted label
    gain = float(chdtri(1, policy.REFUSAL_RATE))
    mended = []
    for trial in tried:
        found = agreement(trial.labels)
        if found.good and (stated.gross or stated.squares - found.squares > gain):
            mended.append((trial, found.squares))
    return statements, mended


def _found(evidence: SlipEvidence, trials: Trials) -> Remark | None:
    """A refusal that names the runs; none if the statements may be right, or no slip agrees."""
    statements, mended = _mended(evidence, trials)
    if statements is None or not mended:
        return None
    limit = min(squares for _, squares in mended) + _TIE
    mended = [(trial, squares) for trial, squares in mended if squares <= limit]
    best: dict[tuple[int, ...], _Trial] = {}
    for trial, _ in sorted(mended, key=lambda pair: not pair[0].familiar):  # the first of equals in the table
        if trial.familiar or trial.places not in best:
            best.setdefault(trial.places, trial)
    shown = sorted(best.values(), key=lambda trial: len(trial.places))[:_MOST_SAID]
    said = ", or with ".join(trial.said for trial in shown)
    ids = tuple(dict.fromkeys(statements.runs[i].id for trial in shown for i in trial.places))
    what = f"the stated values contradict the frequencies of the other runs, which agree with {said}"
    names = " or ".join(dict.fromkeys(name for trial in shown for name in trial.names))
    return Remark(Outcome.REFUSED, ids, what, f"correct {names}, or leave the run out")


def _relabelled(statements: Statements, label: Label, places: tuple[int, ...]) -> Iterator[_Trial]:
    """The campaign with other intended values in some runs, by the same slip in each."""
    values = getattr(statements, label.key)
    others = [float(value) for i, value in enumerate(values.tolist()) if i not in places]
    ids = ", ".join(statements.runs[i].id for i in places)
    name, unit = _NAMES[label.key], _UNITS.get(label.key)
    for options in zip(*(list(label.meant(float(values[i]), others)) for i in places), strict=False):
        if len({words for _, words in options}) > 1:
            continue
        changed = values.copy()
        changed[list(places)] = [value for value, _ in options]
        familiar = unit is None or all(
            value == 0.0 or any(abs(value - o) <= policy.LEAST_SPRING_SPREAD * o for o in others)
            for value, _ in options
        )
        words = options[0][1]
        said = f"{name} of {ids} {words}"
        if unit is not None:
            before, after = (
                " and ".join(dict.fromkeys(f"{value:.4g}" for value in some))
                for some in (values[list(places)].tolist(), [value for value, _ in options])
            )
            said = f"{name} = {before} of {ids} as {after} {unit} ({words})"
        yield _Trial(places, (name,), replace(statements, **{label.key: changed}), familiar, said)


def _exchanged(
    statements: Statements, keys: Sequence[str], one: tuple[int, ...], two: tuple[int, ...]
) -> Iterator[_Trial]:
    """The campaign with the labels of two sets of runs exchanged, if all of them differ."""
    changes = {}
    for key in keys:
        values = getattr(statements, key)
        low, high = sorted((values[one[0]], values[two[0]]))
        if high - low <= policy.SAME_PRESSURE * high:
            return
        changed = values.copy()
        changed[list(one)], changed[list(two)] = values[two[0]], values[one[0]]
        changes[key] = changed
    sides = (", ".join(statements.runs[i].id for i in side) for side in (one, two))
    names = tuple(_NAMES[key] for key in _NAMES if key in keys)
    said = f"{' and '.join(names)} of {' and '.join(sides)} exchanged"
    yield _Trial(tuple(sorted((*one, *two))), names, replace(statements, **changes), True, said)
