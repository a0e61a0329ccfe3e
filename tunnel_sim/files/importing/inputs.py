"""Which column of a table is the input of a driven run: by name, unit and correlation with the motion."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from tunnel_sim.files.importing.conditions import ImportChoices, condition_of
from tunnel_sim.files.importing.tables import UNITS, Channel, kind_of
from tunnel_sim.vocabulary.drive import INPUT_COLUMNS, Drive, InputColumn, checked_drive
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, one_line
from tunnel_sim.vocabulary.record import Array, Record

_MOMENTS = ("nm", "n-m", "n*m", "n·m", "newton metre", "newton meter", "n_m")
_NAMES = re.compile(
    r"(?<![a-z])(torque|moment|drehmoment|drive|input|excitation|anregung|command|cmd|control|motor|shaker|actuator|"
    r"tau|effort|u|base|root)(?![a-z])",
    re.IGNORECASE,
)
_BASE = re.compile(r"(?<![a-z])(base|root)(?![a-z])", re.IGNORECASE)
_CORRELATED = 0.3  # greatest correlation at any lag, from which on a column drives the motion


def is_input(channel: Channel) -> bool:
    """Whether a column is named as the format names an input, so that it is not the reading."""
    return heading(channel) in INPUT_COLUMNS


def heading(channel: Channel) -> str:
    """The name of a column with its unit, as the format writes it."""
    name = channel.name.strip().lower()
    return f"{name}_{channel.unit}" if channel.unit else name


def is_stated(channel: Channel, choices: ImportChoices) -> bool:
    """Whether a column is stated to be the input, with its unit or without."""
    bare = re.sub(r"\s*[(\[].*", "", channel.name.lower())
    return choices.input is not None and choices.input.lower() in (
        channel.name.lower(),
        bare,
        heading(channel),
    )


def find_input(
    channels: Sequence[Channel],
    beside: Sequence[Channel | None],
    reading: Array,
    choices: ImportChoices,
    said: list[str],
    where: str,
) -> tuple[InputColumn, Array] | None:
    """The input of a run.

    Args:
        channels: of its table.
        beside: the columns of times and reading.
        reading: shape (n,), rad, rad/s or rad/s².
        said: a remark is added where a column was found.
        where: file and table, for messages.

    Returns:
        What the input is, and its values, shape (n,), N m, any unit or rad; None of a free decay.

    Raises:
        TunnelError: where the stated column is not there, or several may be the input.
    """
    if choices.input == "none":
        return None
    others = [channel for channel in channels if all(channel is not one for one in beside)]
    if choices.input is not None:
        named = [c for c in others if is_stated(c, choices)]
        if not named:
            raise TunnelError(
                f"no column '{one_line(choices.input, 40)}' for the input",
                where=where,
                remedy=f"--input: {did_you_mean(choices.input, {c.name for c in others})}",
            )
        return _as_input(named[0], reading, choices, said)
    # a column that is empty here is the input of other runs of the file
    exact = [channel for channel in others if is_input(channel) and np.isfinite(channel.values).any()]
    found = exact or [
        channel
        for channel in others
        if condition_of(channel.name, channel.unit) is None
        and (_moment_unit(channel) or _NAMES.search(channel.name))
        and _drives(channel.values, reading)
    ]
    if len(found) > 1:
        listed = ", ".join(f"'{one_line(c.name, 40)}'" for c in found)
        raise TunnelError(
            f"{len(found)} columns may be the input: {listed}",
            where=where,
            remedy=f'give --input "{one_line(found[0].name, 40)}", another of them, or --input none',
        )
    return _as_input(found[0], reading, choices, said) if found else None


def _as_input(
    channel: Channel, reading: Array, choices: ImportChoices, said: list[str]
) -> tuple[InputColumn, Array]:
    name = heading(channel)
    guessed: InputColumn = (
        "moment_nm"
        if name == "moment_nm" or _moment_unit(channel)
        else "base_rad"
        if kind_of(channel.unit) == "angle" and (name == "base_rad" or _BASE.search(channel.name))
        else "drive"
    )
    column = choices.input_as or guessed
    factor = UNITS["angle"].get(channel.unit, 1.0) if column == "base_rad" else 1.0
    meaning = {
        "moment_nm": "a known moment in N m",
        "drive": "an input of unknown gain",
        "base_rad": "the angle of the spring's root",
    }[column]
    size, lag = correlation(channel.values, reading)
    said.append(
        f"driven by '{one_line(channel.name, 40)}', {meaning} ({column}): its correlation with the reading is "
        f"{size:.2f} at a lag of {lag} samples; --input none if it is a free decay"
    )
    return column, channel.values * factor


def _moment_unit(channel: Channel) -> bool:
    return channel.unit.strip().lower() in _MOMENTS


def _drives(values: Array, reading: Array) -> bool:
    """Whether a column of a plausible name correlates with the motion, and is not the motion itself."""
    good = np.isfinite(values) & np.isfinite(reading)
    if np.count_nonzero(good) < 16:
        return False
    record = Record(np.arange(np.count_nonzero(good), dtype=np.float64), reading[good])
    try:
        checked_drive(Drive("drive", values[good]), record, "", judged=False)
    except TunnelError:
        return False
    return correlation(values, reading)[0] >= _CORRELATED


def correlation(values: Array, reading: Array) -> tuple[float, int]:
    """The greatest correlation of an input with a later reading.

    Args:
        values: of the input, any unit, shape (n,).
        reading: shape (n,), any unit.

    Returns:
        Its magnitude, from 0 to 1, and the lag in samples at which it occurs, of a quarter of the record at most.
    """
    good = np.isfinite(values) & np.isfinite(reading)
    x, y = values[good] - values[good].mean(), reading[good] - reading[good].mean()
    scale = float(np.sqrt((x @ x) * (y @ y)))
    if not scale > 0.0:
        return 0.0, 0
    size = 2 * x.size
    lags = np.fft.irfft(np.conj(np.fft.rfft(x, size)) * np.fft.rfft(y, size), size)[: max(1, x.size // 4)]
    best = int(np.argmax(np.abs(lags)))
    return float(min(1.0, abs(lags[best]) / scale)), best


def at_times(values: Array, time: Array, reading: Array, kept: Array) -> Array:
    """The input at the times that the clean-up of a record has kept.

    Args:
        values: of the input at every row, shape (m,).
        time: of the rows, shape (m,), s.
        reading: of the rows, shape (m,).
        kept: times from the first sample on, shape (n,), s, increasing.

    Returns:
        Shape (n,): of the row that is nearest in time.
    """
    good = np.flatnonzero(np.isfinite(time) & np.isfinite(reading))
    order = good[np.argsort(time[good], kind="stable")]
    if order.size == kept.size:
        return values[order]
    since = time[order] - time[order[0]]
    after = np.clip(np.searchsorted(since, kept), 1, since.size - 1)
    return values[order[np.where(kept - since[after - 1] < since[after] - kept, after - 1, after)]]
