"""A wind speed or a spring of single runs that contradicts the other runs, and the value that would agree.

What can go wrong with one label is a `Label`. The table `LABELS` lists them; a new one is a class and a line in it.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

from scipy.special import chdtri

from identification import policy
from identification.examination.slips.base import Seen, StatementSlip
from identification.examination.slips.fits import Agreement, Statements, agreement
from identification.status import Outcome, Remark

Key = Literal["spring", "speed", "density", "clock"]
#: Names of the labels, and the units of those that are numbers of their own.
_NAMES: Mapping[Key, str] = {
    "spring": "spring_stiffness", "speed": "wind_speed", "density": "air_density", "clock": "time_s",
}  # fmt: skip
_UNITS: Mapping[Key, str] = {"spring": "N m/rad", "speed": "m/s", "density": "kg/m3"}
_FEWEST = 3  # runs: two determine g and n
_MOST_PAIRED = 40  # runs of which all pairs are tried: more take over a second
_DECIMAL = {"with its decimal point one place to the right": 10.0, "with its decimal point one place to the left": 0.1}


class Label(ABC):
    """A slip in one label: which values may have been meant.

    Attributes:
        key: which label.
        repeats: whether the same slip may be in several runs at once, as that of a unit is.
    """

    key: ClassVar[Key]
    repeats: ClassVar[bool] = True

    @abstractmethod
    def meant(self, value: float, others: Sequence[float]) -> Iterator[tuple[float, str]]:
        """Values that may have been meant by a stated one, each with words for how it came about.

        Args:
            others: stated in the other runs.
        """


@dataclass(frozen=True)
class InAnotherUnit(Label):
    """The value in another unit, or its decimal point elsewhere.

    Args:
        factors: the stated value over the one meant, by words that follow "as".
    """

    factors: Mapping[str, float] = field(default_factory=dict)

    def meant(self, value: float, others: Sequence[float]) -> Iterator[tuple[float, str]]:  # noqa: ARG002
        """The value over each factor; 0 has no unit."""
        for words, factor in self.factors.items():
            if value > 0.0:
                yield value / factor, words


@dataclass(frozen=True)
class SpeedInAnotherUnit(InAnotherUnit):
    """A speed in km/h, knots, mph or ft/s, or converted from km/h twice."""

    key: ClassVar[Key] = "speed"
    factors: Mapping[str, float] = field(
        default_factory=lambda: {"in km/h": 3.6, "in knots": 1.9438, "in mph": 2.2369, "in ft/s": 3.2808,
                                 "in m/s, the others in km/h": 1.0 / 3.6}
    )  # fmt: skip


@dataclass(frozen=True)
class SpeedDecimal(InAnotherUnit):
    """A speed whose decimal point is one place off."""

    key: ClassVar[Key] = "speed"
    factors: Mapping[str, float] = field(default_factory=lambda: _DECIMAL)


@dataclass(frozen=True)
class SpringInAnotherUnit(InAnotherUnit):
    """A stiffness in N mm/rad, N cm/rad, N m/deg, kgf m/rad or lbf in/rad."""

    key: ClassVar[Key] = "spring"
    factors: Mapping[str, float] = field(
        default_factory=lambda: {"in N mm/rad": 1e3, "in N cm/rad": 1e2, "in N m/deg": 1.0 / 57.2958,
                                 "in kgf m/rad": 1.0 / 9.80665, "in lbf in/rad": 8.8507}
    )  # fmt: skip


@dataclass(frozen=True)
class SpringDecimal(InAnotherUnit):
    """A stiffness whose decimal point is one place off."""

    key: ClassVar[Key] = "spring"
    factors: Mapping[str, float] = field(default_factory=lambda: _DECIMAL)


@dataclass(frozen=True)
class DensityDecimal(InAnotherUnit):
    """An air density whose decimal point is one place off."""

    key: ClassVar[Key] = "density"
    factors: Mapping[str, float] = field(default_factory=lambda: _DECIMAL)


@dataclass(frozen=True)
class TimeInAnotherUnit(Label):
    """Times in minutes or milliseconds, or of a run that was sampled at another rate than the others."""

    key: ClassVar[Key] = "clock"

    def meant(self, value: float, others: Sequence[float]) -> Iterator[tuple[float, str]]:  # noqa: ARG002
        """The stamped times over true ones."""
        yield value / 60.0, "in minutes"
        yield value * 1e3, "in milliseconds"
        for rate in (2.0, 4.0, 5.0, 10.0):
            yield value * rate, f"of a run sampled {rate:g} times as fast as stated"
            yield value / rate, f"of a run sampled {rate:g} times as slowly as stated"


@dataclass(frozen=True)
class OfAnotherRun(Label):
    """A label that belongs to another run of the campaign."""

    repeats: ClassVar[bool] = False

    def meant(self, value: float, others: Sequence[float]) -> Iterator[tuple[float, str]]:
        """Each value of the others that differs clearly."""
        for other in dict.fromkeys(others):
            if other > 0.0 and abs(other - value) > policy.LEAST_SPRING_SPREAD * max(other, value):
                yield other, "as in other runs"


@dataclass(frozen=True)
class SpeedOfAnotherRun(OfAnotherRun):
    """The wind speed of another setting."""

    key: ClassVar[Key] = "speed"


@dataclass(frozen=True)
class SpringOfAnotherRun(OfAnotherRun):
    """The stiffness of another spring."""

    key: ClassVar[Key] = "spring"


@dataclass(frozen=True)
class WindOff(Label):
    """A speed stated, and the wind off."""

    key: ClassVar[Key] = "speed"
    repeats: ClassVar[bool] = False

    def meant(self, value: float, others: Sequence[float]) -> Iterator[tuple[float, str]]:  # noqa: ARG002
        """No wind."""
        if value > 0.0:
            yield 0.0, "with the wind off"


LABELS: tuple[Label, ...] = (
    SpeedInAnotherUnit(),
    SpeedDecimal(),
    SpeedOfAnotherRun(),
    WindOff(),
    SpringOfAnotherRun(),
    SpringDecimal(),
    SpringInAnotherUnit(),
    DensityDecimal(),
)
#: Tried where none of the above explains the runs.
RARE_LABELS: tuple[Label, ...] = (TimeInAnotherUnit(),)


@dataclass(frozen=True, eq=False)
class _Trial:
    """Runs with another label, and how the campaign agrees then."""

    places: tuple[int, ...]
    key: Key
    stated: tuple[float, ...]
    values: tuple[float, ...]
    words: str
    found: Agreement


@dataclass(frozen=True)
class WrongLabel(StatementSlip):
    """One run's label contradicts the others grossly and agrees if a common slip is undone. Refused, with its name."""

    labels: tuple[Label, ...] = LABELS

    def find(self, seen: Seen) -> tuple[Remark, ...]:
        """Try every label of every run."""
        return _found(seen, self._places)

    def _places(self, statements: Statements) -> Iterator[tuple[Label, tuple[int, ...]]]:
        for label in self.labels:
            yield from ((label, (place,)) for place in range(len(statements.runs)))


@dataclass(frozen=True)
class WrongLabels(StatementSlip):
    """The same slip in two runs, or in all runs of one setting. Refused, with their names."""

    labels: tuple[Label, ...] = LABELS

    def find(self, seen: Seen) -> tuple[Remark, ...]:
        """Try every label of every setting and of every pair."""
        return _found(seen, self._places)

    def _places(self, statements: Statements) -> Iterator[tuple[Label, tuple[int, ...]]]:
        count = len(statements.runs)
        for label in self.labels:
            values = getattr(statements, label.key)
            settings = {tuple(i for i in range(count) if values[i] == value) for value in set(values.tolist())}
            yield from ((label, at) for at in sorted(settings) if 1 < len(at) < count)
            pairs = itertools.combinations(range(count), 2) if label.repeats and count <= _MOST_PAIRED else ()
            yield from ((label, at) for at in pairs if at not in settings)


def _found(
    seen: Seen, places: Callable[[Statements], Iterator[tuple[Label, tuple[int, ...]]]]
) -> tuple[Remark, ...]:
    """A refusal that names the runs; none where the statements may be right, or no slip agrees."""
    swings = [swing for swing in seen.swings if swing.run.spring_stiffness]
    if len(swings) < _FEWEST:
        return ()
    statements = Statements.of(swings)
    if not agreement(statements).gross:
        return ()
    tried = (trial for label, at in places(statements) for trial in _tried(statements, label, at))
    trials = [trial for trial in tried if trial.found.good]
    return (_refusal(statements, trials),) if trials else ()


def _tried(statements: Statements, label: Label, places: tuple[int, ...]) -> Iterator[_Trial]:
    """The campaign with the values that may have been meant in some runs."""
    values = getattr(statements, label.key)
    others = [float(value) for i, value in enumerate(values.tolist()) if i not in places]
    meant = [list(label.meant(float(values[i]), others)) for i in places]
    for options in zip(*meant, strict=False):  # the same way of slipping in every run
        changed = values.copy()
        changed[list(places)] = [value for value, _ in options]
        if len({words for _, words in options}) == 1:
            found = agreement(replace(statements, **{label.key: changed}))
            stated = tuple(float(values[i]) for i in places)
            yield _Trial(places, label.key, stated, tuple(v for v, _ in options), options[0][1], found)


def _refusal(statements: Statements, trials: Sequence[_Trial]) -> Remark:
    """The slips that agree about equally well, the commonest of each set of runs."""
    limit = min(trial.found.squares for trial in trials) + float(chdtri(1, policy.SLIP_AGREES))
    best: dict[tuple[int, ...], _Trial] = {}
    for trial in trials:  # the commonest slip first
        if trial.found.squares <= limit:
            best.setdefault(trial.places, trial)
    said = []
    for trial in best.values():
        names = ", ".join(statements.runs[i].id for i in trial.places)
        stated, value = (
            " and ".join(dict.fromkeys(f"{v:.4g}" for v in some)) for some in (trial.stated, trial.values)
        )
        values = f" = {stated}" if trial.key in _UNITS else ""
        instead = f" as {value} {_UNITS[trial.key]} ({trial.words})" if trial.key in _UNITS else f" {trial.words}"
        said.append(f"{_NAMES[trial.key]}{values} of {names}{instead}")
    ids = tuple(dict.fromkeys(statements.runs[i].id for places in best for i in places))
    what = "what is stated contradicts the frequencies of the other runs, which agree with " + ", or with ".join(said)
    names = " or ".join(dict.fromkeys(_NAMES[trial.key] for trial in best.values()))
    return Remark(Outcome.REFUSED, ids, what, f"correct {names}, or leave the run out")
