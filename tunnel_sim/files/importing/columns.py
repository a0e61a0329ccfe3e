"""Which columns are times and angles, and which belong to the same run."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.conditions import condition_of
from tunnel_sim.files.importing.tables import Channel, Table
from tunnel_sim.files.importing.units import kind_of
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, one_line

RUN_MARK = re.compile(
    r"[\s_,;.#(\[-]*(?:run|trial|test|swing|rep|versuch|messung|lauf)[\s_#.-]*(\d+)[)\]]?\s*$", re.IGNORECASE
)
_TIME = re.compile(
    r"(?<![a-z])(t|time|times|timestamp|zeit|temps|tiempo|tempo|tijd|tid|elapsed|uhrzeit|x_value)(?![a-z])",
    re.IGNORECASE,
)
_ANGLE = re.compile(
    r"angle|winkel|angolo|yaw|(?<![a-z])(theta|beta|psi|phi|alpha|pitch|roll|pos|position|encoder|rotation|deg|rad)"
    r"(?![a-z])|[θβψφα]",
    re.IGNORECASE,
)
_RATE = re.compile(r"(?<![a-z])(rate|velocity|omega|gyro|speed|vel)(?![a-z])|[ωβθ]̇|dot|ω", re.IGNORECASE)
_OTHER = re.compile(
    r"(?<![a-z])(index|idx|sample|samples|nr|no|row|#|frame|temperature|current|force)(?![a-z])", re.I
)
_HEAD = 20_000  # samples in which a column without a name is looked at
_STEADY = 0.5  # of the usual step: the steps of a clock differ by less
_HARDLY = 0.02  # of the span of another column in the same unit
_DERIVATIVE = 0.9  # correlation with the derivative of another column, from which on a column is its rate


@dataclass(frozen=True, eq=False)
class Pair:
    """The columns of one run.

    Args:
        run: its name in the table; empty where the table holds one run.
        time: the column of times; None where the samples follow at a sample rate.
        reading: the column of angles, rates or accelerations.
        said: why these columns were taken.
    """

    run: str
    time: Channel | None
    reading: Channel
    said: tuple[str, ...] = ()


def stem(name: str) -> str:
    """The name of a column without the number of its run."""
    return RUN_MARK.sub("", name)


def find_pairs(table: Table, choices: ImportChoices, where: str) -> list[Pair]:
    """The columns of each run.

    Args:
        table: of a file.

    Returns:
        The columns of each run; at least one.

    Raises:
        TunnelError: a column that is not there, no column of angles, or several that may be it.
    """
    pairs = []
    for block in _blocks(table.channels, choices):
        said: list[str] = []
        time = _time(block, choices, said, where, headed=table.headed)
        readings = _readings(block, time, choices, said, where)
        pairs += [Pair(_run_name(reading, len(readings)), time, reading, tuple(said)) for reading in readings]
    if not pairs:
        raise TunnelError(
            f"no column of angles (columns found: {_listed(table.channels)})",
            where=where,
            remedy="give --angle NAME and its --unit",
        )
    return pairs


def _run_name(reading: Channel, count: int) -> str:
    mark = RUN_MARK.search(reading.name)
    return f"run-{mark[1]}" if mark else reading.name if count > 1 else ""


def _blocks(channels: Sequence[Channel], choices: ImportChoices) -> list[list[Channel]]:
    """Groups of columns side by side, each of which begins with its own times."""
    starts = [
        i for i, channel in enumerate(channels) if _matches(channel, choices.time or "") or _is_time(channel)
    ]
    stems = {stem(channels[i].name) for i in starts}
    repeated = len(starts) > 1 and (len(stems) == 1 or all("#" in channels[i].name for i in starts))
    if not repeated:
        return [list(channels)]
    ends = [*starts[1:], len(channels)]
    return [list(channels[start:end]) for start, end in zip(starts, ends, strict=True)]


def _is_time(channel: Channel) -> bool:
    kind = kind_of(channel.unit)
    if condition_of(channel.name, channel.unit) is not None:
        return False
    return kind == "time" or (kind == "" and _TIME.search(channel.name) is not None)


def _matches(channel: Channel, wanted: str) -> bool:
    names = (
        channel.name,
        stem(channel.name),
        f"{channel.name} ({channel.unit})",
        f"{channel.name}_{channel.unit}",
    )
    return wanted.lower() in (name.lower() for name in names)


def _chosen(block: Sequence[Channel], wanted: str, option: str, where: str) -> list[Channel]:
    """The columns that a name or a number means."""
    found = [channel for channel in block if _matches(channel, wanted)]
    if not found and wanted.isdigit() and 1 <= int(wanted) <= len(block):
        found = [block[int(wanted) - 1]]
    if not found:
        raise TunnelError(
            f"no column '{one_line(wanted, 40)}' (columns found: {_listed(block)})",
            where=where,
            remedy=f"{option}: {did_you_mean(wanted, {channel.name for channel in block})}",
        )
    return found


def _time(
    block: Sequence[Channel], choices: ImportChoices, said: list[str], where: str, *, headed: bool
) -> Channel | None:
    """The column of times; None where the samples follow at a stated rate."""
    if choices.time is not None:
        return _chosen(block, choices.time, "--time", where)[0]
    named = [channel for channel in block if _is_time(channel)]
    if named:
        if len(named) > 1:
            said.append(f"times from '{named[0].name}', the first of {len(named)} columns of times")
        return named[0]
    if choices.rate is not None:
        return None
    free = [c for c in _unconditional(block) if c.unit == "" and not _OTHER.search(c.name)]
    guessed = next((c for c in free if _is_clock(c.values)), None)
    if guessed is not None:
        why = "evenly stepped numbers" + ("" if headed else ", and the file names no columns")
        said.append(f"times from '{guessed.name}': {why}")
    return guessed


def _is_clock(values: np.ndarray) -> bool:
    """Whether numbers, once sorted, go up in steady steps; a count of samples does not pass."""
    numbers = values[np.isfinite(values)][:_HEAD]
    steps = np.diff(np.sort(numbers))
    if steps.size < 8 or not steps.max() > 0.0:
        return False
    usual = float(np.median(steps))
    count = usual == 1.0 and bool((numbers == np.round(numbers)).all())
    return not count and float(np.mean(np.abs(steps - usual) < _STEADY * usual)) > 0.9


def _readings(
    block: Sequence[Channel], time: Channel | None, choices: ImportChoices, said: list[str], where: str
) -> list[Channel]:
    """The columns that hold angles, or what the sensor measures instead."""
    if choices.angle:
        chosen = [c for name in choices.angle for c in _chosen(block, name, "--angle", where)]
        return [channel for channel in chosen if channel is not time]
    others = [channel for channel in _unconditional(block) if channel is not time]
    moving = [channel for channel in others if _span(channel) > 0.0]
    levels = [
        [
            c
            for c in moving
            if kind_of(c.unit) == "angle" or (_by_name(c) and kind_of(c.unit) in ("counts", "voltage"))
        ],
        [c for c in moving if c.unit == "" and _by_name(c)],
        [c for c in moving if kind_of(c.unit) == "counts"],
        [c for c in moving if c.unit == "" and not _OTHER.search(c.name) and not _RATE.search(c.name)],
        [c for c in moving if kind_of(c.unit) == "voltage"],
        [c for c in moving if kind_of(c.unit) in ("rate", "acceleration")],
    ]
    found = next((level for level in levels if level), [])
    still = [
        c for c in found if _span(c) < _HARDLY * max(_span(other) for other in found if other.unit == c.unit)
    ]
    said += [f"'{stem(channel.name)}' is left out: it hardly moves" for channel in still]
    found = [channel for channel in found if channel not in still]
    while len(found) > 1 and (rate := _a_rate(found, time)) is not None:
        said.append(f"'{stem(rate.name)}' is left out: it is the rate of another column")
        found.remove(rate)
    if len(found) > 1 and not (
        len({stem(c.name) for c in found}) == 1 and all(RUN_MARK.search(c.name) for c in found)
    ):
        raise TunnelError(
            f"{len(found)} columns may be the angle: {_listed(found)}",
            where=where,
            remedy=f'give --angle "{found[0].name}", or another of them',
        )
    said += [f"angle from '{stem(channel.name)}'" for channel in found if len(others) > 1]
    return found


def _unconditional(block: Sequence[Channel]) -> list[Channel]:
    return [channel for channel in block if condition_of(channel.name, channel.unit) is None]


def _by_name(channel: Channel) -> bool:
    return _ANGLE.search(channel.name) is not None and _RATE.search(channel.name) is None


def _span(channel: Channel) -> float:
    """From the least to the greatest number."""
    numbers = channel.values[np.isfinite(channel.values)]
    return float(np.ptp(numbers)) if numbers.size else 0.0


def _a_rate(channels: Sequence[Channel], time: Channel | None) -> Channel | None:
    """A column that follows the derivative of another one; None where there is none."""
    if time is None:
        return None
    for angle in channels:
        for rate in channels:
            values = np.stack([c.values[:_HEAD] for c in (time, angle, rate)])
            clock, first, second = values[:, np.isfinite(values).all(axis=0)]
            if angle is rate or clock.size < 8 or not (np.diff(clock) > 0.0).all():
                continue
            slope = np.gradient(first, clock)
            if np.ptp(slope) > 0.0 < np.ptp(second) and np.corrcoef(slope, second)[0, 1] > _DERIVATIVE:
                return rate
    return None


def _listed(channels: Sequence[Channel]) -> str:
    names = [f"'{channel.name}'" for channel in channels]
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
