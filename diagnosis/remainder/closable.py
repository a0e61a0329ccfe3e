"""The remainder of a gap, and the share of it that each kind of law could explain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from diagnosis.likelihood.ceiling import Ceiling
from tunnel_sim.files.from_json import from_json_fields
from tunnel_sim.files.writing import as_json


@dataclass(frozen=True)
class Curve:
    """The missing moment, or error of the reading, as a function of one quantity or two.

    Args:
        over: the quantities: ``angle`` (rad), ``rate`` (rad/s) or ``time`` (s).
        values: values at all places, the last quantity varying fastest, in ``unit``. A part in proportion to
            angle or rate is removed, because it belongs to the model's own coefficients.
        std: standard deviations of the values, in ``unit``.
        unit: of values and standard deviations.
    """

    over: tuple[str, ...]
    places: tuple[tuple[float, ...], ...]
    values: tuple[float, ...]
    std: tuple[float, ...]
    unit: str


@dataclass(frozen=True)
class Line:
    """A steady line in the readings, beyond chance.

    Args:
        frequency_hz: Hz.
        frequency_std_hz: standard deviation of the frequency, Hz.
        amplitude: root mean square over the runs, in ``unit``.
        amplitude_std: standard deviation of the amplitude, in ``unit``.
        unit: unit of the readings.
        false_alarm_rate: false-alarm rate of lines, a fraction of the campaigns without one.
    """

    frequency_hz: float
    frequency_std_hz: float
    amplitude: float
    amplitude_std: float
    unit: str
    false_alarm_rate: float


@dataclass(frozen=True)
class Law:
    """A formula that explains the residual, fitted like any other effect.

    Args:
        effect: the table of an effects file that states the formula.
        parameters: value and standard deviation by name, in the unit that the table states.
        closed: share of the residual that it explains, on held-out runs.
        std: standard deviation of the share, from the scatter of the runs.
    """

    effect: Mapping[str, Any]
    parameters: Mapping[str, tuple[float, float]]
    closed: float
    std: float

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name; each parameter as ``value`` and ``std``."""
        parameters = {name: {"value": value, "std": std} for name, (value, std) in self.parameters.items()}
        found: dict[str, Any] = as_json({**vars(self), "parameters": parameters})
        return found

    @from_json_fields
    @staticmethod
    def _fields(data: Mapping[str, Any]) -> Mapping[str, Any]:
        """The fields, each parameter as its value and standard deviation."""
        parameters = {name: (one["value"], one["std"]) for name, one in data["parameters"].items()}
        return {**data, "parameters": parameters}


@dataclass(frozen=True)
class Closable:
    """The part of the answer's residual that could be explained.

    Args:
        excess: excess of the answer in the fitted runs, in noise variances of a sample.
        kind: the simplest of `KINDS` that explains about as much as any other.
        words: the result in sentences; empty until they are written.
        events: places of a kind that differs from run to run: ``run``, its ``share``, ``from_s`` and ``to_s``.
        curve: the law of the kind; None where it has none.
        alike: other kinds that explain about as much, measured in the same way.
        next_most: greatest share of the other kinds, measured in the same way; None without others.
        line: of the kind ``line``; else None.
    """

    excess: float
    ceilings: tuple[Ceiling, ...]
    kind: str
    words: str = ""
    events: tuple[Mapping[str, Any], ...] = ()
    curve: Curve | None = None
    law: Law | None = None
    alike: tuple[str, ...] = ()
    next_most: float | None = None
    line: Line | None = None
