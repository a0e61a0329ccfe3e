"""From the numbers of a column to seconds and radians."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import pi
from pathlib import Path

import numpy as np

from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.tables import Channel
from tunnel_sim.files.importing.units import UNITS, kind_of, known_unit
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.campaign import Quantity
from tunnel_sim.vocabulary.errors import TunnelError, one_line, shown
from tunnel_sim.vocabulary.record import Array

_SLOWEST_STEP = 0.5  # s: a longer step between samples is one in milliseconds, or in microseconds
_HALF_TURN = pi  # half the span of an angle: more is taken as degrees
_NUMBER = r"([+-]?\s*\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)"
_FORMULA = re.compile(rf"^\s*(?:{_NUMBER}\s*(?=[+-]))?\s*{_NUMBER}?\s*\*?\s*[VvXx]\s*(?:{_NUMBER})?\s*$")
_RATE_FACTS = re.compile(
    r"(?i)(^|[^a-z])(fs|sample[ _]?rate|sampling[ _]?(rate|frequency)|samplerate)($|[^a-z])"
)
_STEP_FACTS = re.compile(
    r"(?i)(^|[^a-z])(ts|dt|delta_?t|sample[ _]?(time|interval)|sampling[ _]?(time|interval)|wf_increment)($|[^a-z])"
)

_STEPS = (1.0 / limits.FASTEST_RATE, 1.0 / limits.SLOWEST_RATE)  # s

Calibration = tuple[Array, Array] | tuple[float, float]
"""Voltages and readings of a table, each of shape (n,); or offset and factor of a straight line."""


def stated_unit(text: str | None, kinds: Sequence[str], option: str) -> str | None:
    """The unit that an option names.

    Args:
        text: as typed; None where the option is not given.
        kinds: keys of `UNITS` that it may belong to.
        option: its name, for messages.

    Raises:
        TunnelError: not a unit of these kinds.
    """
    unit = known_unit(text) if text is not None else None
    if text is not None and (unit is None or kind_of(unit) not in kinds):
        names = ", ".join(name for kind in kinds for name in UNITS[kind])
        raise TunnelError(f"unknown unit '{one_line(text, 20)}'", where=option, remedy=f"use one of {names}")
    return unit


def sample_interval(facts: Mapping[str, float], choices: ImportChoices) -> tuple[float | None, str]:
    """The interval of samples that have no times.

    Args:
        facts: numbers of the file, by name.

    Returns:
        The interval, s, None where nothing states it; and what states it.
    """
    if choices.rate is not None:
        return 1.0 / choices.rate, f"{choices.rate:g} Hz as stated"
    for pattern, is_rate in ((_RATE_FACTS, True), (_STEP_FACTS, False)):
        least, most = (limits.SLOWEST_RATE, limits.FASTEST_RATE) if is_rate else _STEPS
        for name, value in facts.items():
            if pattern.search(name) and least <= value <= most:
                return 1.0 / value if is_rate else float(value), f"'{name}' = {value:g} in the file"
    return None, ""


def in_seconds(time: Channel, choices: ImportChoices, said: list[str], where: str) -> Array:
    """Times in s.

    Args:
        time: the column, shape (n,).
        said: a remark is added where the unit is guessed from the step.

    Returns:
        Shape (n,).

    Raises:
        TunnelError: a column in another unit.
    """
    unit = stated_unit(choices.time_unit, ("time",), "--time-unit") or time.unit
    if unit and kind_of(unit) != "time":
        raise TunnelError(
            f"'{one_line(time.name, 40)}' is in '{one_line(unit, 20)}', which is not a unit of time",
            where=where,
            remedy="give --time-unit, or --time with the name of another column",
        )
    if not unit:
        steps = np.diff(np.sort(time.values[np.isfinite(time.values)]))  # rows may be out of order
        step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
        unit = "s" if step <= _SLOWEST_STEP else "ms" if step <= 1e3 * _SLOWEST_STEP else "us"
        said.append(f"no unit of the times in the file: steps of {step:.4g} are taken as {unit}")
    return time.values * UNITS["time"][unit] if unit != "s" else time.values


def in_radians(
    reading: Channel, choices: ImportChoices, calibration: Calibration | None, said: list[str], where: str
) -> tuple[Array, Quantity, str]:
    """Readings in rad, rad/s or rad/s².

    Args:
        reading: the column, shape (n,).
        calibration: of a voltage.
        said: a remark is added where the unit is guessed.

    Returns:
        The readings, shape (n,), what they are, and the unit they were taken to have.

    Raises:
        TunnelError: counts without counts per turn, volts without a calibration, another unit, or a swing of more
            than half a turn in degrees that the user has not stated.
    """
    kinds = ("angle", "counts", "voltage", "rate", "acceleration")
    unit = stated_unit(choices.unit, kinds, "--unit") or reading.unit
    if unit and kind_of(unit) not in kinds and choices.counts_per_turn is None and calibration is None:
        raise TunnelError(
            f"'{one_line(reading.name, 40)}' is in '{one_line(unit, 20)}', which is not a known unit of an angle",
            where=where,
            remedy="give --unit, --counts-per-turn N or --calibration",
        )
    values = reading.values
    if calibration is not None:
        volts = values * UNITS["voltage"].get(unit, 1.0)
        values = _calibrated(volts, calibration, where)
        unit = unit if kind_of(unit) == "angle" else ""
        said.append(f"'{reading.name}' converted by the calibration")
    elif choices.counts_per_turn is not None:
        values, unit = values / choices.counts_per_turn, "turns"
        said.append(f"'{reading.name}' holds counts, {choices.counts_per_turn:g} per turn")
    if kind_of(unit) in ("counts", "voltage"):
        option = "--counts-per-turn N" if kind_of(unit) == "counts" else '--calibration "a + b*V"'
        raise TunnelError(f"'{reading.name}' is in {unit}", where=where, remedy=f"give {option}")
    if not unit:
        swing = 0.5 * float(np.nanmax(values) - np.nanmin(values))
        unit = "deg" if swing > _HALF_TURN else "rad"
        said.append(
            f"no unit of '{reading.name}': a swing of ±{swing:.4g} is taken as {unit}; --unit says otherwise"
        )
    kind = kind_of(unit)
    factor = UNITS[kind][unit]
    quantity: Quantity = "rate" if kind == "rate" else "acceleration" if kind == "acceleration" else "angle"
    values = values if factor == 1.0 else values * factor
    swing = 0.5 * float(np.nanmax(values) - np.nanmin(values))
    # A disc between springs swings as far, but counts look like degrees.
    if unit == "deg" and choices.unit is None and calibration is None and swing > _HALF_TURN:
        raise TunnelError(
            f"'{one_line(reading.name, 40)}' would swing by ±{swing / factor:.4g}°, more than half a turn",
            where=where,
            remedy="give --unit deg if it does; of an encoder --counts-per-turn N",
        )
    return values, quantity, unit


def read_calibration(text: str | None) -> Calibration | None:
    """The calibration that ``--calibration`` states.

    Args:
        text: a formula such as ``0.1 + 20*V``, or the name of a text file of two columns, volts and angle.

    Raises:
        TunnelError: neither of them.
    """
    if text is None:
        return None
    formula = _FORMULA.match(text)
    if formula:
        before, factor, behind = (part and float(part.replace(" ", "")) for part in formula.groups())
        if not (before is not None and behind is not None):
            return float(before or behind or 0.0), float(1.0 if factor is None else factor)
    from tunnel_sim.files.importing.source import read_source

    path = Path(text)
    if formula or not path.is_file():
        raise TunnelError(
            "is not a formula", where=f"--calibration {one_line(text, 40)}",
            remedy="give 'a + b*V' with numbers for a and b, or the name of a table of two columns",
        )  # fmt: skip
    channels = read_source(path, ImportChoices()).tables[0].channels
    if len(channels) != 2 or channels[0].values.size < 2:
        raise TunnelError("is not a table of two columns", where=shown(path), remedy="give volts and angle")
    order = np.argsort(channels[0].values)
    factor = UNITS["angle"].get(channels[1].unit, 1.0)
    return channels[0].values[order], channels[1].values[order] * factor


def _calibrated(volts: Array, calibration: Calibration, where: str) -> Array:
    first, second = calibration
    if isinstance(first, float):
        return first + second * volts
    if np.nanmin(volts) < first[0] or np.nanmax(volts) > first[-1]:
        raise TunnelError(
            f"readings from {np.nanmin(volts):.4g} to {np.nanmax(volts):.4g} V go beyond the calibration table",
            where=where,
            remedy=f"calibrate beyond {first[0]:.4g} to {first[-1]:.4g} V, or give a formula",
        )
    return np.interp(volts, first, second)
